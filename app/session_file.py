"""A session file as the viewer's start: its recording, opened as it was then, and the view that it was taken of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from app.catalogue.models import ModelEntry
from app.config import ViewerConfig
from app.state.view_state import ViewState
from app.views.inspect.state import Change, InspectState
from etnet.errors import EtnetError, WeightsError
from etnet.events.opened_as import OpenedAs
from etnet.events.stated import Stated

if TYPE_CHECKING:
    from etnet.export.session_file import Session

SUFFIX = ".json"


def session_in(config: ViewerConfig) -> Session | None:
    """The session that the command line names; `None` where it names a recording, or nothing."""
    file = config.file
    if file is None or file.suffix.lower() != SUFFIX or not file.is_file():
        return None
    from etnet.export.session_file import read_session  # needs torch, which a recording can wait for

    return read_session(file)


def config_of(session: Session, config: ViewerConfig) -> ViewerConfig:
    """The same with the session's recording as FILE, opened as it was then.

    Raises:
        RecordingError: the recording is not there, or another one.
    """
    from etnet.events.open import open_recording
    from etnet.export.session_file import find_recording, require_recording

    assert config.file is not None
    folders = [config.file.parent, Path(), *([] if config.data is None else [config.data])]
    path = find_recording(session, folders, "put it beside the session file")
    opened = session.opened or OpenedAs(config.stated.assumptions(), config.view(config.downsample or 1))
    with open_recording(path, assume=opened.assumed, view=opened.view) as recording:
        require_recording(session, recording)
    view = opened.view
    return replace(
        config,
        file=path,
        precision=session.contract.runtime.precision,
        roi=None if view.region is None else ",".join(map(str, view.region)),
        downsample=view.downsample,
        flip=view.flip,
        rotate=view.rotate,
        stated=Stated.of(opened.assumed),
    )


def view_of(session: Session, default: ViewState, models: Sequence[ModelEntry]) -> ViewState:
    """`default` at the session's first frame, by its network, with what was changed in it.

    Raises:
        WeightsError: none of the models has the session's weights.
    """
    change = session.change
    model_id = _model_of(session, models).id
    view = replace(default, model_id=model_id, policy=session.policy, index=session.start)
    if change is None:
        return view
    return view.put(InspectState("change", change=Change(change.intervention, since=change.at)))


def _model_of(session: Session, models: Sequence[ModelEntry]) -> ModelEntry:
    """The one of the session's weights; who bears its name is looked at first."""
    for entry in sorted(models, key=lambda entry: Path(entry.source).stem != session.model):
        if _weights_of(entry) == session.weights_sha256:
            return entry
    raise WeightsError(
        f"none of the networks offered here has the session's weights ({session.model}, "
        f"{session.weights_sha256[:12]}…); name their file with --model"
    )


def _weights_of(entry: ModelEntry) -> str:
    from torch import nn

    from app.engine.playbacks import load_network
    from etnet.export.session_file import weights_sha256

    try:
        model = load_network(entry, "fp32", "cpu")
    except EtnetError:
        return ""  # one that does not load is not the session's
    return weights_sha256(model) if isinstance(model, nn.Module) else ""
