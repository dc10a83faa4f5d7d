"""Codings of polarity whose meaning is certain are read, others are refused, and no remedy makes all events ON."""

from __future__ import annotations

import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.open import Assumptions, open_recording
from tests.events.containers import all_events
from tests.strategies import make_events

EVENTS = make_events(500)
ON = EVENTS.p > 0


def save(path, p):
    if path.suffix == ".npz":
        np.savez(path, x=EVENTS.x, y=EVENTS.y, t=EVENTS.t, p=p, width=20, height=12)
    else:
        rows = zip(EVENTS.t.tolist(), EVENTS.x, EVENTS.y, p.tolist(), strict=True)
        path.write_text("t_us,x,y,p\n" + "".join(f"{a},{b},{c},{d}\n" for a, b, c, d in rows))
    return path


CODINGS = {
    "0/1": (np.where(ON, 1, 0).astype("u1"), "0/1"),
    "−1/+1": (np.where(ON, 1, -1).astype("i1"), "−1/+1"),
    "1/2": (np.where(ON, 2, 1), "1/2"),
    "byte": (np.where(ON, 1, 255).astype("u1"), "255"),
    "word": (np.where(ON, 1, 65_535).astype("u2"), "65535"),
    "v2e": (np.where(ON, 1, 2**32 - 1).astype("u4"), "4294967295"),
    "cast to more bits": (np.where(ON, 1, 2**32 - 1).astype("i8"), "4294967295"),
}


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
@pytest.mark.parametrize("coding", CODINGS)
def test_codings_with_a_certain_meaning_are_read_and_said(coding, suffix, tmp_path):
    stored, name = CODINGS[coding]
    with open_recording(save(tmp_path / f"a{suffix}", stored)) as recording:
        np.testing.assert_array_equal(all_events(recording).p, EVENTS.p)
        off = int(np.flatnonzero(~ON)[0])
        assert recording.read(off, off + 1).p.tolist() == [-1]  # a part that holds one value alone
        assert any(name in remark.text for remark in recording.remarks if "polarity" in remark.text)
    with open_recording(tmp_path / f"a{suffix}", assume=Assumptions(polarity="inverted")) as recording:
        np.testing.assert_array_equal(all_events(recording).p, -EVENTS.p)


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
@pytest.mark.parametrize(("low", "high"), [(1, 3), (2, 3), (1, 254), (5, 5)])
def test_positive_is_never_advised_where_nothing_is_0_or_less(low, high, suffix, tmp_path):
    stored = np.where(ON, high, low)
    with pytest.raises(RecordingError, match="is it the right column") as refusal:
        open_recording(save(tmp_path / f"a{suffix}", stored))
    assert "positive" not in str(refusal.value)


def test_a_coding_of_four_values_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="no coding that is known"):
        open_recording(save(tmp_path / "a.npz", np.arange(500) % 4))


@pytest.mark.parametrize("value", [0, 1])
def test_events_of_one_polarity_alone_are_fine(value, tmp_path):
    with open_recording(save(tmp_path / "a.npz", np.full(500, value, "u1"))) as recording:
        assert set(all_events(recording).p.tolist()) == {2 * value - 1}
