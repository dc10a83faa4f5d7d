"""CSV, npz and lines of text, alone or as a folder with the pictures."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import cv2
import numpy as np

from etnet.events.events import Events
from etnet.events.recording import Remark
from etnet.events.writers.part import Part, without_flow, without_frames, without_size, without_triggers

FOLDER_HOLDS = ("events.txt", "images.txt", "images", "metadata.json")
"""What lies in a folder that is written."""


def write_csv(part: Part, path: Path) -> tuple[Remark, ...]:
    """Columns by name, whole µs."""
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("t_us,x,y,p\n")
        for events in part.blocks():
            rows = zip(events.t.tolist(), events.x.tolist(), events.y.tolist(), (events.p > 0).tolist(), strict=True)
            file.writelines(f"{t},{x},{y},{p:d}\n" for t, x, y, p in rows)
    return without_size(part, "CSV"), *without_frames(part, "CSV has none"), *without_triggers(part, "CSV")


def write_npz(part: Part, path: Path) -> tuple[Remark, ...]:
    """Column by column, a block at a time, so that no recording is too large."""
    sensor = part.recording.sensor
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for axis, dtype in (("x", "<u2"), ("y", "<u2"), ("t", "<i8"), ("p", "|i1")):
            with archive.open(f"{axis}.npy", "w", force_zip64=True) as member:
                header = {"descr": dtype, "fortran_order": False, "shape": (part.num_events,)}
                np.lib.format.write_array_header_1_0(member, header)
                for events in part.blocks():
                    member.write(getattr(events, axis).astype(dtype, copy=False).tobytes())
        # Without its unit a reader would have to judge what t counts, and a quiet scene misleads it.
        named = {"time_unit": "us", **part.attributes()}
        texts = {name: np.array(text.encode()) for name, text in named.items()}
        for name, value in {"width": np.array(sensor.width), "height": np.array(sensor.height), **texts}.items():
            with archive.open(f"{name}.npy", "w") as member:
                np.lib.format.write_array(member, value)
    return without_frames(part, "these columns have none") + without_triggers(part, "npz")


def write_text(part: Part, path: Path) -> tuple[Remark, ...]:
    """rpg_e2vid's text: a line "width height", then "t x y p" with t in s and p 0 or 1."""
    sensor = part.recording.sensor
    _write_rows(part, path, f"{sensor.width} {sensor.height}\n")
    why = "a text has none; --layout rpg writes a folder that has"
    return without_frames(part, why) + without_triggers(part, "text")


def write_rpg_folder(part: Part, folder: Path) -> tuple[Remark, ...]:
    """The Event-Camera Dataset's folder (rpg.ifi.uzh.ch/davis_data): events.txt; images.txt with the pictures.

    What that layout has no place for stands in metadata.json, where EVREAL has the sensor's size.
    """
    _write_rows(part, folder / "events.txt")
    lines: list[str] = []
    for number, (stamp, pixels) in enumerate(part.pictures(has_colour=True)):
        name = f"images/frame_{number:08d}.png"
        (folder / "images").mkdir(exist_ok=True)
        (folder / name).write_bytes(cv2.imencode(".png", pixels)[1].tobytes())
        lines.append(f"{_seconds(stamp)} {name}\n")
    if lines:
        (folder / "images.txt").write_text("".join(lines), "ascii")
    sensor = part.recording.sensor
    known = {"sensor_resolution": [sensor.height, sensor.width], "white": part.white[0], **part.attributes()}
    (folder / "metadata.json").write_text(json.dumps(known, indent=1) + "\n", "ascii")
    return without_flow(part) + without_triggers(part, "this folder")


def _write_rows(part: Part, path: Path, head: str = "") -> None:
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write(head)
        for events in part.blocks():
            file.writelines(_rows(events))


def _rows(events: Events) -> list[str]:
    columns = (events.t.tolist(), events.x.tolist(), events.y.tolist(), (events.p > 0).tolist())
    if len(events) and events.t[0] >= 0:
        return [f"{t // 1_000_000}.{t % 1_000_000:06d} {x} {y} {p:d}\n" for t, x, y, p in zip(*columns, strict=True)]
    return [f"{_seconds(t)} {x} {y} {p:d}\n" for t, x, y, p in zip(*columns, strict=True)]


def _seconds(stamp: int) -> str:
    """µs as seconds, all six digits."""
    whole, rest = divmod(abs(stamp), 1_000_000)
    return f"{'-' if stamp < 0 else ''}{whole}.{rest:06d}"
