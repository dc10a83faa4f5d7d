"""A run as one folder that a machine without internet trains from; what it leaves there is taken up at home."""

from __future__ import annotations

import io
import shlex
import shutil
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from etnet.bundled import bundled_folder
from etnet.evaluation.lpips import ALEX_FILE
from etnet.files import in_megabytes, replace_folder, working_folder
from etnet.training.checkpoint import LAST, check_continues, check_same_run, load_checkpoint
from etnet.training.config import TrainConfig, TrainingError
from etnet.training.distributed import World
from etnet.training.log import LOG
from etnet.training.loop import decided
from etnet.training.needs import NEEDS
from etnet.training.pack_pictures import PackedPictures, pack_pictures

PACKAGE = Path(__file__).resolve().parents[1]
SOURCE, START, RUN, WEIGHTS = "etnet.zip", "start.safetensors", "run", "weights.safetensors"
LONG_AGO = (1980, 1, 1, 0, 0, 0)
"""Every file's date in the archive, so that the same source is the same bytes."""

SCRIPT = """\
#!/bin/sh
# Trains with what lies in this folder and nothing else: sh run.sh
# Options are those of `etnet train` and win over what stands below: sh run.sh --minutes 5 --data.workers 8
# {run}/ then holds the checkpoint, the log and {weights}. Called again, it goes on from there.
set -eu
CDPATH= cd -- "$(dirname -- "$0")"
python=${{PYTHON:-python3}}
if [ ! -d source ]; then
    rm -rf source.unfinished
    "$python" -m zipfile -e {source} source.unfinished
    mv source.unfinished source
fi
PYTHONPATH="$PWD/source${{PYTHONPATH:+:$PYTHONPATH}}"
export PYTHONPATH
"$python" -m etnet.training.needs
"$python" -m etnet.cli.main train {command} "$@"
"$python" -m etnet.cli.main train --out {run} --export {run}/{weights}
"""


@dataclass(frozen=True, slots=True)
class Packed:
    """What a pack holds: the pictures, and the bytes of each of its parts."""

    pictures: PackedPictures | None
    parts: dict[str, int]

    @property
    def sentence(self) -> str:
        """In words."""
        parts = ", ".join(f"{name} {in_megabytes(count)}" for name, count in self.parts.items())
        how = "" if self.pictures is None else f"; {self.pictures.count} pictures {self.pictures.how}"
        return f"{in_megabytes(sum(self.parts.values()))} ({parts}{how})"


def away(config: TrainConfig) -> TrainConfig:
    """The config of the same run in its pack: everything lies beside it, and a GPU is taken where there is one.

    Real recordings stay at home; folders of pictures keep their names, by which a run knows its own.
    """
    data = config.data
    return replace(
        config,
        out=Path(RUN),
        start=None if config.start is None or (config.out / LAST).exists() else Path(START),
        device="auto" if config.device == "cpu" else config.device,
        data=replace(
            data,
            photos=None if data.photos is None else Path("photos", data.photos.name),
            cutouts=None if data.cutouts is None else Path("cutouts", data.cutouts.name),
        ),
        validation=replace(config.validation, recordings=()),
    )


def write_pack(
    config: TrainConfig,
    folder: Path,
    max_bytes: int,
    command_line: Callable[[TrainConfig], Sequence[str]],
    changed: bool = False,
) -> Packed:
    """Write the pack of a run: of the one in `config.out` where there is one, else of one that begins.

    Photos and cut-outs take at most `max_bytes` together. `command_line` tells a config in options.
    """
    if folder.exists():
        raise TrainingError(f"{folder}: is there already; name a new folder with --pack")
    last, there = config.out / LAST, away(config)
    if last.exists():
        check = check_continues if changed else check_same_run
        check(decided(config, World(), last), load_checkpoint(last), last)
    with working_folder(folder) as made:
        parts = {"source": _keep(made / SOURCE, source_archive())}
        pictures = None
        if there.data.photos is not None:
            photos, cutouts = made / there.data.photos, made / (there.data.cutouts or "cutouts")
            pictures = pack_pictures(config, photos, cutouts, max_bytes)
            parts["pictures"] = pictures.num_bytes
        if last.exists():
            (made / RUN).mkdir()
            parts["run"] = sum(_copy(path, made / RUN) for path in (last, config.out / LOG) if path.exists())
        elif config.start is not None:
            parts["start"] = _copy(config.start, made / START)
        words = [*command_line(there), *(["--changed"] if changed else [])]
        script = SCRIPT.format(command=shlex.join(words), source=SOURCE, run=RUN, weights=WEIGHTS)
        _keep(made / "run.sh", script.encode())
        (made / "run.sh").chmod(0o755)
        _keep(made / "requirements.txt", "".join(f"{package}\n" for package in NEEDS.values()).encode())
        replace_folder(made, folder)
    return Packed(pictures, parts)


def source_archive() -> bytes:
    """The package with what training reads beside it (LPIPS), and their notices; unpacked, it can be imported."""
    models, licence = bundled_folder() / "models", PACKAGE.parent / "LICENSE"
    files = {f"etnet/{path.relative_to(PACKAGE).as_posix()}": path for path in sorted(PACKAGE.rglob("*.py"))}
    files = {name: path for name, path in files.items() if not name.startswith("etnet/static/")}
    files |= {f"etnet/static/models/{name}": models / name for name in (ALEX_FILE, "lpips_alex.md")}
    if licence.exists():
        files["LICENSE"] = licence
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, path in files.items():
            archive.writestr(zipfile.ZipInfo(name, LONG_AGO), path.read_bytes(), zipfile.ZIP_DEFLATED)
    return content.getvalue()


def _keep(target: Path, content: bytes) -> int:
    target.write_bytes(content)
    return len(content)


def _copy(path: Path, target: Path) -> int:
    return Path(shutil.copy(path, target)).stat().st_size
