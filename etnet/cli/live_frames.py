"""Frames as a live command writes them while they come, and the same frames again from what was recorded."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from jaxtyping import Float

from etnet.cli.frames_folder import FRAMES, make_room
from etnet.cli.progress import console, track
from etnet.cli.recording import Opening, open_with_progress
from etnet.errors import WindowError
from etnet.events.opened_as import WHOLE_VIEW
from etnet.export.frame_files import STAMPS, frame_name
from etnet.live.binning import binned
from etnet.live.log import windows_as_cut
from etnet.windows import Window

if TYPE_CHECKING:
    from torch import Tensor

    from etnet.nets.base import Reconstructor


class FrameFolder:
    """Writes frames/frame_000000.png … and a row of stamps.csv for each, at once; what an earlier call wrote goes."""

    def __init__(self, out: Path, model: Reconstructor, gamma: float | None, overwrite: bool) -> None:
        self.num_frames = 0
        self._frames = out / FRAMES
        make_room(self._frames, overwrite)
        self._gamma = gamma if gamma is not None else float(model.card.get("display_gamma", 1.0))  # pyright: ignore
        self._stamps = (out / STAMPS).open("w", encoding="ascii", newline="\n")
        self._stamps.write("frame,t_stop_us,t_start_us,num_events,merged\n")

    def add(self, window: Window, frame: Float[Tensor, "1 1 h w"], num_merged: int) -> None:
        """One more."""
        from etnet.export.images import to_uint8, write_png

        image = to_uint8(frame[0, 0].float().cpu().numpy(), self._gamma)
        write_png(self._frames / frame_name(window.index), image)
        row = (window.index, window.t_stop, window.t_start, window.num_events, num_merged)
        self._stamps.write(",".join(map(str, row)) + "\n")
        self._stamps.flush()
        self.num_frames += 1

    def __enter__(self) -> FrameFolder:
        return self

    def __exit__(self, *_: object) -> None:
        self._stamps.close()
        if not self.num_frames:
            (self._frames.parent / STAMPS).unlink(missing_ok=True)  # nothing that the next call would have to spare


def run_as_cut(
    file: Path,
    opening: Opening,
    out: Path,
    model_name: str,
    device: str,
    precision: str,
    gamma: float | None,
    overwrite: bool,
) -> int:
    """The live frames of a recorded file again; returns the exit code."""
    from etnet.nets.weights import load_model
    from etnet.reconstruction import reconstruct

    if opening.opened_as().view != WHOLE_VIEW:
        raise WindowError(f"{file.name}: --windows as-cut takes all of the recording, binned as it was live")
    with open_with_progress(file, opening) as recording:
        as_cut = windows_as_cut(recording)
        seen = binned(recording, as_cut.downsample)
        model = load_model(model_name, device, precision)  # pyright: ignore[reportArgumentType]
        with FrameFolder(out, model, gamma, overwrite) as folder:
            steps = reconstruct(model, seen, as_cut.windows)
            for window, step in track(steps, len(as_cut.windows), "reconstructing"):
                folder.add(window, step.frame, as_cut.num_merged[window.index])
    if as_cut.num_cut_off:
        console.print(f"{as_cut.num_cut_off} windows are left out: the file ends before them", markup=False)
    console.print(f"wrote {folder.num_frames} frames to {out}", markup=False, soft_wrap=True)
    return 0
