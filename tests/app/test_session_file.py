"""A session file opens in the viewer: its recording as it was opened then, and the view that it was taken of."""

from dataclasses import replace

import numpy as np
import pytest

from app.catalogue.entries import Entry
from app.catalogue.recordings import Catalogue
from app.catalogue.visitor import VisitorCatalogue
from app.config import ViewerConfig
from app.main import Viewer, main
from app.session_file import config_of, handed_over, id_of, session_in, view_of
from app.state.view_state import ViewState
from app.views.inspect.state import Change, InspectState
from etnet.errors import EtnetError, RecordingError
from etnet.events.assumptions import Assumptions
from etnet.events.open import open_recording
from etnet.events.opened_as import View
from etnet.events.stated import Stated
from etnet.export import session_file
from etnet.export.session_file import read_session, record_session, write_session
from etnet.export.take import Take
from etnet.nets.intervention import Intervention
from etnet.nets.weights import save_weights
from etnet.playback.playback import Playback
from etnet.windows import ByCount, plan_windows
from tests.export.recordings_made_up import made_up_model

POLICY = ByCount(100)
ASSUMED, VIEW = Assumptions(48, 36, "s", "inverted", sort=True), View((2, 2, 40, 30), 2, "horizontal", 90)
CHANGE = session_file.Change(1, Intervention(removed_scales=frozenset({1})))


@pytest.fixture
def taken(tmp_path):
    """A session of windows 2 and 3 beside its recording, and the weights."""
    rng = np.random.default_rng(0)
    rows = np.column_stack([np.sort(rng.random(900)), rng.integers(0, 34, (900, 2)), rng.integers(0, 2, 900)])
    np.savetxt(tmp_path / "walk.txt", rows, fmt="%.6f %d %d %d")
    model = made_up_model()
    model.name = "mine"
    with open_recording(tmp_path / "walk.txt", assume=ASSUMED, view=VIEW) as recording:
        take = Take.of(Playback(model, recording, plan_windows(recording, POLICY)), 2, 4)
        write_session(record_session(take, POLICY, CHANGE), tmp_path / "s.json")
    save_weights(model, tmp_path / "mine.safetensors", {}, None)
    return tmp_path


def test_a_session_opens_as_it_was_taken(taken):
    config = ViewerConfig(file=taken / "s.json", data=taken, downsample=4)
    session = session_in(config)
    config = config_of(session, config)
    assert (config.file, config.precision) == (taken / "walk.txt", "fp32")
    catalogue = Catalogue(config)
    recording_id, opened = id_of(session, config, catalogue.entries()[0])
    catalogue.grant(recording_id, opened)
    recording = catalogue.open(recording_id)
    assert recording.opened_as == session.opened
    assert session_file.events_sha256(recording) == session.events_sha256
    state = view_of(session, ViewState(recording_id=catalogue.entries()[0].id), catalogue.models())
    assert catalogue.model(state.model_id).source == taken / "mine.safetensors"
    assert (state.policy, state.index) == (POLICY, 2)
    assert state.of(InspectState).change == Change(CHANGE.intervention, since=1)


def test_the_viewer_starts_with_it(taken):
    viewer = Viewer(ViewerConfig(file=taken / "s.json", model=str(taken / "mine.safetensors"), port=0, threads=1))
    try:
        assert viewer.catalogue.entries()[0].path == taken / "walk.txt"
    finally:
        viewer.stop()


def _said(capsys, *arguments):
    assert main([*map(str, arguments), "--port", "0"]) == 1
    said = capsys.readouterr().err.strip()
    assert "\n" not in said
    return said


def test_a_session_that_cannot_be_shown_is_one_line(taken, capsys):
    file = taken / "s.json"
    assert "none of the networks offered here has the session's weights (mine" in _said(capsys, file)
    text = (taken / "walk.txt").read_text()
    (taken / "walk.txt").write_text(text[: text.rindex("\n", 0, -1) + 1])
    assert "it is another recording" in _said(capsys, file)
    (taken / "walk.txt").unlink()
    assert "walk.txt: the session's recording is not beside it" in _said(capsys, file)
    file.write_text("{}")
    assert "s.json: is not a session file" in _said(capsys, file)


def test_a_session_of_the_first_format_is_opened_as_the_command_line_says(taken):
    session = replace(read_session(taken / "s.json"), opened=None)
    said = {"roi": "2,2,40,30", "downsample": 2, "flip": "horizontal", "rotate": 90, "stated": Stated.of(ASSUMED)}
    config = ViewerConfig(file=taken / "s.json", **said)
    assert config_of(session, config) == replace(config, file=taken / "walk.txt", precision="fp32")


def test_a_session_that_is_handed_over_opens_its_recording_and_its_options_hold_for_that_alone(taken):
    (taken / "second").mkdir()
    rows = np.array([[0.0, 1, 1, 1], [0.5, 2, 2, 0], [0.9, 3, 3, 1]])
    np.savetxt(taken / "second" / "other.txt", rows, fmt="%.6f %d %d %d")
    config = ViewerConfig(data=taken, model=str(taken / "mine.safetensors"))
    catalogue = Catalogue(config)
    state = handed_over(taken / "s.json", catalogue.entries(), ViewState(), catalogue.models(), config)
    assert (state.policy, state.index) == (POLICY, 2)
    assert catalogue.open(state.recording_id).opened_as == read_session(taken / "s.json").opened
    other = next(entry for entry in catalogue.entries() if entry.title == "other.txt")
    assert catalogue.open(other.id).opened_as.view == View()
    with pytest.raises(EtnetError, match="open it first"):
        handed_over(taken / "s.json", [other], ViewState(), catalogue.models(), config)


def test_a_session_of_a_recording_that_is_offered_and_not_here_says_what_to_do(taken):
    config = ViewerConfig(model=str(taken / "mine.safetensors"))
    absent = Entry("sample-walk", "walk.txt", "on demand", "", taken / "nowhere" / "walk.txt")
    with pytest.raises(RecordingError, match=r"^walk\.txt: .*open it first"):
        handed_over(taken / "s.json", [absent], ViewState(), Catalogue(config).models(), config)


def _handed_over(desk, path):
    content = path.read_bytes()
    transfer = desk.begin(path.name, len(content))
    transfer.take(content)
    return transfer.finish()


@pytest.mark.parametrize("others", [{"public_url": "http://show.example"}, {"demo": True}])
def test_where_others_come_in_no_session_is_followed_and_nothing_of_it_is_opened(taken, monkeypatch, others):
    opened = []

    def open_here(path, **how):
        opened.append(path)
        raise RecordingError("opened in this process")

    monkeypatch.setattr("etnet.events.open.open_recording", open_here)
    weights = str(taken / "mine.safetensors")
    config = ViewerConfig(model=weights, uploads=16, port=0, threads=1, cache="off", **others)
    viewer = Viewer(config)
    try:
        desk = viewer.uploads.desk()
        seen = VisitorCatalogue(viewer.catalogue, desk)
        walk, session = (_handed_over(desk, taken / name) for name in ("walk.txt", "s.json"))
        assert viewer._follow_session(config, seen, viewer.default, walk) is None
        with pytest.raises(RecordingError, match="session files") as told:
            viewer._follow_session(config, seen, viewer.default, session)
        assert "etnet-view" in str(told.value)
        assert desk.entries[1].path not in opened
    finally:
        viewer.stop()


def test_a_path_that_cannot_be_opened_ends_the_viewer_before_it_serves(tmp_path, capsys):
    assert "there is no such file" in _said(capsys, tmp_path / "absent.json")
    (tmp_path / "noise.raw").write_bytes(bytes(range(256)) * 8)
    assert "noise.raw" in _said(capsys, tmp_path / "noise.raw")
    assert "absent.h5" in _said(capsys, tmp_path / "absent.h5")
