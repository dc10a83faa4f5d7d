"""LPIPS equals its definition, and the scale of its figures on real frames is the known one."""

import io
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from etnet.errors import WeightsError
from etnet.evaluation.lpips import LPIPS, MIN_SIDE, load_lpips
from tests.real_data import real_file


@pytest.fixture(scope="module")
def lpips() -> LPIPS:
    return load_lpips()


def images(count: int, height: int, width: int, seed: int) -> torch.Tensor:
    return torch.rand(count, 1, height, width, generator=torch.Generator().manual_seed(seed))


def convolve(x: np.ndarray, weight: np.ndarray, bias: np.ndarray, stride: int, padding: int) -> np.ndarray:
    """Cross-correlation written out, in double precision: x is c h w, weight is o c k k."""
    side = weight.shape[-1]
    x = np.pad(x, ((0, 0), (padding, padding), (padding, padding)))
    patches = np.lib.stride_tricks.sliding_window_view(x, (side, side), axis=(1, 2))[:, ::stride, ::stride]
    return np.einsum("chwij,ocij->ohw", patches, weight, optimize=True) + bias[:, None, None]


def pool(x: np.ndarray) -> np.ndarray:
    return np.lib.stride_tricks.sliding_window_view(x, (3, 3), axis=(1, 2))[:, ::2, ::2].max(axis=(3, 4))


def slow_lpips(first: np.ndarray, second: np.ndarray, arrays: dict[str, np.ndarray]) -> float:
    """The definition of the model card, line by line."""
    shift, scale = np.array([-0.030, -0.088, -0.188]), np.array([0.458, 0.448, 0.450])

    def taps(image: np.ndarray) -> list[np.ndarray]:
        x = np.stack([2 * image - 1] * 3)
        x = (x - shift[:, None, None]) / scale[:, None, None]
        found = []
        for layer, stride, padding in ((0, 4, 2), (3, 1, 2), (6, 1, 1), (8, 1, 1), (10, 1, 1)):
            x = pool(x) if layer in (3, 6) else x
            weight, bias = arrays[f"features.{layer}.weight"], arrays[f"features.{layer}.bias"]
            x = np.maximum(convolve(x, weight, bias, stride, padding), 0)
            found.append(x / (np.sqrt((x**2).sum(0)) + 1e-10))
        return found

    return sum(
        float((((a - b) ** 2) * arrays[f"lin{i}.weight"][0]).sum(0).mean())
        for i, (a, b) in enumerate(zip(taps(first), taps(second), strict=True))
    )


def test_it_equals_a_slow_twin_written_from_the_definition(lpips: LPIPS) -> None:
    arrays = {
        name.replace("_", ".", 1) if name.startswith("features") else name: array.double().numpy()
        for name, array in lpips.named_buffers()
    }
    arrays = {name.replace("_weight", ".weight").replace("_bias", ".bias"): array for name, array in arrays.items()}
    first, second = images(1, 70, 93, 1), images(1, 70, 93, 2)
    expected = slow_lpips(first[0, 0].double().numpy(), second[0, 0].double().numpy(), arrays)
    assert lpips(first, second).item() == pytest.approx(expected, rel=1e-5)


def test_it_is_zero_for_equal_images_and_the_same_both_ways(lpips: LPIPS) -> None:
    first, second = images(2, 64, 80, 3), images(2, 64, 80, 4)
    assert lpips(first, first).tolist() == [0, 0]
    assert torch.equal(lpips(first, second), lpips(second, first))
    assert (lpips(first, second) > 0).all()


def test_kept_features_give_the_same_distance(lpips: LPIPS) -> None:
    first, second = images(2, 64, 80, 5), images(2, 64, 80, 6)
    assert torch.equal(lpips.distance(lpips.features(first), lpips.features(second)), lpips(first, second))


def test_grey_is_the_three_channels_repeated(lpips: LPIPS) -> None:
    first, second = images(1, 64, 64, 7), images(1, 64, 64, 8)
    three = lpips(first.expand(-1, 3, -1, -1), second.expand(-1, 3, -1, -1))
    assert three.item() == pytest.approx(lpips(first, second).item(), abs=1e-6)


@pytest.mark.parametrize("value", [0.0, 0.4])
def test_the_gradient_of_a_flat_image_is_finite(lpips: LPIPS, value: float) -> None:
    flat = torch.full((1, 1, MIN_SIDE, MIN_SIDE), value, requires_grad=True)
    lpips(flat, images(1, MIN_SIDE, MIN_SIDE, 9)).sum().backward()
    assert flat.grad is not None
    assert flat.grad.isfinite().all()


def test_no_optimiser_finds_its_weights(lpips: LPIPS) -> None:
    assert not list(lpips.parameters())


def test_autocast_does_not_change_it(lpips: LPIPS) -> None:
    first, second = images(1, 40, 40, 10), images(1, 40, 40, 11)
    with torch.autocast("cpu", torch.bfloat16):
        mixed = lpips(first, second)
    assert torch.equal(mixed, lpips(first, second))


def test_too_small_an_image_is_refused_with_the_side_that_it_takes(lpips: LPIPS) -> None:
    with pytest.raises(ValueError, match=str(MIN_SIDE)):
        lpips(images(1, 30, 64, 1), images(1, 30, 64, 2))


def test_a_file_of_something_else_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "other.npz"
    np.savez(other, frames=np.zeros(3))
    with pytest.raises(WeightsError, match=r"other\.npz.*missing"):
        load_lpips(other)
    other.write_bytes(b"not an archive")
    with pytest.raises(WeightsError, match="cannot be read"):
        load_lpips(other)


@pytest.fixture(scope="module")
def slider_depth_frames() -> np.ndarray:
    with zipfile.ZipFile(real_file("ecd_slider_depth/slider_depth.zip")) as archive:
        rows = [line.split() for line in io.TextIOWrapper(archive.open("slider_depth/images.txt"))]
        names = [name for stamp, name in rows if 1.0 <= float(stamp) <= 2.5]
        files = [np.frombuffer(archive.read(f"slider_depth/{name}"), np.uint8) for name in names]
    frames = [cv2.imdecode(file, cv2.IMREAD_GRAYSCALE) for file in files[::4]]
    return np.stack([frame for frame in frames if frame is not None]).astype(np.float32) / 255


@pytest.mark.real
@pytest.mark.parametrize(
    ("distortion", "expected"),
    [("noise", 0.171), ("blur 1", 0.168), ("blur 1.5", 0.280), ("brighter", 0.065), ("shift", 0.033)],
)
def test_the_scale_of_its_figures_on_real_frames(
    lpips: LPIPS, slider_depth_frames: np.ndarray, distortion: str, expected: float
) -> None:
    """Noise σ .02, Gaussian blurs, + .15 brightness and one pixel to the right, on ground truth of slider_depth."""
    truth = slider_depth_frames
    match distortion.split():
        case ["noise"]:
            changed = truth + np.random.default_rng(0).normal(0, 0.02, truth.shape).astype(np.float32)
        case ["blur", sigma]:
            changed = np.stack([cv2.GaussianBlur(frame, (0, 0), float(sigma)) for frame in truth])
        case ["brighter"]:
            changed = truth + np.float32(0.15)
        case _:
            changed = np.roll(truth, 1, axis=2)
    with torch.no_grad():
        measured = lpips(torch.from_numpy(changed)[:, None], torch.from_numpy(truth)[:, None]).mean().item()
    assert measured == pytest.approx(expected, abs=0.003)


@pytest.mark.real
def test_rounding_to_half_precision_moves_it_little(lpips: LPIPS) -> None:
    full = load_lpips(real_file("../weights/lpips_alex_v0.1_fp32.npz"))
    first, second = images(2, 96, 96, 12), images(2, 96, 96, 13)
    assert (lpips(first, second) - full(first, second)).abs().max() < 2e-4
