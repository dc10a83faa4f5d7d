"""MSE and SSIM are scikit-image's; the affine fit is the least-squares one; the rest keeps its laws."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage.metrics import mean_squared_error as skimage_mse
from skimage.metrics import structural_similarity as skimage_ssim

from etnet.evaluation.metrics import (
    SSIM_EVREAL,
    SSIM_PAPER,
    best_affine,
    contrast,
    mean_squared_error,
    robust_range,
    sharpness,
    structural_similarity,
)


def pair(seed: int, height: int = 37, width: int = 53) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[:height, :width]
    target = 0.5 + 0.3 * np.sin(columns / 6) * np.cos(rows / 9) + rng.normal(0, 0.05, (height, width))
    prediction = 0.7 * target + 0.1 + rng.normal(0, 0.08, target.shape)
    return prediction.astype(np.float32), target.astype(np.float32)


def tensor(image: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(image)[None, None]


@pytest.mark.parametrize("seed", range(4))
def test_mse_is_that_of_scikit_image(seed: int) -> None:
    prediction, target = pair(seed)
    measured = mean_squared_error(tensor(prediction), tensor(target)).item()
    assert measured == pytest.approx(skimage_mse(target.astype(float), prediction.astype(float)), rel=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_the_papers_ssim_is_scikit_images_default_with_range_two(seed: int) -> None:
    prediction, target = (image.astype(np.float64) for image in pair(seed))
    expected = skimage_ssim(target, prediction, data_range=2)
    measured = structural_similarity(tensor(prediction), tensor(target), SSIM_PAPER).item()
    assert measured == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_the_ssim_of_evreal_is_scikit_images_gaussian_one(seed: int) -> None:
    prediction, target = (image.astype(np.float64) for image in pair(seed))
    expected = skimage_ssim(
        target, prediction, data_range=1, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
    )
    measured = structural_similarity(tensor(prediction), tensor(target), SSIM_EVREAL).item()
    assert measured == pytest.approx(expected, abs=1e-12)


def test_ssim_in_single_precision_as_others_compute_it_differs_by_little() -> None:
    prediction, target = pair(5)
    expected = skimage_ssim(target, prediction, data_range=2)
    assert structural_similarity(tensor(prediction), tensor(target), SSIM_PAPER).item() == pytest.approx(
        expected, abs=1e-5
    )


@pytest.mark.parametrize("variant", [SSIM_PAPER, SSIM_EVREAL])
def test_a_batch_gives_what_its_images_give_alone(variant) -> None:
    pairs = [pair(seed) for seed in range(3)]
    batch = structural_similarity(
        torch.cat([tensor(p) for p, _ in pairs]), torch.cat([tensor(t) for _, t in pairs]), variant
    )
    alone = [structural_similarity(tensor(p), tensor(t), variant).item() for p, t in pairs]
    assert batch.tolist() == pytest.approx(alone, abs=1e-12)


def test_an_image_smaller_than_the_window_is_refused() -> None:
    with pytest.raises(ValueError, match="11"):
        structural_similarity(torch.zeros(1, 1, 10, 40), torch.zeros(1, 1, 10, 40), SSIM_EVREAL)


@given(seed=st.integers(0, 1000), gain=st.floats(0.2, 3), shift=st.floats(-1, 1))
@settings(max_examples=20, deadline=None)
def test_affine_changes_of_brightness_do_not_matter_after_the_fit(seed: int, gain: float, shift: float) -> None:
    prediction, target = (tensor(image).double() for image in pair(seed))
    first, second = best_affine(prediction, target), best_affine(gain * prediction + shift, target)
    assert torch.allclose(first, second, atol=1e-9)


def test_the_affine_fit_is_the_least_squares_solution() -> None:
    prediction, target = (image.astype(np.float64) for image in pair(6))
    columns = np.stack([prediction.ravel(), np.ones(prediction.size)], axis=1)
    gain, shift = np.linalg.lstsq(columns, target.ravel(), rcond=None)[0]
    np.testing.assert_allclose(best_affine(tensor(prediction), tensor(target))[0, 0], gain * prediction + shift)


def test_the_affine_fit_of_a_flat_image_is_the_targets_mean() -> None:
    _, target = pair(7)
    fitted = best_affine(torch.full((1, 1, *target.shape), 0.3), tensor(target))
    assert torch.allclose(fitted, tensor(target).mean())


def test_robust_range_spans_zero_to_one_and_keeps_the_order() -> None:
    image = tensor(pair(8)[0])
    stretched = robust_range(image)
    assert stretched.min() == 0
    assert stretched.max() == 1
    low, high = np.percentile(image.numpy(), (1, 99))
    expected = np.clip((image.numpy() - low) / (high - low), 0, 1)
    np.testing.assert_allclose(stretched.numpy(), expected, atol=1e-6)


def test_robust_range_of_a_flat_image_is_finite() -> None:
    assert robust_range(torch.full((1, 1, 8, 8), 0.4)).isfinite().all()


def test_contrast_and_sharpness_grow_with_the_gain_and_ignore_brightness() -> None:
    image = tensor(pair(9)[0]).double()
    for measure in (contrast, sharpness):
        assert measure(2 * image).item() == pytest.approx(2 * measure(image).item())
        assert measure(image + 0.2).item() == pytest.approx(measure(image).item())
        assert measure(torch.full_like(image, 0.3)).item() == pytest.approx(0, abs=1e-12)


def test_the_sharpness_of_a_ramp_is_its_slope() -> None:
    ramp = (torch.arange(20) * 0.01).repeat(15, 1)[None, None]
    assert sharpness(ramp).item() == pytest.approx(0.01, rel=1e-5)
