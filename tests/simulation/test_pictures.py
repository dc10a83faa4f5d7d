import cv2
import numpy as np
import pytest

from etnet.simulation.pictures import Cutout, PictureError, PicturePool, is_held_out, linear_of, srgb_of
from tests.simulation.pictures_made_up import made_up_pool


@pytest.fixture
def folder(tmp_path):
    for i in range(60):
        source = "tfflowers" if i % 2 else "cid22"
        cv2.imwrite(str(tmp_path / f"{source}__{i}.png"), np.full((20, 30), i, np.uint8))
    cv2.imwrite(str(tmp_path / "skimage__cat.png"), np.zeros((20, 30), np.uint8))
    return tmp_path


def test_the_splits_share_nothing_and_miss_nothing(folder):
    train = set(PicturePool.from_folder(folder, split="train").names)
    held_out = set(PicturePool.from_folder(folder, split="held-out").names)
    assert not train & held_out
    assert train | held_out == {p.name for p in folder.glob("*.png")} - {"skimage__cat.png"}
    assert all(is_held_out(name) for name in held_out)


def test_one_name_in_ten_is_held_out():
    assert np.mean([is_held_out(f"photo_{i}.jpg") for i in range(5_000)]) == pytest.approx(0.1, abs=0.015)


def test_flowers_are_drawn_less_often(folder):
    pool, rng = PicturePool.from_folder(folder, split="all"), np.random.default_rng(0)
    values = np.array([int(pool.draw_photo(rng)[0, 0]) for _ in range(4_000)])
    assert (values % 2).mean() == pytest.approx(0.3 / 1.3, abs=0.03)


def test_memory_stays_below_its_cap(folder):
    assert PicturePool.from_folder(folder, split="all", max_bytes=20_000).num_bytes <= 20_000


def test_tone_curves_are_inverse():
    codes = np.arange(256, dtype=np.uint8)[None]
    assert np.allclose(srgb_of(linear_of(codes)) * 255, codes, atol=0.01)


def test_cutouts_keep_their_alpha(tmp_path, folder):
    objects = tmp_path / "objects"
    objects.mkdir()
    picture = np.full((9, 9, 4), 80, np.uint8)
    picture[:4, :, 3] = 0
    cv2.imwrite(str(objects / "box.webp"), picture, [cv2.IMWRITE_WEBP_QUALITY, 101])
    cutout = PicturePool.from_folder(folder, objects, split="all").draw_cutout(np.random.default_rng(0))
    assert isinstance(cutout, Cutout)
    assert (cutout.alpha[:4] == 0).all()
    assert (cutout.alpha[4:] == 80).all()


@pytest.mark.parametrize("name", ["absent", "empty", "broken", "opaque"])
def test_pictures_that_cannot_be_used_are_named(tmp_path, name):
    place = tmp_path / name
    photos, cutouts = place, None
    if name != "absent":
        place.mkdir()
    if name == "broken":
        (place / "a.jpg").write_bytes(b"nothing")
    if name == "opaque":
        cutouts = place
        photos = tmp_path / "photos"
        photos.mkdir()
        for folder in (place, photos):
            cv2.imwrite(str(folder / "a.png"), np.zeros((9, 9, 3), np.uint8))
    with pytest.raises(PictureError, match=str(place)):
        PicturePool.from_folder(photos, cutouts, split="all")


def test_a_pool_needs_a_photo():
    with pytest.raises(PictureError, match="no photos"):
        PicturePool.of([])
    assert PicturePool.of(made_up_pool().photos).draw_cutout(np.random.default_rng(0)) is None
