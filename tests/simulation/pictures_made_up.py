"""Pictures for tests: soft noise with the contrast of photos, and one cut-out. No file is needed."""

import cv2
import numpy as np

from etnet.simulation.pictures import Cutout, PicturePool


def made_up_pool(num_photos: int = 6) -> PicturePool:
    """Clouds in several sizes, as 8-bit sRGB."""
    rng = np.random.default_rng(7)
    photos = []
    for i in range(num_photos):
        cloud = sum(
            cv2.GaussianBlur(rng.standard_normal((180, 240)), (0, 0), sigma) * sigma for sigma in (1.5, 4.0, 12.0)
        )
        photos.append(np.clip(110 + 45 * cloud / cloud.std() + 5 * i, 0, 255).astype(np.uint8))
    disc = np.zeros((64, 80), np.uint8)
    cv2.circle(disc, (40, 32), 25, 255, -1)
    return PicturePool.of(photos, [Cutout(photos[0][:64, :80].copy(), disc)])
