"""Samples on demand, from a fake package in a folder: pip never touches a network here."""

import hashlib
import io
import tarfile
import zipfile
from dataclasses import replace
from pathlib import Path, PurePosixPath

import pytest

from etnet.cli.main import main
from etnet.events import samples
from etnet.events.samples import SLIDER_DEPTH, RemoteSample, SampleError, cached, fetch, find_sample
from tests.real_data import real_file

FILES = {"calib.txt": b"1 2 3\n", "events.txt": b"0.0 1 1 1\n" * 500, "images/frame_00000000.png": b"\x89PNG"}
BUILD = b'[build-system]\nrequires = ["nobody_has_this"]\nbuild-backend = "nobody_has_this"\n'


def digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def make_package(folder: Path, files: dict[str, bytes], place: str = "data/toy") -> Path:
    """A source package `toysample-1.0.tar.gz` that carries files and cannot be built."""
    members = {"PKG-INFO": b"Metadata-Version: 2.1\nName: toysample\nVersion: 1.0\n"}
    members["pyproject.toml"] = BUILD
    members |= {f"{place}/{name}": content for name, content in files.items()} | {f"{place}/extra.txt": b"more"}
    folder.mkdir(exist_ok=True)
    path = folder / "toysample-1.0.tar.gz"
    with tarfile.open(path, "w:gz") as archive:
        for name, content in members.items():
            member = tarfile.TarInfo(f"toysample-1.0/{name}")
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    return path


@pytest.fixture
def package(tmp_path, monkeypatch):
    path = make_package(tmp_path / "index", FILES)
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(path.parent))
    monkeypatch.setenv("ETNET_CACHE", str(tmp_path / "cache"))
    return path


def toy_of(package: Path) -> RemoteSample:
    hashes = {name: digest(content) for name, content in FILES.items()}
    archive = digest(package.read_bytes())
    return RemoteSample("toy", "toysample==1.0", archive, PurePosixPath("data/toy"), 8_000, "terms of the toy", hashes)


def content_of(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_sample_comes_out_of_a_source_package_that_cannot_be_built(package, tmp_path, monkeypatch):
    toy, heard = toy_of(package), []
    # What lies in the current folder is not run, whatever it is called.
    (tmp_path / "pip.py").write_text("raise SystemExit('the wrong pip')")
    monkeypatch.chdir(tmp_path)
    assert cached(toy) is None
    folder = fetch(toy, progress=heard.append)
    assert folder == tmp_path / "cache" / "toy"
    assert content_of(folder) == FILES
    assert heard[-1] == 1.0
    assert all(0 <= fraction <= 1 for fraction in heard)
    assert [path.name for path in (tmp_path / "cache").iterdir()] == ["toy"]


def test_what_is_there_and_whole_is_not_fetched_again(package):
    toy = toy_of(package)
    folder = fetch(toy)
    package.unlink()
    assert fetch(toy) == folder == cached(toy)


def test_a_damaged_copy_is_fetched_again(package):
    toy = toy_of(package)
    folder = fetch(toy)
    (folder / "events.txt").write_bytes(b"other")
    assert cached(toy) is None
    assert content_of(fetch(toy)) == FILES


def test_offline_says_so_in_one_line_and_leaves_nothing(package, tmp_path):
    toy = toy_of(package)
    package.unlink()
    with pytest.raises(SampleError, match=r"could not fetch toysample==1.0 .*--from") as caught:
        fetch(toy)
    assert "\n" not in str(caught.value)
    assert list((tmp_path / "cache").iterdir()) == []


def test_another_package_under_the_same_name_is_refused(package, tmp_path):
    toy = toy_of(package)
    make_package(package.parent, FILES | {"calib.txt": b"changed"})
    with pytest.raises(SampleError, match="not the one that was checked"):
        fetch(toy)
    with pytest.raises(SampleError, match=r"calib.txt differs"):
        fetch(toy_of(package))
    assert list((tmp_path / "cache").iterdir()) == []


def test_a_package_of_another_layout_is_named(package):
    moved = make_package(package.parent, FILES, place="elsewhere")
    with pytest.raises(SampleError, match=r"holds no data/toy"):
        fetch(toy_of(moved))


def test_pip_that_is_missing_is_named(package, monkeypatch, tmp_path):
    python = tmp_path / "python"
    python.write_text('#!/bin/sh\necho "$0: No module named pip" >&2\nexit 1\n')
    python.chmod(0o755)
    monkeypatch.setattr(samples.sys, "executable", str(python))
    with pytest.raises(SampleError, match="-m ensurepip"):
        fetch(toy_of(package))


def test_progress_can_end_the_work(package, tmp_path, monkeypatch):
    monkeypatch.setattr(samples, "POLL_SECONDS", 0.01)

    def stop(_: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fetch(toy_of(package), progress=stop)
    assert list((tmp_path / "cache").iterdir()) == []


@pytest.mark.parametrize("kind", ["folder", "zip", "zip without a folder", "package"])
def test_an_archive_at_hand_serves_without_pip(package, tmp_path, kind, monkeypatch):
    toy, archive = toy_of(package), tmp_path / "at_hand"
    monkeypatch.setattr(samples.sys, "executable", "/nowhere")
    if kind == "package":
        archive = package
    elif kind == "folder":
        for name, content in FILES.items():
            (archive / "toy" / name).parent.mkdir(parents=True, exist_ok=True)
            (archive / "toy" / name).write_bytes(content)
    else:
        with zipfile.ZipFile(archive, "w") as opened:
            for name, content in FILES.items():
                opened.writestr(name if "without" in kind else f"toy/{name}", content)
            opened.writestr("../outside.txt", "never unpacked")
    assert content_of(fetch(toy, tmp_path / "out", archive)) == FILES
    assert not (tmp_path / "outside.txt").exists()


def test_an_archive_that_will_not_do_is_named(package, tmp_path):
    toy = toy_of(package)
    (tmp_path / "text").write_text("hello")
    with zipfile.ZipFile(tmp_path / "some.zip", "w") as opened:
        opened.writestr("calib.txt", FILES["calib.txt"])
    for name, what in (("absent", "no such file"), ("text", "neither a zip"), ("some.zip", "does not hold toy")):
        with pytest.raises(SampleError, match=what):
            fetch(toy, archive=tmp_path / name)


def test_the_command_shows_the_terms_and_prints_the_folder_alone(package, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(samples, "SAMPLES", {"toy": toy_of(package)})
    assert main(["sample", "toy", "--from", str(package), "--out", str(tmp_path / "here")]) == 0
    said = capsys.readouterr()
    assert said.out.strip() == str(tmp_path / "here" / "toy")
    assert "terms of the toy" in said.err
    assert main(["sample", "nothing"]) == 1
    assert "no sample is called 'nothing'; there is toy" in capsys.readouterr().err


def test_the_real_sample_is_pinned_file_by_file():
    sample = find_sample("slider_depth")
    assert len(sample.files) == 91
    assert all(len(value) == 64 for value in [sample.archive_sha256, *sample.files.values()])
    assert sum(name.startswith("images/") for name in sample.files) == 87
    assert "non-commercial" in sample.terms


@pytest.mark.real
def test_the_real_archive_has_the_pinned_files(tmp_path):
    folder = fetch(SLIDER_DEPTH, tmp_path, real_file("ecd_slider_depth/slider_depth.zip"))
    assert len(content_of(folder)) == 91
    wrong = replace(SLIDER_DEPTH, files=dict.fromkeys(SLIDER_DEPTH.files, "0" * 64))
    with pytest.raises(SampleError, match="differs"):
        fetch(wrong, tmp_path / "again", folder)
