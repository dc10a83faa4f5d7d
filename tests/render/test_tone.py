import numpy as np
import pytest

from etnet.render.tone import GAMMA, resolve, robust_range, tone_map


def ramp():
    return np.linspace(-0.2, 1.2, 200, dtype=np.float32).reshape(10, 20)


def test_auto_is_gamma_for_linear_light_only():
    assert resolve("auto", True) == "gamma"
    assert resolve("auto", False) == "raw"
    assert resolve("robust", True) == "robust"


@pytest.mark.parametrize("tone", ["auto", "raw", "gamma", "robust"])
@pytest.mark.parametrize("linear", [True, False])
def test_tone_never_reverses_the_order_of_brightness(tone, linear):
    assert (np.diff(tone_map(ramp(), tone, linear).ravel().astype(int)) >= 0).all()


def test_raw_clips_and_scales():
    grey = tone_map(np.array([[-1.0, 0.0, 0.5, 1.0, 7.0]]), "raw", True)
    assert grey.tolist() == [[0, 0, 128, 255, 255]]


def test_gamma_follows_its_power():
    assert tone_map(np.full((2, 2), 0.22), "gamma", True)[0, 0] == round(0.22 ** (1 / GAMMA) * 255)


def test_robust_ignores_one_pixel_in_a_thousand():
    frame = np.full((40, 50), 0.5)
    frame[:, ::2] = 0.4
    frame[0, 0] = 1e6
    assert robust_range(frame) == pytest.approx((0.4, 0.5))


@pytest.mark.parametrize("frame", [np.full((3, 4), np.nan), np.full((3, 4), 0.3), np.full((3, 4), np.inf)])
@pytest.mark.parametrize("tone", ["raw", "gamma", "robust"])
def test_flat_and_broken_frames_still_give_a_picture(frame, tone):
    assert tone_map(frame, tone, True).shape == (3, 4)


def test_auto_hdr_takes_the_frames_own_black_and_white_but_blows_no_flat_frame_up():
    frame = np.linspace(0.2, 0.7, 100, dtype=np.float32).reshape(10, 10)
    grey = tone_map(frame, "hdr", is_linear_light=False)
    assert (grey.min(), grey.max()) == (0, 255)
    flat = tone_map(np.full((4, 4), 0.5, np.float32), "hdr", is_linear_light=False)
    assert flat[0, 0] == pytest.approx(127.5, abs=0.5)


def test_local_contrast_shows_what_a_global_scale_hides():
    rows, columns = np.mgrid[:64, :64]
    dark = 0.1 + 0.02 * ((rows // 4 + columns // 4) % 2)
    frame = np.where(columns < 32, dark, dark + 0.8).astype(np.float32)
    plain, local = (tone_map(frame, tone, is_linear_light=False) for tone in ("raw", "clahe"))
    assert local[:, 4:12].std() > 1.5 * plain[:, 4:12].std()


@pytest.mark.parametrize("tone", ["hdr", "clahe"])
def test_every_tone_takes_any_frame(tone):
    assert tone_map(np.full((9, 7), np.nan, np.float32), tone, is_linear_light=True).shape == (9, 7)
