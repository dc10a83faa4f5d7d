"""Every container that torch knows, and what is mistaken for one: read without running anything, or refused by name."""

import io
import pickle
import tarfile
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file
from torch import nn

from etnet.cli.main import main
from etnet.errors import WeightsError
from etnet.nets.checkpoint_reader import Foreign, read_checkpoint, state_dict_of

WEIGHTS = {"a.weight": torch.arange(6.0).reshape(2, 3), "b.bias": torch.tensor([1, -2], dtype=torch.int64)}


class AddOne(nn.Module):
    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return x + 1


def as_zip(path: Path) -> None:
    torch.save({"state_dict": WEIGHTS}, path)


def as_zip_of_a_newer_pickle(path: Path) -> None:
    torch.save({"state_dict": WEIGHTS}, path, pickle_protocol=5)


def as_pickles(path: Path) -> None:
    torch.save({"state_dict": WEIGHTS}, path, _use_new_zipfile_serialization=False)


def as_torchscript(path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.jit.script(AddOne()).save(path)


def as_package(path: Path) -> None:
    with warnings.catch_warnings(), torch.package.PackageExporter(path) as exporter:
        warnings.simplefilter("ignore")
        exporter.save_pickle("model", "model.pkl", {"weight": WEIGHTS["a.weight"]})


def as_exported_program(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:  # torch.export.save takes seconds; these are its entries' names
        archive.writestr("model/archive_format", "pt2")
        archive.writestr("model/models/model.json", "{}")


def as_old_tar(path: Path) -> None:
    with tarfile.open(path, "w") as archive:
        for name in ("sys_info", "pickle", "tensors", "storages"):
            archive.addfile(tarfile.TarInfo(name), io.BytesIO())


def as_plain_pickle(path: Path) -> None:
    path.write_bytes(pickle.dumps({"state_dict": {}}))


def as_safetensors(path: Path) -> None:
    save_file({name: tensor.clone() for name, tensor in WEIGHTS.items()}, path)


def as_arrays(path: Path) -> None:
    with open(path, "wb") as file:
        np.savez(file, a=np.ones(3))


@pytest.mark.parametrize("write", [as_zip, as_zip_of_a_newer_pickle, as_pickles])
def test_a_checkpoint_is_read(write: Callable[[Path], None], tmp_path: Path):
    write(tmp_path / "x.pth")
    read = state_dict_of(read_checkpoint(tmp_path / "x.pth"), "x.pth")
    assert read.keys() == WEIGHTS.keys()
    assert all(torch.equal(read[name], WEIGHTS[name]) for name in WEIGHTS)
    assert {name: tensor.dtype for name, tensor in read.items()} == {name: t.dtype for name, t in WEIGHTS.items()}


@pytest.mark.parametrize(
    ("write", "words"),
    [
        (as_torchscript, "TorchScript"),
        (as_package, r"torch\.package"),
        (as_exported_program, r"\.pt2"),
        (as_old_tar, "tar file"),
        (as_plain_pickle, "pickle that torch.save did not write"),
        (as_safetensors, "safetensors file, which needs no conversion"),
        (as_arrays, "zip without data.pkl"),
        (lambda path: path.write_bytes(b""), "empty"),
        (lambda path: path.mkdir(), "no regular file"),
        (lambda path: path.write_text("<!doctype html><title>404</title>"), "web page"),
        (lambda path: path.write_text("version https://git-lfs.github.com/spec/v1\n"), "Git LFS"),
        (lambda path: path.write_bytes(b"PK\x03\x04 cut short"), "damaged zip"),
        (lambda path: path.write_bytes(bytes(1000)), "neither a zip nor a pickle"),
    ],
)
def test_everything_else_is_refused_by_what_it_is(
    write: Callable[[Path], None], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    write(tmp_path / "x.pth")
    with pytest.raises(WeightsError, match=words):
        read_checkpoint(tmp_path / "x.pth")
    assert main(["convert", str(tmp_path / "x.pth"), str(tmp_path / "out.safetensors")]) == 1
    assert capsys.readouterr().err.count("\n") == 1


def test_torch_never_loads_a_foreign_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("torch's own loader was called")

    monkeypatch.setattr(torch, "load", refuse)
    monkeypatch.setattr(torch.jit, "load", refuse)
    as_torchscript(tmp_path / "script.pth")
    with pytest.raises(WeightsError, match="TorchScript"):
        read_checkpoint(tmp_path / "script.pth")
    as_pickles(tmp_path / "x.pth")
    assert read_checkpoint(tmp_path / "x.pth")


@pytest.mark.parametrize("is_zip", [True, False])
def test_nothing_of_a_checkpoint_is_run(is_zip: bool, tmp_path: Path):
    marker = tmp_path / "was-run"

    class Attack:
        def __reduce__(self):
            return (exec, (f"open({str(marker)!r}, 'w').close()",))

    torch.save({"state_dict": WEIGHTS, "x": Attack()}, tmp_path / "x.pth", _use_new_zipfile_serialization=is_zip)
    assert isinstance(read_checkpoint(tmp_path / "x.pth")["x"], Foreign)
    assert not marker.exists()


def zip_with(path: Path, edit: Callable[[dict[str, bytes]], None], compression: int = zipfile.ZIP_STORED) -> Path:
    as_zip(path)
    with zipfile.ZipFile(path) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    edit(entries)
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
    return path


def test_what_unpacks_to_more_than_it_holds_is_refused(tmp_path: Path):
    def grow(entries: dict[str, bytes]) -> None:
        entries["x/data/0"] = bytes(1 << 24)

    path = zip_with(tmp_path / "x.pth", grow, zipfile.ZIP_DEFLATED)
    with pytest.raises(WeightsError, match="compressed, which torch never does"):
        read_checkpoint(path)


def test_a_storage_shorter_than_its_tensor_is_refused(tmp_path: Path):
    def cut(entries: dict[str, bytes]) -> None:
        entries["x/data/0"] = entries["x/data/0"][:-4]

    with pytest.raises(WeightsError, match="a storage of 6 items has 20 bytes"):
        read_checkpoint(zip_with(tmp_path / "x.pth", cut))


@pytest.mark.parametrize(("size", "stride"), [((10_000, 10_000), (0, 0)), ((7,), (1,)), ((2,), (-1,))])
def test_a_tensor_reaches_no_further_than_its_storage(size: tuple[int, ...], stride: tuple[int, ...], tmp_path: Path):
    class Lie:
        def __reduce__(self):
            storage = torch.zeros(6).untyped_storage()
            typed = torch.storage.TypedStorage(wrap_storage=storage, dtype=torch.float32, _internal=True)
            return (torch._utils._rebuild_tensor_v2, (typed, 0, size, stride, False, {}))

    torch.save({"state_dict": {"a": Lie()}}, tmp_path / "x.pth")
    with pytest.raises(WeightsError, match="lies outside its storage of 6 items"):
        read_checkpoint(tmp_path / "x.pth")


@pytest.mark.parametrize("write", [as_zip, as_pickles])
def test_a_file_cut_anywhere_is_one_line(write: Callable[[Path], None], tmp_path: Path):
    path = tmp_path / "x.pth"
    write(path)
    whole = path.read_bytes()
    for length in range(0, len(whole), max(1, len(whole) // 40)):
        path.write_bytes(whole[:length])
        with pytest.raises(WeightsError) as failure:
            read_checkpoint(path)
        assert "\n" not in str(failure.value)


@pytest.mark.parametrize("write", [as_zip, as_pickles])
def test_damaged_bytes_give_a_checkpoint_or_one_line(write: Callable[[Path], None], tmp_path: Path):
    path, rng = tmp_path / "x.pth", np.random.default_rng(0)
    write(path)
    whole = np.frombuffer(path.read_bytes(), np.uint8)
    for _ in range(150):
        damaged = whole.copy()
        damaged[rng.integers(0, len(whole), 3)] = rng.integers(0, 256, 3)
        path.write_bytes(damaged.tobytes())
        said = ""
        try:
            read_checkpoint(path)
        except WeightsError as error:
            said = str(error)
        assert "\n" not in said
