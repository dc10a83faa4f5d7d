import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etnet.events.events import Events, Sensor
from etnet.render.colours import GROUND, OFF, ON
from etnet.render.events import BUSY, EVENT_STYLES, event_image, polarity_colours

SENSOR = Sensor(7, 5)


def events_of(rows):
    columns = np.array(rows, np.int64).reshape(-1, 4)
    columns = columns[np.argsort(columns[:, 2], kind="stable")]
    x, y, t, p = columns.T
    return Events(x.astype(np.uint16), y.astype(np.uint16), t, p.astype(np.int8), SENSOR)


def drawn(events, style, t_start, t_stop):
    image, limit = event_image(events, style, t_start, t_stop)
    return image.colours, limit


event_lists = st.lists(
    st.tuples(st.integers(0, 6), st.integers(0, 4), st.integers(0, 999), st.sampled_from([-1, 1])), max_size=60
).map(events_of)


@given(event_lists, st.sampled_from(EVENT_STYLES))
def test_a_pixel_without_events_is_the_ground_colour_in_every_style(events, style):
    image, limit = drawn(events, style, 0, 1000)
    silent = np.ones((5, 7), bool)
    silent[events.y, events.x] = False
    assert image.shape == (5, 7, 3)
    assert limit > 0
    assert (image[silent] == GROUND).all()


@given(event_lists)
def test_the_newest_event_decides_the_hue(events):
    image, _ = drawn(events, "polarity", 0, 1000)
    newest = {}
    for x, y, p in zip(events.x, events.y, events.p, strict=True):
        newest[int(y), int(x)] = p
    for place, p in newest.items():
        red, _, blue = image[place].astype(int)
        assert (red > blue) == (p > 0)


def test_many_events_show_the_full_hue_and_one_shows_half():
    image, _ = drawn(events_of([(0, 0, i, 1) for i in range(BUSY)] + [(1, 0, 5, -1)]), "polarity", 0, 10)
    assert tuple(image[0, 0]) == ON
    assert np.allclose(image[0, 1], (np.array(OFF) + GROUND) / 2, atol=1)


def test_the_time_surface_fades_with_age():
    image, limit = drawn(events_of([(0, 0, 0, 1), (1, 0, 500, 1), (2, 0, 1000, 1)]), "time surface", 0, 1000)
    assert limit == 1.0
    assert image[0, 0].sum() < image[0, 1].sum() < image[0, 2].sum()
    assert tuple(image[0, 2]) == ON


def test_opposite_events_at_one_moment_cancel_in_the_decay():
    image, _ = drawn(events_of([(3, 3, 900, 1), (3, 3, 900, -1), (0, 0, 900, 1)]), "decay", 0, 1000)
    assert tuple(image[3, 3]) == GROUND


def test_counting_ignores_polarity():
    image, limit = drawn(events_of([(0, 0, 1, 1), (0, 0, 2, -1)]), "count", 0, 10)
    assert limit == 2
    assert tuple(image[0, 0]) == (255, 255, 255)


def test_each_event_has_the_hue_of_its_polarity():
    colours = polarity_colours(events_of([(0, 0, 1, 1), (0, 0, 2, -1)]))
    assert [tuple(c) for c in colours] == [ON, OFF]
    many = events_of([(0, 0, 1, 1), (0, 0, 2, -1), (0, 0, 3, -1), (0, 0, 4, 1)])
    assert [tuple(c) for c in polarity_colours(many, np.array([3, 1]))] == [ON, OFF]


@pytest.mark.parametrize("style", EVENT_STYLES)
def test_no_events_give_an_empty_picture(style):
    image, _ = drawn(Events.empty(SENSOR), style, 5, 5)
    assert (image == GROUND).all()
