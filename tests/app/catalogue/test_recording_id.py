import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.catalogue.recording_id import RecordingId, is_of, listed_id, stated_id
from app.catalogue.recordings import Catalogue
from app.catalogue.videos import FilmSetting, film_id
from app.config import ViewerConfig
from app.views.recording.assumptions_panel import sensor_of
from etnet.errors import EtnetError
from etnet.events.assumptions import NOTHING_ASSUMED, Assumptions

SIDES = st.one_of(st.just((None, None)), st.tuples(st.integers(1, 65_536), st.integers(1, 65_536)))
STATEMENTS = st.builds(
    lambda sides, unit, polarity, sort, drop: Assumptions(*sides, unit, polarity, sort, drop),
    SIDES,
    st.sampled_from([None, "s", "ms", "us", "ns"]),
    st.sampled_from(["auto", "inverted", "positive"]),
    st.booleans(),
    st.booleans(),
)


@given(STATEMENTS, STATEMENTS)
def test_an_id_holds_what_is_stated_and_the_file_it_is_stated_of(stated, again):
    named = stated_id("data-0a1b", stated)
    assert RecordingId.of(named).stated == stated
    assert str(RecordingId.of(named)) == named
    assert str(RecordingId.of(f"{named}^4000")) == f"{named}^4000"
    assert listed_id(named) == "data-0a1b"
    assert stated_id(named, again) == stated_id("data-0a1b", again)
    assert RecordingId.of(f"{named}^4000").stated == stated  # a part of it
    assert is_of(named, "data-0a1b")
    assert (named == "data-0a1b") == (stated == NOTHING_ASSUMED)


@given(st.text("!,~^x0123456789smu inverteddrop", max_size=30))
def test_an_id_that_a_page_made_up_is_understood_or_refused(text):
    try:
        stated = RecordingId.of(f"data-0a1b!{text}").stated
    except EtnetError:
        return
    assert stated_id("data-0a1b", stated).startswith("data-0a1b")


def test_a_film_and_another_file_are_not_the_file():
    film = film_id("data-0a1b", FilmSetting(0.3, 1.0))
    assert listed_id(film) == "data-0a1b"
    assert RecordingId.of(film) == RecordingId("data-0a1b", FilmSetting(0.3, 1.0).words)
    assert str(RecordingId.of(film)) == film
    assert not is_of("data-0a1bc", "data-0a1b")
    assert not is_of("data-0a1b", "")


@pytest.mark.parametrize("of", ["data-0a1b^4000", "data-0a1b!us^4000", film_id("data-0a1b", FilmSetting(0.3, 1.0))])
def test_a_part_and_a_film_are_of_their_file_but_the_file_is_not_of_them(of):
    assert is_of(of, "data-0a1b")
    assert not is_of("data-0a1b", of)


@pytest.mark.parametrize("text", ["640×480", "640x480", " 640, 480 ", "640 480"])
def test_a_sensor_may_be_written_as_people_write_it(text):
    assert sensor_of(text) == (640, 480)


def test_an_empty_sensor_is_none_and_nonsense_is_said():
    assert sensor_of("  ") == (None, None)
    with pytest.raises(EtnetError, match="640×480"):
        sensor_of("wide")


@pytest.fixture
def mine(tmp_path):
    """A viewer's configuration with one file whose stamps run back."""
    rows = np.array([[0.2, 3, 4, 1], [0.1, 5, 6, 0], [0.3, 7, 8, 1]])
    np.savetxt(tmp_path / "back.txt", rows, fmt="%.6f %d %d %d")
    return {"file": tmp_path / "back.txt"}


def test_a_file_opens_with_what_is_stated_of_it_beside_the_file_as_it_is(mine):
    catalogue = Catalogue(ViewerConfig(**mine))
    plain = catalogue.entries()[0].id
    with pytest.raises(EtnetError, match="--sort"):
        catalogue.open(plain)
    sorted_id = stated_id(plain, Assumptions(64, 32, sort=True))
    recording = catalogue.open(sorted_id)
    assert recording.read(0, 3).t.tolist() == [100_000, 200_000, 300_000]
    assert recording is catalogue.open(sorted_id)
    other = catalogue.open(stated_id(plain, Assumptions(80, 40, "s", sort=True)))
    assert (recording.sensor.width, other.sensor.width) == (64, 80)
    assert set(catalogue.let_go(plain)) == {recording, other}


def test_where_others_come_in_a_file_is_taken_at_its_word(mine):
    public = Catalogue(ViewerConfig(**mine, public_url="https://somewhere.example"))
    entry = public.entries()[0]
    assert not public.can_be_stated(entry)
    with pytest.raises(EtnetError, match="at its word"):
        public.open(stated_id(entry.id, Assumptions(sort=True)))


def test_of_a_bundled_recording_nothing_can_be_stated():
    catalogue = Catalogue(ViewerConfig())
    entry = catalogue.entries()[0]
    with pytest.raises(EtnetError, match="at its word"):
        catalogue.open(stated_id(entry.id, Assumptions(polarity="inverted")))
