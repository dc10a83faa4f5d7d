"""Which networks a visitor can choose, by what their files say of themselves; nothing here needs torch."""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from app.catalogue.folder import lies_in
from app.config import ViewerConfig
from etnet.bundled import models
from etnet.errors import WeightsError
from etnet.files import printable
from etnet.nets.listing import LISTED, where_to_get
from etnet.plain_values import PlainError, bounded_json, fitted

LONGEST_TITLE, LONGEST_WARM_UP = 120, 100_000
LONGEST_CARD = 1 << 20
"""Characters of what a weights file says of itself."""
MAX_MODELS = 50
"""Weights files listed of a --data folder."""
BASELINES = {"leaky-integrator": "leaky integrator"}
"""What `load_model` knows without weights, and how it is called."""
WEIGHTS_FORMAT = "etnet-weights-1"
"""`etnet.nets.weights.FORMAT`, whose module needs torch."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ModelEntry:
    """One model that can be run. `trained_band`: events per pixel and window; `source` is what `load_model` takes."""

    id: str
    title: str
    subtitle: str
    is_linear_light: bool
    trained_band: tuple[float, float] | None
    warm_up: int | None
    source: str | Path = field(repr=False)
    card: Mapping[str, Any] = field(default_factory=dict, repr=False, compare=False)
    """All that the weights file says of itself."""
    architecture: str = ""
    """The class of the network, as the weights file names it; empty for what has no such file."""

    @property
    def is_untrained(self) -> bool:
        """Whether it is a weights file that knows of no training: seeded weights have no card."""
        return bool(self.architecture) and not self.card


def digest(path: Path) -> str:
    """Names a file without saying where it lies."""
    return hashlib.sha256(str(path.resolve()).encode("utf-8", "surrogateescape")).hexdigest()[:12]


def offered_models(config: ViewerConfig) -> Iterator[ModelEntry]:
    """The one asked for first, then the bundled ones, those of the --data folder, the baselines."""
    wanted, bundled = config.model, {path.stem: path for path in models()}
    if wanted not in bundled and wanted not in BASELINES:
        # Read now, so that a wrong name is one line before the page is served and not a notice in it.
        path = Path(wanted)
        if not path.is_file() and wanted in {network.name for network in LISTED}:
            raise WeightsError(f"--model {wanted}: {where_to_get(wanted)}")
        if not path.is_file():
            known = ", ".join([*bundled, *BASELINES])
            raise WeightsError(f"--model {wanted}: no such weights file or bundled model; bundled are {known}")
        yield _own_entry(path) if path.suffix == ".py" else _model_entry(f"file-{digest(path)}", path, path)
    if wanted in BASELINES:
        yield _baseline_entry(wanted)
    for name in sorted(bundled, key=lambda name: name != wanted):
        yield _model_entry(name, bundled[name], name)
    for path in [] if config.data is None else _weights_in(config.data):
        if path.resolve() != Path(wanted).resolve():
            try:
                entry = _model_entry(f"data-{digest(path)}", path, path)
            except WeightsError as error:
                _log.warning("left out of the list of networks: %s", error)
            else:
                yield entry
    yield from (_baseline_entry(name) for name in BASELINES if name != wanted)


def _weights_in(folder: Path) -> list[Path]:
    root = folder.resolve()
    found = (path for path in folder.rglob("*.safetensors") if not path.name.startswith(".") and lies_in(root, path))
    # A regular file: to open a pipe waits for whoever writes into it.
    return sorted(path for path in found if os.path.isfile(path))[:MAX_MODELS]


def _own_entry(path: Path) -> ModelEntry:
    title, name = printable(path.stem), printable(path.name)
    return ModelEntry(f"file-{digest(path)}", title, f"your own, {name}", False, None, None, path)


def _baseline_entry(name: str) -> ModelEntry:
    return ModelEntry(name, BASELINES[name], "a baseline that was never trained", False, None, None, name)


def _model_entry(model_id: str, path: Path, source: str | Path) -> ModelEntry:
    architecture, card = _metadata(path)
    title = card.get("title")
    name = printable(path.name)
    return ModelEntry(
        id=model_id,
        title=printable(title if isinstance(title, str) and 0 < len(title) <= LONGEST_TITLE else path.stem),
        subtitle="bundled" if source == path.stem else name if card else f"{name}, untrained weights",
        is_linear_light=card.get("target_tone", "linear") == "linear",
        trained_band=_band(card.get("events_per_pixel")),
        warm_up=_warm_up(card.get("warm_up")),
        source=source,
        card=card,
        architecture=architecture,
    )


def _band(said: object) -> tuple[float, float] | None:
    """The trained events per pixel; `None` for what is no ascending pair of numbers."""
    try:
        low, high = fitted(tuple[float, float], said)
    except PlainError:
        return None
    return (low, high) if 0 <= low <= high else None


def _warm_up(said: object) -> int | None:
    """Windows until the memory is warm; `None` for what is no sensible number."""
    if isinstance(said, bool) or not isinstance(said, int | float):
        return None
    return int(said) if 0 <= said <= LONGEST_WARM_UP else None


def _metadata(path: Path) -> tuple[str, dict[str, Any]]:
    """A weights file's architecture and card without torch, which takes seconds to import."""
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="np") as file:
            metadata = file.metadata() or {}
        if metadata.get("format") != WEIGHTS_FORMAT:
            raise WeightsError(f"{path.name}: not weights of ours; make them with `etnet convert`")
        card = bounded_json(metadata.get("card", "{}"), LONGEST_CARD)
    except (SafetensorError, OSError, ValueError) as error:
        raise WeightsError(
            f"{path.name}: not a weights file that can be read ({error}); make one with `etnet convert`"
        ) from None
    return str(metadata.get("architecture", "")), card if isinstance(card, dict) else {}
