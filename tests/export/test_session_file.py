import dataclasses
import json

import numpy as np
import pytest
import torch

from etnet.errors import EtnetError, RecordingError, WeightsError
from etnet.events.assumptions import Assumptions
from etnet.events.events import Events
from etnet.events.opened_as import OpenedAs, View
from etnet.events.recording import recording_of_events
from etnet.export import session_file
from etnet.export.session_file import (
    Change,
    check_session,
    contract_differences,
    events_sha256,
    find_recording,
    parse_intervention,
    read_session,
    record_session,
    write_session,
)
from etnet.nets.intervention import Intervention
from etnet.nets.runtime import Runtime, apply_runtime
from etnet.windows import BetweenFrames, ByCount, ByDensity, ByDuration
from tests.export.recordings_made_up import made_up_model, made_up_recording, made_up_take

CHANGE = Change(2, Intervention(removed_scales=frozenset({1}), masked_heads=frozenset({("scale3.encoder.0.self", 1)})))


@pytest.mark.parametrize("change", [None, CHANGE])
def test_a_session_written_read_and_replayed_gives_every_frame_again(tmp_path, change):
    session = record_session(made_up_take(1, 4), BetweenFrames(), change, {"simulator": 7})
    write_session(session, tmp_path / "s.json")
    again = read_session(tmp_path / "s.json")
    assert again == session
    verdict = check_session(again, made_up_recording("the same events"), made_up_model())
    assert verdict.holds
    assert verdict.contract_differences == ()


@pytest.mark.parametrize("policy", [BetweenFrames(), ByCount(100), ByDensity(0.35), ByDuration(20_000, 5_000)])
def test_every_policy_survives_the_file(tmp_path, policy):
    session = dataclasses.replace(record_session(made_up_take(0, 1), BetweenFrames()), policy=policy)
    write_session(session, tmp_path / "s.json")
    assert read_session(tmp_path / "s.json") == session


def test_no_session_is_made_that_could_not_be_read_again(tmp_path, monkeypatch):
    session = record_session(made_up_take(), BetweenFrames())
    write_session(session, tmp_path / "s.json")
    size = (tmp_path / "s.json").stat().st_size
    more = dataclasses.replace(session, frames=(*session.frames, session.frames[0]))
    write_session(more, tmp_path / "more.json")
    assert (tmp_path / "more.json").stat().st_size - size == session_file.HASH_BYTES
    monkeypatch.setattr(session_file, "LARGEST_FILE", size)
    write_session(session, tmp_path / "s.json")
    assert read_session(tmp_path / "s.json") == session
    with pytest.raises(EtnetError, match="shorter range"):
        write_session(more, tmp_path / "refused.json")
    assert not (tmp_path / "refused.json").exists()
    monkeypatch.setattr(session_file, "LARGEST_FILE", 4 * session_file.HASH_BYTES)
    told = []
    with pytest.raises(EtnetError, match="holds 4 windows at most, got 5"):
        record_session(made_up_take(), BetweenFrames(), progress=lambda *done: told.append(done))
    assert told == []


def test_an_intervention_changes_the_frames_from_its_window_on():
    plain, changed = (record_session(made_up_take(), BetweenFrames(), change).frames for change in (None, CHANGE))
    assert [a == b for a, b in zip(plain, changed, strict=True)] == [True, True, False, False, False]


def test_a_frame_that_differs_is_named_by_its_window():
    session = record_session(made_up_take(1, 4), BetweenFrames())
    forged = dataclasses.replace(session, frames=(session.frames[0], "0" * 64, session.frames[2]))
    verdict = check_session(forged, made_up_recording(), made_up_model())
    assert verdict.differing == (2,)
    assert not verdict.holds


def test_the_session_s_contract_is_taken_on_and_given_back():
    model = made_up_model()
    apply_runtime(model, Runtime(attention="plain"))
    session = record_session(made_up_take(0, 2), BetweenFrames())
    threads = torch.get_num_threads()
    contract = dataclasses.replace(session.contract, threads=threads + 1)
    verdict = check_session(dataclasses.replace(session, contract=contract), made_up_recording(), model)
    assert verdict.contract_differences == ()
    assert model.runtime == Runtime(attention="plain")
    assert torch.get_num_threads() == threads


def test_what_a_machine_cannot_take_on_is_said_point_by_point():
    session = record_session(made_up_take(0, 1), BetweenFrames())
    there = dataclasses.replace(
        session.contract, torch_version="1.0", runtime=dataclasses.replace(session.contract.runtime, precision="bf16")
    )
    assert contract_differences(there, session.contract) == (
        "precision: bf16 there, fp32 here",
        f"torch_version: 1.0 there, {torch.__version__} here",
    )


def test_another_recording_or_other_weights_are_refused():
    session = record_session(made_up_take(0, 1), BetweenFrames())
    events = made_up_recording().read(0, 1500)
    turned = Events(events.x, events.y, events.t, (-events.p).astype(np.int8), events.sensor)
    with pytest.raises(RecordingError, match="another recording"):
        check_session(session, recording_of_events(turned), made_up_model())
    model = made_up_model()
    next(model.parameters()).add_(1e-3)
    with pytest.raises(WeightsError, match="weights"):
        check_session(session, made_up_recording(), model)


def test_the_events_hash_knows_neither_container_nor_clock():
    events = made_up_recording().read(0, 1500)
    later = Events(events.x, events.y, events.t + 10**12, events.p, events.sensor)
    assert events_sha256(recording_of_events(later)) == events_sha256(made_up_recording())


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"format": "other"}', '{"format": "etnet-session-1"}', "\0"])
def test_a_file_that_is_no_session_is_refused_in_one_line(tmp_path, content):
    (tmp_path / "s.json").write_text(content)
    with pytest.raises(EtnetError, match=r"s\.json: is not a session file") as caught:
        read_session(tmp_path / "s.json")
    assert "\n" not in str(caught.value)


def test_a_session_holds_no_path(tmp_path):
    recording = dataclasses.replace(made_up_recording(), path=tmp_path / "folder" / "events.h5")
    write_session(record_session(made_up_take(0, 1, recording), BetweenFrames()), tmp_path / "s.json")
    content = json.loads((tmp_path / "s.json").read_text())
    assert content["recording"] == "events.h5"
    assert str(tmp_path) not in (tmp_path / "s.json").read_text()


OPENED = OpenedAs(
    Assumptions(46, 34, "us", "inverted", sort=True, drop_outside=True), View((2, 2, 40, 30), 2, "both", 90)
)


@pytest.mark.parametrize("opened", [None, OpenedAs(), OPENED])
def test_a_session_says_how_its_recording_was_opened(tmp_path, opened):
    recording = dataclasses.replace(made_up_recording(), opened_as=opened)
    write_session(record_session(made_up_take(0, 1, recording), BetweenFrames()), tmp_path / "s.json")
    assert read_session(tmp_path / "s.json").opened == opened


def test_a_session_of_the_first_format_is_read_and_says_nothing_of_it(tmp_path):
    session = record_session(made_up_take(0, 1), BetweenFrames(), CHANGE)
    write_session(session, tmp_path / "s.json")
    content = json.loads((tmp_path / "s.json").read_text())
    del content["opened"]
    (tmp_path / "s.json").write_text(json.dumps({**content, "format": "etnet-session-1"}))
    assert read_session(tmp_path / "s.json") == session


@pytest.mark.parametrize("opened", [{}, [], {"assumed": {}, "view": {}}, {"assumed": {}, "view": {"region": [1, 2]}}])
def test_an_opening_that_is_none_is_refused_in_one_line(tmp_path, opened):
    write_session(record_session(made_up_take(0, 1), BetweenFrames()), tmp_path / "s.json")
    content = json.loads((tmp_path / "s.json").read_text())
    (tmp_path / "s.json").write_text(json.dumps({**content, "opened": opened}))
    with pytest.raises(EtnetError, match=r"s\.json: is not a session file"):
        read_session(tmp_path / "s.json")


def test_a_start_that_is_no_number_is_refused_in_one_line(tmp_path):
    write_session(record_session(made_up_take(0, 1), BetweenFrames()), tmp_path / "s.json")
    content = json.loads((tmp_path / "s.json").read_text())
    (tmp_path / "s.json").write_text(json.dumps({**content, "start": "first"}))
    with pytest.raises(EtnetError, match=r"s\.json: is not a session file"):
        read_session(tmp_path / "s.json")


def test_a_session_s_recording_is_found_by_the_last_part_of_its_name_alone(tmp_path):
    (tmp_path / "events.h5").touch()
    session = dataclasses.replace(record_session(made_up_take(0, 1), BetweenFrames()), recording="../../events.h5")
    assert find_recording(session, (tmp_path / "elsewhere", tmp_path), "name it") == tmp_path / "events.h5"
    with pytest.raises(RecordingError, match=r"events\.h5: .* not beside it.*; name it"):
        find_recording(session, (), "name it")


def test_an_unknown_intervention_names_the_known_ones():
    with pytest.raises(EtnetError, match="removed_scales"):
        parse_intervention({"nonsense": True})
