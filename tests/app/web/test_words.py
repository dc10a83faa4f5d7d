"""Whatever a link, a stored view, the page's channel or a session file says: it is taken, or refused in one line."""

import json
from dataclasses import replace

import pytest

from app.catalogue.recording_id import RecordingId, listed_id
from app.session.channel import parse
from app.state.link import LinkError, from_link, to_link
from app.state.stored import from_text, to_text, to_values
from app.state.view_state import Limits, ViewState
from app.views import VIEWS
from app.views.compare.state import CompareState
from app.views.inspect.state import InspectState
from app.views.view import reduce_views
from etnet.errors import EtnetError
from etnet.events.events import Sensor
from etnet.windows import BetweenFrames, ByCount, Window
from tests.app.web.fuzz_words import channel_words, links, texts

INITIAL = [view.initial for view in VIEWS]
LIMITS = Limits(Sensor(40, 30), [Window(i, i * 10, i * 10 + 10, i * 1000, i * 1000 + 1000) for i in range(30)])
STATE = ViewState(
    recording_id="bundled-prints", model_id="etnet-half", precision="fp32", policy=ByCount(1234), index=7,
    workspace="attention", query=(12, 3), speed=0.5,
).put(InspectState("change"), CompareState())  # fmt: skip


def one_line(ask, kind=EtnetError):
    """What is given back; `None` where it is refused, which takes one line."""
    said = ""
    try:
        return ask()
    except kind as error:
        said = str(error)
    assert "\n" not in said
    assert len(said) < 1000
    return None


def is_usable(state):
    """What was taken can be kept, linked, named and reduced on."""
    to_text(state).encode()
    to_link(state, 5)
    listed_id(state.recording_id)
    one_line(lambda: RecordingId.of(state.recording_id).stated)
    reduce_views(state, parse("key|comma|1", VIEWS), LIMITS, VIEWS)


def read_links(count, seed):
    values = {"v": 2, "t": 5000, **to_values(STATE)}
    for word in links(values, count, seed):
        taken = one_line(lambda word=word: from_link(word, STATE, INITIAL), LinkError)
        if taken is not None:
            assert all(len(name) < 200 for name in taken[1])
            is_usable(taken[0])


def read_stored(count, seed):
    for text in texts(
        {**to_values(STATE), "views": {s.view: {} for s in INITIAL} | to_values(STATE)["views"]}, count, seed
    ):
        is_usable(from_text(text, STATE, INITIAL)[0])


def read_channel(count, seed):
    state = STATE
    for text in channel_words([view.name for view in VIEWS], count, seed):
        intent = parse(text, VIEWS)
        if intent is not None:
            state = replace(reduce_views(state, intent, LIMITS, VIEWS), is_playing=False)
        if seed % 2 and hash(text) % 50 == 0:
            is_usable(state)


def read_sessions(folder, count, seed):
    from etnet.export.session_file import read_session, record_session, write_session
    from tests.export.recordings_made_up import made_up_take

    file = folder / "s.json"
    write_session(record_session(made_up_take(0, 1), BetweenFrames()), file)
    for text in texts(json.loads(file.read_text()), count, seed):
        file.write_bytes(text.encode("utf-8", "surrogatepass"))
        session = one_line(lambda: read_session(file))
        assert session is None or (1 <= session.contract.threads <= 1024 and session.start >= 0)


def test_links():
    read_links(2_000, 1)


def test_stored_views():
    read_stored(2_000, 1)


def test_channel_messages():
    read_channel(4_000, 1)


def test_session_files(tmp_path):
    read_sessions(tmp_path, 1_000, 1)


@pytest.mark.parametrize("threads", [100_000, 0, -1, 1e9, "many"])
def test_a_session_of_impossible_threads_is_refused(tmp_path, threads):
    from etnet.export.session_file import read_session, record_session, write_session
    from tests.export.recordings_made_up import made_up_take

    file = tmp_path / "s.json"
    write_session(record_session(made_up_take(0, 1), BetweenFrames()), file)
    content = json.loads(file.read_text())
    content["contract"]["threads"] = threads
    file.write_text(json.dumps(content))
    with pytest.raises(EtnetError, match="threads"):
        read_session(file)


@pytest.mark.slow
def test_a_hundred_thousand_of_each(tmp_path):
    read_links(100_000, 2)
    read_stored(100_000, 2)
    read_channel(100_000, 2)
    read_sessions(tmp_path, 100_000, 2)
