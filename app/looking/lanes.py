"""Which scores the lanes of a view want, and which lane an answer belongs to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from app.looking.scores import MOST_WINDOWS, MomentScore, ProtocolRun, Strip
from app.present.lane import LaneShown
from app.studies import Finding, Study
from app.view_state import ViewState
from app.wishes import Wish


def lane_questions(state: ViewState, lanes: Sequence[LaneShown], num_seen: Callable[[Wish], int]) -> dict[str, Study]:
    """The studies of all lanes, by slot. `num_seen`: how many frames of a wish's playback exist."""
    compare = state.compare
    asked = [(lane, lane.wish) for lane in lanes if lane.wish is not None]
    match compare.inspector, compare.replays:
        case "lanes", _:
            return {
                slot_of("moment", lane): MomentScore(wish, compare.rule, lane.truth.index if lane.truth else None)
                for lane, wish in asked
            }
        case "scores", False:
            return {
                slot_of("strip", lane): Strip(
                    replace(wish.plain, index=0),
                    compare.rule,
                    compare.offset,
                    num_seen(wish) if lane.num_windows > MOST_WINDOWS else -1,
                )
                for lane, wish in asked
            }
        case "scores", True:
            return {
                slot_of("protocol", lane): ProtocolRun(
                    replace(wish.plain, index=0, cold_at=0, precision="fp32"), compare.rule
                )
                for lane, wish in asked
            }
    return {}


def slot_of(subject: str, lane: LaneShown) -> str:
    """Where a lane's study stands."""
    return f"compare/{subject}/{lane.number}"


def scored(lane: LaneShown, finding: Finding | None) -> LaneShown:
    """The lane with its values, if they are those of the frame that is wanted now."""
    study = None if finding is None else finding.study
    if finding is None or not isinstance(study, MomentScore) or study.wish != lane.wish or not finding.is_whole:
        return lane
    return lane.with_values(finding.value)
