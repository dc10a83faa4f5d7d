"""The ONNX graphs give the frames of our own step, at any size, over a sequence."""

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import eventcv
import numpy as np
import onnx
import onnxruntime
import pytest
import torch

from etnet.cli.export import parse_size
from etnet.errors import EtnetError
from etnet.export.onnx_graphs import ExportError, write_graphs
from etnet.nets.attention import MultiHeadAttention
from etnet.nets.presets import PRESETS, Network, build_model
from etnet.nets.weights import load_model, save_weights

STEP_SIZE = (45, 61)


def small_half() -> Network:
    """Every field of the default network, at a tenth of its width, with attention so sharp that its scale matters."""
    small = replace(
        PRESETS["etnet-half"],  # pyright: ignore[reportArgumentType]
        base_channels=4,
        dim=32,
        feed_forward=64,
        encoder_depth=1,
        decoder_depth=1,
    )
    model = build_model(small)
    with torch.no_grad():
        for module in model.modules():
            if isinstance(module, MultiHeadAttention):
                module.in_proj_weight.mul_(6)
    return model


def written_by_the_command(folder: Path, model: Network, *more: str) -> list[Path]:
    """In a process of its own, as users run it: here every int is checked, and a traced size is none."""
    save_weights(model, folder / "x.safetensors", dtype=torch.float32)
    command = "import sys; from etnet.cli.main import main; sys.exit(main(sys.argv[1:]))"
    arguments = ["export", "onnx", "-o", str(folder / "out"), "--model", str(folder / "x.safetensors"), *more]
    done = subprocess.run([sys.executable, "-c", command, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    names = [line.removeprefix("wrote ") for line in done.stderr.splitlines()]
    return [Path(name) for name in names]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Network, list[Path]]:
    model = small_half()
    return model, written_by_the_command(tmp_path_factory.mktemp("onnx"), model, "--size", "61x45")


def voxels(count: int, size: tuple[int, int]) -> list[torch.Tensor]:
    generator = torch.Generator().manual_seed(3)
    return [torch.randn(1, 5, *size, generator=generator) for _ in range(count)]


def our_frames(model: Network, inputs: list[torch.Tensor]) -> Iterator[np.ndarray]:
    state = None
    for voxel in inputs:
        with torch.inference_mode():
            step = model(voxel, state)
        state = step.state
        yield step.frame.numpy()


def run_apart(paths: list[Path], inputs: list[torch.Tensor]) -> Iterator[np.ndarray]:
    """Encode with states handed on, then decode."""
    encode, decode = (onnxruntime.InferenceSession(path) for path in paths[:2])
    feed = {port.name: None for port in encode.get_inputs() if port.name.startswith("state_")}
    height, width = inputs[0].shape[-2:]
    for port in encode.get_inputs():
        if port.name in feed:
            scale = {"rows": 8, "columns": 8, "2*rows": 4, "4*rows": 2, "8*rows": 1}[port.shape[2]]
            feed[port.name] = np.zeros((1, port.shape[1], height // scale, width // scale), np.float32)
    names = [port.name for port in encode.get_outputs()]
    for voxel in inputs:
        given = dict(zip(names, encode.run(None, {"voxels": voxel.numpy(), **feed}), strict=True))
        feed = {name.removeprefix("new_"): value for name, value in given.items() if name.startswith("new_")}
        yield decode.run(None, {name: value for name, value in given.items() if name.startswith("level_")})[0]


@pytest.mark.parametrize("size", [(48, 64), (88, 40), (160, 200)])
def test_encode_and_decode_give_our_frames_at_any_size(written: tuple[Network, list[Path]], size: tuple[int, int]):
    model, paths = written
    inputs = voxels(4, size)
    for ours, theirs in zip(our_frames(model, inputs), run_apart(paths, inputs), strict=True):
        np.testing.assert_allclose(theirs, ours, atol=1e-4)


def test_a_whole_step_gives_our_frames_in_eventcvs_stateful_model(written: tuple[Network, list[Path]]):
    model, paths = written
    graph = eventcv.Model(str(paths[2]))
    states = [port["name"] for port in graph.inputs if port["name"].startswith("state_")]
    driven = eventcv.StatefulModel(graph, {f"new_{name}": name for name in states})
    inputs = voxels(5, STEP_SIZE)
    for ours, voxel in zip(our_frames(model, inputs), inputs, strict=True):
        np.testing.assert_allclose(driven(voxel.numpy()), ours, atol=1e-4)
    driven.reset()
    np.testing.assert_allclose(driven(inputs[0].numpy()), next(our_frames(model, inputs)), atol=1e-4)


def test_the_graphs_pass_the_checker_and_say_what_they_are(written: tuple[Network, list[Path]]):
    _, paths = written
    for path in paths:
        onnx.checker.check_model(str(path), full_check=True)
        assert '"multiple_of": 8' in {prop.key: prop.value for prop in onnx.load(path).metadata_props}["etnet"]
    fixed = onnxruntime.InferenceSession(paths[2])
    assert all(isinstance(length, int) for port in fixed.get_inputs() for length in port.shape)
    assert [path.name for path in paths] == ["encode.onnx", "decode.onnx", "step_61x45.onnx"]
    assert sorted(path.name for path in paths[0].parent.iterdir()) == sorted(path.name for path in paths)


def test_a_network_that_gives_whole_steps_only_is_refused(tmp_path: Path):
    with pytest.raises(ExportError, match="pie-net-lite: gives whole steps only"):
        write_graphs(load_model("pie-net-lite"), tmp_path)


def test_sizes_are_width_by_height():
    assert parse_size("240x180") == (180, 240)
    for text in ("240", "240x", "0x180", "99999x180", "axb"):
        with pytest.raises(EtnetError, match="write WIDTHxHEIGHT"):
            parse_size(text)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["firenet", "e2vid", "etnet-half"])
def test_every_network_with_a_memoryless_decoder_is_written_from_the_command_line(name: str, tmp_path: Path):
    model = load_model(name) if name == "etnet-half" else build_model(name)
    paths, inputs = written_by_the_command(tmp_path, model), voxels(3, (88, 104))
    for ours, theirs in zip(our_frames(model, inputs), run_apart(paths, inputs), strict=True):
        np.testing.assert_allclose(theirs, ours, atol=1e-4)


@pytest.mark.slow
def test_a_network_steps_as_before_once_it_was_exported():
    code = """
import sys, tempfile, torch
from pathlib import Path
from etnet.export.onnx_graphs import write_graphs
from etnet.nets.presets import build_model
model, voxel = build_model("tiny"), torch.ones(1, 5, 48, 64)
before = model(voxel).frame
with tempfile.TemporaryDirectory() as folder:
    write_graphs(model, Path(folder))
sys.exit(not torch.equal(model(voxel).frame, before))
"""
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).returncode == 0
