"""Where weights, samples and the page's parts lie that come with the project: in the wheel, or in `static/`."""

from __future__ import annotations

from pathlib import Path


def bundled_folder() -> Path:
    """The folder that holds `models/`, `samples/` and `export_page/`."""
    installed = Path(__file__).resolve().parent / "static"
    return installed if installed.is_dir() else Path(__file__).resolve().parents[1] / "static"


def models() -> tuple[Path, ...]:
    """Weights files that come with the project, by name."""
    return tuple(sorted((bundled_folder() / "models").glob("*.safetensors")))


def samples() -> tuple[Path, ...]:
    """Recordings that come with the project, by name."""
    return tuple(sorted((bundled_folder() / "samples").glob("*.h5")))


def export_page_folder() -> Path:
    """The parts of the one-file page: template, style sheet, scripts."""
    return bundled_folder() / "export_page"


def tokens_file() -> Path:
    """The design system's colours and sizes, which the viewer and the one-file page share."""
    return bundled_folder() / "page" / "tokens.css"
