"""`etnet simulate OUT --video …`: what a modelled sensor, or a twin of your own, sees of footage."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.table import Table

from etnet.cli.filming import Filming, footage
from etnet.cli.filming_sources import sources_in
from etnet.cli.many_files import check_folder, write_many
from etnet.cli.progress import console, fraction_callback
from etnet.errors import EtnetError
from etnet.events.open import open_recording
from etnet.events.write import WITHOUT_PROVENANCE, Layout, check_place, layout_of, write_recording
from etnet.files import write_atomically
from etnet.simulation.footage import Footage
from etnet.simulation.like import Twin, beside, measure_twin
from etnet.simulation.video import VideoConfig, Written, simulate_footage


@dataclass(frozen=True)
class Filmed:
    """What was asked for, beside the options of filming; `size` None: that of the camera, or of the pictures."""

    seed: int
    size: tuple[int, int] | None
    fps: float | None
    seconds: float | None


def run_video(filming: Filming, out: Path, asked: Filmed) -> int:
    """Do it; returns the exit code."""
    found = sources_in(filming, out)
    if found == filming.video and len(found) == 1:
        # What cannot be written is refused before the work, not after it.
        layout = layout_of(out, filming.layout)
        filming.config(asked.seed, asked.size)
        check_place(out, layout, filming.overwrite)
        config = _with_twin(filming, asked)
        _simulated(filming, asked, config, found[0], out, layout)
        return 0
    layout = filming.layout or "event_utils"
    check_folder(out, len(found))
    config = _with_twin(filming, asked)

    def work(source: Path, target: Path, told: Callable[[float], None]) -> int:
        return _simulated(filming, asked, config, source, target, layout, told)

    settings = f"{replace(filming, video=(), overwrite=False)} {asked} {_marks(filming)}"
    return write_many(found, out, layout, settings, work, filming.overwrite, "frames")


def _with_twin(filming: Filming, asked: Filmed) -> VideoConfig:
    twin = None if filming.like is None else _measured(filming.like)
    return filming.config(asked.seed, asked.size, None if twin is None else twin.pixels)


def _marks(filming: Filming) -> list[tuple[int, int]]:
    """Sizes and times of change of the files that decide what is simulated."""
    motion = None if filming.motion is None else Path(filming.motion)
    files = [path for path in (filming.like, filming.interpolator, filming.stamps, motion) if path and path.is_file()]
    return [(path.stat().st_size, path.stat().st_mtime_ns) for path in files]


def _simulated(
    filming: Filming,
    asked: Filmed,
    config: VideoConfig,
    source: Path,
    out: Path,
    layout: Layout,
    told: Callable[[float], None] | None = None,
) -> int:
    """One source into one file; how many frames it has."""
    out.resolve().parent.mkdir(parents=True, exist_ok=True)
    attributes = filming.attributes(asked.fps, asked.seconds)
    with closing(footage(filming, source, config, asked.fps, asked.seconds)) as frames:
        written = _write(layout, frames, out, config, attributes, told or (lambda _: None))
    for remark in written.remarks:
        console.print(f"  {remark}", markup=False, soft_wrap=True, style="dim")
    seen = f"{written.num_events:,} events, {written.num_frames:,} frames"
    console.print(f"wrote {out}: {seen}; look at it with etnet-view {out}", markup=False, soft_wrap=True)
    return written.num_frames


def _write(
    layout: Layout,
    footage: Footage,
    out: Path,
    config: VideoConfig,
    attributes: Mapping[str, str | int | float],
    told: Callable[[float], None],
) -> Written:
    with fraction_callback(f"watching {footage.name}") as bar:

        def progress(share: float) -> None:
            bar(share)
            told(share)

        if layout == "event_utils":
            return simulate_footage(footage, out, config, progress, attributes=attributes)
        with TemporaryDirectory(prefix="etnet-simulate-", dir=out.resolve().parent) as folder:
            made = Path(folder) / f"{out.stem}.h5"
            written = simulate_footage(footage, made, config, progress, attributes=attributes)
            if written.num_events == 0:
                raise EtnetError(f"{footage.name}: {written.remarks[-1]}")
            with open_recording(made) as recording, fraction_callback(f"writing {out.name}") as writing:
                said = write_recording(recording, out, layout, overwrite=True, progress=writing)
    kept = () if layout not in WITHOUT_PROVENANCE else (_keep_beside(footage, out, config, attributes),)
    return written._replace(remarks=(*written.remarks, *(remark.text for remark in said), *kept))


def _keep_beside(footage: Footage, out: Path, config: VideoConfig, attributes: Mapping[str, str | int | float]) -> str:
    """The parameters in a file beside one that has no place for them."""
    parameters = out.with_name(out.name + ".json")
    known = {
        "source": footage.name,
        **config.as_attributes,
        "tone": str(footage.tone),
        **attributes,
        "remarks": footage.remarks,
    }
    write_atomically(parameters, (json.dumps(known, indent=1) + "\n").encode())
    return f"the parameters stand in {parameters.name}"


def _measured(path: Path) -> Twin:
    with open_recording(path) as recording, fraction_callback(f"measuring {path.name}") as progress:
        twin = measure_twin(recording, progress=progress)
    settings = ", ".join(f"{name} {value:g}" for name, value in twin.pixels.as_attributes.items() if value)
    console.print(f"the sensor of {path.name}: {settings}", markup=False, soft_wrap=True)
    for remark in twin.remarks:
        console.print(f"  {remark}", markup=False, soft_wrap=True, style="dim")
    if twin.correlation is not None:
        title = f"voxels correlate by {twin.correlation:.2f} on its own frames"
        table = Table(title=title, title_justify="left", box=None)
        for heading in ("", "recorded", "simulated"):
            table.add_column(heading, justify="left" if not heading else "right")
        for row in beside(twin):
            table.add_row(*row)
        console.print(table)
    return twin
