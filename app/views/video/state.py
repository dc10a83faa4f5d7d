"""What the view keeps of a page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

Measure = Literal["lpips", "ssim", "mse"]


@dataclass(frozen=True, slots=True)
class VideoState:
    """The sensor's settings are part of the recording's id; here is only what is drawn of the scores."""

    view: ClassVar[str] = "video"
    measure: Measure = "lpips"
