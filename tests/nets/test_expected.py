"""A step's time before it is run, and columns of a large map on demand."""

import pytest
import torch

from etnet.nets import expected
from etnet.nets.attention import AttentionProbe
from etnet.nets.expected import expected_step_seconds, extrapolated
from etnet.nets.presets import build_model


def test_costs_that_are_lines_and_squares_are_foretold_exactly():
    def cost(tokens: int) -> float:
        return 3e-4 * tokens + 2e-7 * tokens**2

    assert extrapolated(cost(256), cost(1024), 14_400) == pytest.approx(cost(14_400))
    assert extrapolated(1.0, 1.0, 14_400) >= 1.0


def test_a_time_is_foretold_without_running_the_size(monkeypatch):
    monkeypatch.setattr(expected, "_SIDES", (16, 32))
    assert 0 < expected_step_seconds(build_model("tiny"), 720, 1280) < 600


def test_columns_are_those_of_the_rows():
    with torch.inference_mode():
        attention = build_model("tiny")(torch.randn(1, 5, 150, 130), None, AttentionProbe()).attention
    assert attention is not None
    for site in attention.sites:
        num_tokens = attention.queries[site].shape[1]
        whole = attention.rows(site, range(num_tokens))
        for tokens in ([3], [0, num_tokens - 1]):
            torch.testing.assert_close(attention.columns(site, tokens), whole[..., tokens], atol=1e-6, rtol=1e-4)
