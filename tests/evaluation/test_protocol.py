"""Protocols feed and score exactly what the field's scripts do."""

from dataclasses import replace

import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.evaluation.datasets import DATASETS, Cut, sequence_called
from etnet.evaluation.metrics import SSIM_EVREAL, SSIM_PAPER
from etnet.evaluation.protocol import EVREAL, PAPER, Part, plan_protocol
from etnet.events.recording import recording_of_events
from tests.evaluation.recordings import made_up, slider_depth


def test_the_tables_know_their_sequences() -> None:
    assert {name: len(sequences) for name, sequences in DATASETS.items()} == {"IJRR": 7, "MVSEC": 6, "HQF": 14}
    assert sequence_called("slider_depth.zip") == ("IJRR", "slider_depth", Cut(1, 2.5))
    assert sequence_called("indoor_flying4_data.hdf5") == ("MVSEC", "indoor_flying4", Cut(10, 19.8))
    assert sequence_called("still_life") == ("HQF", "still_life", None)
    assert sequence_called("slider_depth_1.0s_event_utils.h5") is None


def test_the_papers_protocol_starts_cold_with_the_events_before_the_first_frame_and_leaves_the_last_out() -> None:
    recording = made_up(num_frames=6)
    truth = recording.ground_truth
    assert truth is not None
    plan = plan_protocol(recording, PAPER)
    assert plan.frames == (0, 1, 2, 3, 4)
    assert (plan.items[0].window.start, plan.items[0].window.stop) == (0, recording.index_at(int(truth.stamps[0])))
    for before, item in zip(plan.items[:-1], plan.items[1:], strict=True):
        assert item.window.start == before.window.stop
        assert item.frame is not None
        assert item.window.t_stop == truth.stamps[item.frame]


def test_evreals_protocol_starts_with_an_empty_window_and_leaves_the_files_last_frame_out() -> None:
    plan = plan_protocol(made_up(num_frames=6), EVREAL)
    assert plan.frames == (0, 1, 2, 3, 4)
    assert plan.items[0].window.num_events == 0
    assert plan.items[1].window.start == plan.items[0].window.stop


def test_a_known_sequence_is_cut_and_warmed_up_as_the_protocol_says() -> None:
    # Frames every 40 ms from 1 s on the file's clock; office_zigzag is scored from 5 s to 12 s after the first.
    recording = made_up("office_zigzag", num_frames=400)
    paper, evreal = plan_protocol(recording, PAPER), plan_protocol(recording, EVREAL)
    assert (paper.frames[0], paper.frames[-1]) == (125, 299)
    assert paper.items[0].frame == 125
    assert (evreal.frames[0], evreal.frames[-1]) == (125, 300)
    assert evreal.items[0].window.t_stop == 1_000_000
    assert [item.frame for item in evreal.items[:125]] == [None] * 125
    assert plan_protocol(recording, PAPER, whole=True).frames == tuple(range(399))


def test_the_warm_up_is_ten_seconds_where_the_recording_has_them() -> None:
    recording = made_up("indoor_flying4", num_frames=600)  # scored from 10.0 s to 19.8 s
    plan = plan_protocol(recording, EVREAL)
    assert plan.items[0].window.t_stop == 1_000_000
    assert plan.frames[0] == 250
    recording = made_up("outdoor_day2", num_frames=3000)  # from 100 s to 160 s; the file ends at 121 s
    plan = plan_protocol(recording, EVREAL)
    assert plan.items[0].window.t_stop == 91_000_000
    assert any("ends 40" in remark for remark in plan.remarks)


def test_a_recording_without_frames_or_without_its_cut_is_refused() -> None:
    recording = made_up()
    with pytest.raises(RecordingError, match="0 ground-truth frames"):
        plan_protocol(recording_of_events(recording.read(0, 10)), PAPER)
    with pytest.raises(RecordingError, match="whole"):
        plan_protocol(made_up("boxes_6dof", num_frames=20), PAPER)


def test_their_fixed_choices() -> None:
    assert (PAPER.ssim, PAPER.averaging, PAPER.warm_up, PAPER.clips, PAPER.post_processes) == (
        SSIM_PAPER, "sequences", 0, False, False,
    )  # fmt: skip
    assert (EVREAL.ssim, EVREAL.averaging, EVREAL.warm_up, EVREAL.clips, EVREAL.post_processes) == (
        SSIM_EVREAL, "frames", 10_000_000, True, True,
    )  # fmt: skip


@pytest.mark.real
def test_slider_depth_has_38_frames_in_the_paper_and_39_in_evreal() -> None:
    recording = slider_depth()
    paper, evreal = plan_protocol(recording, PAPER), plan_protocol(recording, EVREAL)
    assert (len(paper.frames), len(evreal.frames)) == (38, 39)
    assert np.array_equal(paper.frames, evreal.frames[:-1])
    assert recording.ground_truth is not None
    first = int(recording.ground_truth.stamps[paper.frames[0]])
    assert first == 1_007_900
    assert paper.items[0].window.t_start == 1_000_000
    assert len(evreal.items) == 39 + paper.frames[0]


def test_frames_that_cannot_be_compared_are_one_clear_error() -> None:
    recording = made_up(num_frames=6)
    truth = recording.ground_truth
    assert truth is not None
    elsewhere = replace(truth, stamps=truth.stamps + 10**15)
    larger = replace(truth, read_frame=lambda i: np.zeros((99, 99), np.float32))
    for frames, match in ((elsewhere, "none of the 5 frames to score lies among the events"), (larger, "99×99 pixels")):
        with pytest.raises(RecordingError, match=match) as refusal:
            plan_protocol(replace(recording, ground_truth=frames), PAPER)
        assert "\n" not in str(refusal.value)
    late = replace(truth, stamps=truth.stamps + np.array([0, 0, 0, 10**9, 10**9, 10**9]))
    remarks = plan_protocol(replace(recording, ground_truth=late), PAPER).remarks
    assert any("scored windows hold no event" in remark for remark in remarks)


@pytest.mark.parametrize(("protocol", "fed"), [(PAPER, 0.055), (EVREAL, -0.005)])
def test_a_named_part_takes_the_cut_s_place_and_the_plan_says_so(protocol, fed):
    recording = made_up("boxes_6dof", num_frames=10)
    plan = plan_protocol(recording, protocol, part=Part(0.055, 0.2))
    assert plan.sequence is None
    start, stamps = recording.span.start, recording.ground_truth.stamps
    scored = [i for i, stamp in enumerate(stamps) if 0.055e6 <= stamp - start <= 0.2e6]
    assert list(plan.frames) == (scored[:-1] if protocol is PAPER else scored)
    assert "only its frames from 0.055 s to 0.2 s are scored" in plan.remarks[0]
    fed_from = plan.items[0].window.t_start
    assert (fed_from - start) / 1e6 == pytest.approx(fed, abs=2e-3)
    with pytest.raises(RecordingError, match="widen --from and --to"):
        plan_protocol(recording, protocol, part=Part(5.0, 6.0))
