import numpy as np
import pytest

from etnet.render.colours import (
    GROUND,
    LEVELS,
    OFF,
    ON,
    counting,
    css_gradient,
    diverge,
    diverging,
    hexadecimal,
    oklab,
    sequential,
    srgb,
)


def seen_by_dichromat(colour, weights):
    """Viénot et al. 1999: project a colour as somebody without one of the cone kinds sees it."""
    linear = (np.asarray(colour) / 255) ** 2.2
    return weights @ linear


PROTANOPIA = np.array([[0.11238, 0.88762, 0], [0.11238, 0.88762, 0], [0.00401, -0.00401, 1]])
DEUTERANOPIA = np.array([[0.29275, 0.70725, 0], [0.29275, 0.70725, 0], [-0.02234, 0.02234, 1]])


def test_oklab_turns_back_into_the_same_colour():
    colours = np.random.default_rng(0).integers(0, 256, (200, 3))
    assert np.abs(srgb(oklab([tuple(c) for c in colours])).astype(int) - colours).max() <= 1


@pytest.mark.parametrize("weights", [PROTANOPIA, DEUTERANOPIA])
def test_polarities_stay_apart_for_colour_blind_eyes(weights):
    assert np.linalg.norm(seen_by_dichromat(ON, weights) - seen_by_dichromat(OFF, weights)) > 0.5


def test_zero_is_the_ground_colour_exactly():
    assert tuple(diverge(np.zeros(1), 3.0)[0]) == GROUND


def test_the_diverging_ramp_gets_lighter_away_from_zero_on_both_sides():
    lightness = oklab([tuple(int(v) for v in c) for c in diverging()])[:, 0]
    assert (np.diff(lightness[LEVELS:]) > -0.004).all()
    assert (np.diff(lightness[: LEVELS + 1]) < 0.004).all()


@pytest.mark.parametrize("ramp", [sequential(), counting()])
def test_sequential_ramps_rise_in_lightness(ramp):
    lightness = oklab([tuple(int(v) for v in c) for c in ramp])[:, 0]
    assert (np.diff(lightness) > -0.004).all()
    assert lightness[-1] - lightness[0] > 0.6


def test_values_beyond_the_limit_take_the_ends():
    assert (diverge(np.array([-9.0, 9.0]), 2.0) == diverging()[[0, -1]]).all()


def test_a_gradient_begins_and_ends_as_its_ramp():
    css = css_gradient(diverging())
    assert hexadecimal(tuple(diverging()[0])) in css.split(",")[1]
    assert hexadecimal(tuple(diverging()[-1])) in css.split(",")[-1]
