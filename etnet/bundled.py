"""Where the weights and samples lie that come with the project: inside the wheel, or in the checkout's `static/`."""

from __future__ import annotations

from pathlib import Path


def bundled_folder() -> Path:
    """The folder that holds `models/` and `samples/`."""
    installed = Path(__file__).resolve().parent / "static"
    return installed if installed.is_dir() else Path(__file__).resolve().parents[1] / "static"


def models() -> tuple[Path, ...]:
    """Weights files that come with the project, by name."""
    return tuple(sorted((bundled_folder() / "models").glob("*.safetensors")))


def samples() -> tuple[Path, ...]:
    """Recordings that come with the project, by name."""
    return tuple(sorted((bundled_folder() / "samples").glob("*.h5")))
