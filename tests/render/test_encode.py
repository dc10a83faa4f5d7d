import base64

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etnet.render.encode import Indexed, data_url, jpeg, png


@pytest.mark.parametrize("shape", [(9, 11), (9, 11, 3), (9, 11, 4)])
def test_png_keeps_every_value_in_its_channel(shape):
    image = np.random.default_rng(0).integers(0, 256, shape, dtype=np.uint8)
    back = cv2.imdecode(np.frombuffer(png(image), np.uint8), cv2.IMREAD_UNCHANGED)
    order = {2: slice(None), 3: [2, 1, 0], 4: [2, 1, 0, 3]}[len(shape) if len(shape) == 2 else shape[2]]
    assert np.array_equal(back if len(shape) == 2 else back[..., order], image)


def test_jpeg_keeps_colours_in_order():
    image = np.zeros((16, 16, 3), np.uint8)
    image[..., 0] = 250
    back = cv2.imdecode(np.frombuffer(jpeg(image), np.uint8), cv2.IMREAD_COLOR)
    assert back[..., 2].mean() > 240
    assert back[..., 0].mean() < 10


def test_a_data_url_holds_the_image():
    image = np.full((4, 4), 7, np.uint8)
    head, body = data_url(image, is_lossless=True).split(",")
    assert head == "data:image/png;base64"
    assert base64.b64decode(body) == png(image)


@given(st.integers(1, 256), st.tuples(st.integers(1, 40), st.integers(1, 40)), st.integers(0, 99))
def test_an_image_of_few_colours_is_the_same_picture_in_fewer_bytes(num_colours, size, seed):
    rng = np.random.default_rng(seed)
    palette = rng.integers(0, 256, (num_colours, 3), dtype=np.uint8)
    image = Indexed(rng.integers(0, num_colours, size, dtype=np.uint8), palette)
    read = cv2.imdecode(np.frombuffer(png(image), np.uint8), cv2.IMREAD_COLOR_RGB)
    assert np.array_equal(read, image.colours)
    assert np.array_equal(image.colours, palette[image.level])
    assert data_url(image, is_lossless=False) == data_url(image, is_lossless=True)
