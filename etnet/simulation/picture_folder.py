"""A folder of pictures as footage: numbered frames of a renderer or of another simulator, with their stamps."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Shaped

from etnet.errors import RecordingError
from etnet.simulation.arrays import light_of
from etnet.simulation.footage import Frame, Framing
from etnet.simulation.picture_file import SUFFIXES, assumed_tone, colour_of, read_picture
from etnet.simulation.repeats import is_same, told_repeats
from etnet.simulation.tone import Tone

_TABLES = ("images.txt", "timestamps.txt", "stamps.csv", "timestamps.csv", "image_timestamps.txt", "data.csv")


class PictureFolder:
    """The pictures of a folder, or those that a pattern such as `render/frame_*.png` names, in order of their numbers.

    Stamps are, in this order: `fps`; the table `stamps`; a table in the folder or beside it. Its layouts: "seconds
    name" (images.txt of the ECD dataset), "name,stamp" and "stamp,name" in CSV (Kalibr, EuRoC: nanoseconds), and one
    stamp a line (v2e's and vid2e's timestamps.txt). Names that are whole numbers of 16 digits or more are
    Kalibr's own: nanoseconds.
    """

    is_fine = False

    def __init__(
        self,
        where: Path,
        framing: Framing | None = None,
        fps: float | None = None,
        stamps: Path | None = None,
        tone: Tone | None = None,
        drops_repeats: bool = False,
        has_colour: bool = False,
    ) -> None:
        """`tone` None: light itself where values are floats, else sRGB; which of the two is told."""
        self.name, self.remarks, self._framing = where.name, list[str](), framing or Framing()
        self._drops_repeats, self._has_colour = drops_repeats, has_colour
        self._paths = _pictures(where)
        self._stamps = self._timed(where, fps, stamps)
        first = read_picture(self._paths[0])
        self.tone = tone or assumed_tone(first, self.remarks)
        if has_colour and first.ndim == 2:
            self.remarks.append("its pictures are grey: there is no colour to store")
        self.bits = 8 if first.dtype == np.uint8 else 16
        self.sensor = self._framing.sensor(first.shape[1], first.shape[0], self.name)
        self.duration = (self._stamps[-1] - self._stamps[0]) / self._framing.speed
        self.interval = self.duration * 1e6 / (len(self._paths) - 1)

    def __iter__(self) -> Iterator[Frame]:
        origin, last, num_frames, num_repeats, brightest = None, -np.inf, 0, 0, 0.0
        before: Shaped[np.ndarray, "h w *c"] | None = None
        for path, stamp in zip(self._paths, self._stamps, strict=True):
            since = stamp - self._stamps[0]
            if since < self._framing.start:
                continue
            if self._framing.stop is not None and since > self._framing.stop:
                break
            if stamp <= last:
                raise RecordingError(
                    f"{path.name}: its stamp {stamp:g} s does not come after {last:g} s; sort the table"
                )
            origin, last = stamp if origin is None else origin, stamp
            picture = read_picture(path)
            is_repeat = before is not None and _repeats(picture, before)
            num_repeats += is_repeat
            if is_repeat and self._drops_repeats:
                continue
            before, num_frames = picture, num_frames + 1
            light = light_of(picture, self.tone, path.name)
            brightest = max(brightest, float(light.max()))
            t = (stamp - origin) * 1e6 / self._framing.speed
            yield Frame(t, self._framing.applied(light, self.sensor, path.name), self._colour(picture, path.name))
        self.remarks += told_repeats(num_repeats, num_frames, self._drops_repeats)
        if self.tone.curve == "linear" and brightest > 1:
            self.remarks.append(f"light goes up to {brightest:.3g} times white; the stored frames end at white")
        if num_frames < 2:
            raise RecordingError(f"{self.name}: {num_frames} pictures lie in the part asked for; events need two")

    def _colour(self, picture: Shaped[np.ndarray, "h w *c"], name: str) -> np.ndarray | None:
        if not self._has_colour or picture.ndim == 2:
            return None
        return self._framing.applied(colour_of(picture), self.sensor, name)

    def close(self) -> None:
        """Nothing to give back."""

    def _timed(self, where: Path, fps: float | None, table: Path | None) -> Sequence[float]:
        """Seconds of each picture; pictures that a table does not name are left out."""
        folder = where if where.is_dir() else where.parent
        if fps is not None:
            if not 0.001 <= fps <= 1e6:
                raise RecordingError(f"--fps is {fps:g}; it takes 0.001 to 1,000,000 pictures a second")
            return [i / fps for i in range(len(self._paths))]
        found = [path for base in (folder, folder.parent) for name in _TABLES if (path := base / name).is_file()]
        table = table or next(iter(found), None)
        if table is None:
            named = [path.stem for path in self._paths]
            if all(re.fullmatch(r"\d{16,20}", stem) for stem in named):
                self.remarks.append("stamps are the pictures' names, nanoseconds")
                return [int(stem) / 1e9 for stem in named]
            raise RecordingError(f"{self.name}: nothing says when its pictures were taken; give --fps or --stamps FILE")
        self.remarks.append(f"stamps are those of {table.name}")
        return self._of_table(table)

    def _of_table(self, table: Path) -> Sequence[float]:
        rows = [re.split(r"[\s,;]+", line.strip()) for line in table.read_text(errors="replace").splitlines()]
        rows = [row for row in rows if row[0] and not row[0].startswith("#") and any(_is_number(cell) for cell in row)]
        stamp_by_name: dict[str, float] = {}
        loose: list[float] = []
        for row in rows:
            name = next((cell for cell in row if Path(cell).suffix.lower() in SUFFIXES), None)
            number = next((float(cell) for cell in row if cell != name and _is_number(cell)), None)
            if number is not None and name is not None:
                stamp_by_name[Path(name).name] = number
            elif number is not None:
                loose.append(float(row[-1]) if len(row) > 1 and _is_number(row[-1]) else number)
        if stamp_by_name:
            named = [path for path in self._paths if path.name in stamp_by_name]
            if len(named) < len(self._paths):
                self.remarks.append(f"{len(self._paths) - len(named)} pictures that it does not name are left out")
            self._paths = named
            values = [stamp_by_name[path.name] for path in self._paths]
        else:
            values = loose
        if len(values) != len(self._paths) or len(values) < 2:
            raise RecordingError(f"{table.name}: holds {len(values)} stamps for {len(self._paths)} pictures")
        unit, text = _unit(values)
        self.remarks.append(f"they are taken as {text}")
        return [(value - values[0]) * unit for value in values]


def _unit(values: Sequence[float]) -> tuple[float, str]:
    """Seconds that one unit stands for: whole numbers whose step is that of a camera in µs or ns."""
    step = float(np.median(np.diff(values)))
    if step >= 1e6:
        return 1e-9, "nanoseconds"
    return (1e-6, "microseconds") if step >= 50 else (1.0, "seconds")


def _pictures(where: Path) -> list[Path]:
    if where.is_dir():
        folder = where / "images" if (where / "images").is_dir() and not _in(where, "*") else where
        found = _in(folder, "*")
    else:
        found = _in(where.parent, where.name)
    if len(found) < 2:
        raise RecordingError(
            f"{where.name}: holds {len(found)} pictures; events need two ({', '.join(sorted(SUFFIXES))})"
        )
    return found


def _repeats(one: Shaped[np.ndarray, "_ _ *c"], other: Shaped[np.ndarray, "_ _ *c"]) -> bool:
    if one.shape != other.shape or one.dtype != other.dtype:
        return False
    return is_same(one, other, 8 * one.itemsize) if one.dtype.kind == "u" else np.array_equal(one, other)


def _in(folder: Path, pattern: str) -> list[Path]:
    found = [path for path in folder.glob(pattern) if path.suffix.lower() in SUFFIXES and path.is_file()]
    return sorted(found, key=lambda path: [int(c) if c.isdigit() else c for c in re.split(r"(\d+)", path.name)])


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
