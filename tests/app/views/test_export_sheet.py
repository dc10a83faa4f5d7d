"""A sheet of one moment: what the page shows of it, with what is changed in the network."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from app.engine.pace import Pace
from app.engine.playbacks import LoadedPlayback
from app.state.view_state import Limits
from app.views.attention.state import AttentionState
from app.views.export.jobs import ExportJob
from app.views.export.state import ExportState, StartExport
from app.views.inspect.state import Change, InspectState
from etnet.errors import EtnetError
from etnet.events.edit import EventEdit
from etnet.nets.intervention import Intervention
from etnet.nets.runtime import contract_of
from tests.app.reducing import reduce
from tests.app.views.test_export import STATE, made
from tests.export.recordings_made_up import made_up_take


def sheet(name, query=STATE.query, head=None):
    state = replace(STATE, query=query).put(AttentionState(head=head))
    content = made(ExportJob(reduce(state, StartExport("png", sheet=name), Limits()).of(ExportState).order)).content
    return cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)


def test_the_whole_layout_holds_the_bins_and_the_maps_and_each_is_to_be_had_alone():
    heights = {name: sheet(name).shape[0] for name in ("layout", "voxels", "attention")}
    assert heights["layout"] > heights["attention"] > heights["voxels"]
    assert {sheet(name).shape[1] for name in heights} == {1680}
    assert sheet("layout", query=None).shape[0] < heights["layout"]


def test_maps_are_those_of_the_head_on_show():
    assert not np.array_equal(sheet("attention"), sheet("attention", head=0))
    assert np.array_equal(sheet("voxels"), sheet("voxels", head=0))


def test_maps_without_a_pixel_are_refused_with_what_to_do():
    with pytest.raises(EtnetError, match="choose a pixel"):
        sheet("attention", query=None)


def sheet_of(recording_id, change=None, **wanted):
    """A sheet of a recording whose pictures nobody else shares, made by a playback of its own."""
    playback = made_up_take().playback
    state = replace(STATE, recording_id=recording_id).put(InspectState(change=change or Change()))
    wanted = StartExport("png", **{"sheet": "layout", **wanted})
    order = reduce(state, wanted, Limits()).of(ExportState).order
    return made(ExportJob(order), LoadedPlayback(playback, contract_of(playback.model), 4, Pace(), 1.0)).content


CHANGES = [
    Change(Intervention(removed_scales=frozenset({1}))),
    Change(Intervention(zeroed_levels=frozenset({2})), since=1),
    Change(edit=EventEdit(drop=0.5), since=2),
]


@pytest.mark.parametrize("change", CHANGES)
def test_a_sheet_shows_the_change_and_the_original_stays_the_original_whichever_is_drawn_first(change):
    name = f"{change}"
    original, changed = sheet_of(f"{name} 1"), sheet_of(f"{name} 1", change)
    assert changed != original
    assert sheet_of(f"{name} 2", change) == changed
    assert sheet_of(f"{name} 2") == original


def test_maps_are_of_the_place_where_a_followed_patch_lies():
    followed, chosen = sheet_of("followed", sheet="attention", pixel=(30, 20)), sheet_of("followed", sheet="attention")
    assert followed != chosen
    assert sheet_of("followed", sheet="attention", pixel=STATE.query) == chosen
    assert sheet_of("followed", sheet="voxels", pixel=(30, 20)) == sheet_of("followed", sheet="voxels")
