"""What one frame of a video or one PNG shows: panels side by side, enlarged, with or without a line of stamps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from etnet.errors import EtnetError, RecordingError
from etnet.export.compared import LIMIT, Cell, Runs, apart_words, board_of, letter_and_hue
from etnet.export.images import check_gamma, to_uint8
from etnet.export.take import Moment
from etnet.render.colours import GROUND, diverge
from etnet.render.events import EventStyle, event_image
from etnet.render.tone import Tone, tone_map

PanelName = Literal["events", "reconstruction", "camera"]
GAP = 2
"""Pixels of ground between two panels."""
STAMP_COLOUR = (236, 238, 242)


@dataclass(frozen=True, slots=True)
class Look:
    """How moments are drawn. The reconstruction alone, unscaled and without stamps, is grey; all else is colour."""

    panels: tuple[PanelName, ...] = ("reconstruction",)
    gamma: float = 1.0
    """Display gamma of the reconstruction and the camera's frame."""
    scale: int = 1
    """Whole pixels on a pixel's side."""
    has_stamps: bool = False
    """A line below the picture: seconds, window, events."""
    tone: Tone = "auto"
    """How frames become grey levels; "auto" is the display gamma alone."""
    event_style: EventStyle = "polarity"
    runs: Runs | None = None
    """The names of several runs: each has its panel where the reconstruction's stands, and all have titles."""

    def __post_init__(self) -> None:
        if not self.panels:
            raise EtnetError("no panel is to be shown; choose from events, reconstruction, camera")
        if not 1 <= self.scale <= 16:
            raise EtnetError(f"scale is {self.scale}; it takes a whole number from 1 to 16")
        check_gamma(self.gamma)

    @property
    def is_grey(self) -> bool:
        """Whether pictures have one channel."""
        return self.runs is None and set(self.panels) <= {"reconstruction", "camera"}


def card_gamma(model: Any) -> float:
    """The display gamma that a model's card asks for; 1 without one."""
    return float(getattr(model, "card", {}).get("display_gamma", 1.0))


Picture = UInt8[np.ndarray, "h w"] | UInt8[np.ndarray, "h w 3"]


def draw(moment: Moment, look: Look, num_windows: int) -> Picture:
    """The picture of one moment; all pictures of one take and look have the same size."""
    picture = (
        _side_by_side(moment, look) if look.runs is None else board_of([*_cells(moment, look, look.runs)], look.scale)
    )
    return _stamped(picture, moment, num_windows) if look.has_stamps else picture


def _side_by_side(moment: Moment, look: Look) -> Picture:
    panels = [_panel(moment, name, look) for name in look.panels]
    ground = GROUND[0] if look.is_grey else np.array(GROUND, np.uint8)
    picture = panels[0]
    for panel in panels[1:]:
        gap = np.full((picture.shape[0], GAP, *picture.shape[2:]), ground, np.uint8)
        picture = np.concatenate([picture, gap, panel], axis=1)
    return picture.repeat(look.scale, axis=0).repeat(look.scale, axis=1) if look.scale > 1 else picture


def _cells(moment: Moment, look: Look, runs: Runs) -> Iterator[Cell]:
    """The panels with their titles; in the reconstruction's place every run."""
    every = (moment, *moment.beside)
    for name in look.panels:
        if name == "reconstruction":
            yield from (_run_cell(number, every, look, runs) for number in range(len(runs.titles)))
        elif name == "camera" and runs.camera_error is not None:
            yield _error_cell(runs.camera_error, every, runs)
        elif name == "camera":
            note = apart_words(moment.camera_lag or 0, "after A", "before A")
            yield Cell(_panel(moment, name, look), "Camera", note=note)
        else:
            yield Cell(_panel(moment, name, look), "Events")


def _run_cell(number: int, every: Sequence[Moment], look: Look, runs: Runs) -> Cell:
    title, moment = runs.titles[number], every[number]
    if runs.sight == "error":
        return _error_cell(number, every, runs)
    letter, hue = letter_and_hue(runs.number(number))
    note = apart_words(moment.window.t_stop - every[0].window.t_stop)
    if runs.sight == "difference" and number:
        image = diverge(moment.frame - every[0].frame, LIMIT)
        return Cell(image, f"{title.network} - A", letter, hue, note=note, is_signed=True)
    image = _panel(moment, "reconstruction", replace(look, gamma=title.gamma))
    return Cell(image, title.network, letter, hue, title.settings, note)


def _error_cell(number: int, every: Sequence[Moment], runs: Runs) -> Cell:
    """A run's raw frame minus the camera's."""
    title, moment, (letter, hue) = runs.titles[number], every[number], letter_and_hue(runs.number(number))
    camera = moment.camera
    if camera is None or camera.shape != moment.frame.shape:
        raise RecordingError(
            f"{moment.recording.name}: has no camera frames of the sensor's size, so runs have no error; show their "
            "frames or their difference"
        )
    note = apart_words(moment.window.t_stop - every[0].window.t_stop)
    return Cell(
        diverge(moment.frame - camera, LIMIT), f"{title.network} - camera", letter, hue, "", note, is_signed=True
    )


def _panel(moment: Moment, name: PanelName, look: Look) -> Picture:
    sensor = moment.recording.sensor
    if name == "events":
        return event_image(moment.events, look.event_style, moment.window.t_start, moment.window.t_stop)[0].colours
    if name == "reconstruction":
        grey = _grey(moment.frame, look)
    else:
        if moment.camera is None:
            raise RecordingError(
                f"{moment.recording.name}: has no camera frames to show; leave the camera panel out, "
                "or choose a recording with frames"
            )
        grey = _grey(moment.camera, look)
        if grey.shape != (sensor.height, sensor.width):
            grey = cv2.resize(grey, (sensor.width, sensor.height), interpolation=cv2.INTER_AREA)
    return grey if look.is_grey else grey[..., None].repeat(3, axis=2)


def _grey(frame: Float32[np.ndarray, "h w"], look: Look) -> UInt8[np.ndarray, "h w"]:
    if look.tone == "auto":
        return to_uint8(frame, look.gamma)
    return tone_map(frame, look.tone, is_linear_light=look.gamma != 1.0)


def _stamped(picture: Picture, moment: Moment, num_windows: int) -> Picture:
    """A strip below the picture, so that no pixel of it is hidden. Its letters shrink until the line fits.

    Its height follows from the picture's width alone, so that all pictures of a take have one size.
    """
    width = picture.shape[1]
    which = f"window {moment.window.index} of 0 - {num_windows - 1}"
    line = f"{moment.seconds:.3f} s   {which}   {moment.window.num_events:,} events"
    size = 0.6
    while size > 0.3 and cv2.getTextSize(line, cv2.FONT_HERSHEY_SIMPLEX, size, 1)[0][0] > width - 8:
        size -= 0.05
    height = round(min(max(width / 10, 12), 24))
    strip = np.full((height, width, *picture.shape[2:]), GROUND[0], np.uint8)
    if picture.ndim == 3:
        strip[:] = GROUND
    colour = STAMP_COLOUR if picture.ndim == 3 else STAMP_COLOUR[:1]
    cv2.putText(
        strip, line, (4, round((height + 14 * size) / 2)), cv2.FONT_HERSHEY_SIMPLEX, size, colour, 1, cv2.LINE_AA
    )
    return np.concatenate([picture, strip], axis=0)
