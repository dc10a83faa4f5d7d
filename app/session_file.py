"""A session file as the viewer's start: its recording, opened as it was then, and the view that it was taken of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from app.catalogue.entries import Entry
from app.catalogue.models import ModelEntry
from app.catalogue.recording_id import opened_id
from app.config import ViewerConfig
from app.state.view_state import ViewState
from app.views.inspect.state import Change, InspectState
from etnet.errors import EtnetError, RecordingError, WeightsError
from etnet.events.cleaning import UNCLEANED
from etnet.events.opened_as import OpenedAs

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
    """The same with the session's recording as FILE.

    Raises:
        RecordingError: the recording is not there, or another one.
    """
    from etnet.export.session_file import find_recording

    assert config.file is not None
    folders = [config.file.parent, Path(), *([] if config.data is None else [config.data])]
    path = find_recording(session, folders, "put it beside the session file")
    _require(session, path, _opened(session, config))
    return replace(config, file=path, precision=session.contract.runtime.precision)


def id_of(session: Session, config: ViewerConfig, entry: Entry) -> tuple[str, OpenedAs]:
    """The id of the session's recording, opened as it was then: its options hold for this recording alone."""
    opened = _opened(session, config)
    return opened_id(entry.id, opened), opened


def view_of(session: Session, default: ViewState, models: Sequence[ModelEntry]) -> ViewState:
    """`default` at the session's first frame, by its network and filter, with what was changed in it.

    Raises:
        WeightsError: none of the models has the session's weights.
    """
    change = session.change
    model_id = _model_of(session, models).id
    cleaning = UNCLEANED if session.opened is None else session.opened.cleaning
    view = replace(default, model_id=model_id, policy=session.policy, index=session.start, cleaning=cleaning)
    if change is None:
        return view
    return view.put(InspectState("change", change=Change(change.intervention, since=change.at)))


def handed_over(
    path: Path, entries: Sequence[Entry], default: ViewState, models: Sequence[ModelEntry], config: ViewerConfig
) -> ViewState:
    """The page that a session file leads to, whose recording is one of those that are listed.

    Raises:
        EtnetError: it is no session file, its recording or its network is not here, or others come in: it says how a
            recording is opened, and would have a stranger's opened in this process.
    """
    from etnet.export.session_file import read_session

    if config.is_open:
        raise RecordingError(
            f"{path.name}: session files are not followed here; `etnet-view SESSION` on your own machine opens it"
        )
    session = read_session(path)
    called = [entry for entry in entries if session.recording in (entry.path.name, entry.title) and entry.path.exists()]
    if not called:
        raise RecordingError(f"{session.recording}: the session's recording is not here; open it first, then this")
    failure: EtnetError | None = None
    for entry in called:
        try:
            _require(session, entry.path, _opened(session, config))
        except EtnetError as error:
            failure = error
        else:
            recording_id, _ = id_of(session, config, entry)
            state = replace(default, recording_id=recording_id, precision=session.contract.runtime.precision)
            return view_of(session, replace(state, slices=()), models)
    assert failure is not None
    raise failure


def _opened(session: Session, config: ViewerConfig) -> OpenedAs:
    return session.opened or OpenedAs(config.stated.assumptions(), config.view(config.downsample or 1))


def _require(session: Session, path: Path, opened: OpenedAs) -> None:
    """Raises RecordingError where the file at `path` does not hold the session's events."""
    from etnet.events.denoise import cleaned
    from etnet.events.open import open_recording
    from etnet.export.session_file import require_recording

    with open_recording(path, assume=opened.assumed, view=opened.view) as recording:
        require_recording(session, cleaned(recording, opened.cleaning))


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
