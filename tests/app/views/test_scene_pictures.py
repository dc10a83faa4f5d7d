"""What stands in the scene: on the plane, and behind it."""

from dataclasses import replace

import numpy as np

from app.html.attention.maps import attention_image
from app.html.pictures import (
    event_picture,
    reconstruction_image,
)
from app.state.view_state import ViewState
from app.views.attention.state import AttentionState, look_of
from app.views.demo.state import DemoState
from app.views.events.state import EventsState
from app.views.page import Page
from app.views.scene.scene import picture_of, sites_behind
from app.views.scene.state import SceneState
from tests.app.shown_moment import LOOK, TONES


def test_the_scenes_plane_carries_what_the_page_is_about(moment, ready):
    grey = np.repeat(reconstruction_image(ready, TONES)[..., None], 3, axis=2)
    asked = ViewState(index=4, query=LOOK.query)
    for workspace in ("inspect", "recording"):
        page = Page(replace(asked, workspace=workspace), moment, ready)
        assert np.array_equal(picture_of(page, False)[1], grey)
    about = Page(replace(asked, workspace="attention"), moment, ready)
    assert np.array_equal(picture_of(about, False)[1], attention_image(ready, look_of(about), AttentionState().site))
    assert picture_of(Page(asked, moment), False) == (None, None)


def test_on_a_phone_the_demos_scene_shows_what_is_spoken_of(moment, ready):
    pages = {
        act: Page(ViewState(workspace="demo", index=4, query=query).put(DemoState(act)), moment, ready)
        for act, query in (("events", None), ("image", None), ("places", LOOK.query))
    }
    events, _ = event_picture(moment, EventsState().event_image)
    grey = np.repeat(reconstruction_image(ready, TONES)[..., None], 3, axis=2)
    assert np.array_equal(picture_of(pages["events"], True)[1], events.colours)
    assert np.array_equal(picture_of(pages["image"], True)[1], grey)
    places = attention_image(ready, look_of(pages["places"]), AttentionState().site)
    assert np.array_equal(picture_of(pages["places"], True)[1], places)
    assert all(np.array_equal(picture_of(page, False)[1], grey) for page in pages.values())


def test_the_planes_behind_the_frame_are_the_same_layers_maps_finest_first(moment, ready):
    asked = ViewState(query=LOOK.query).put(AttentionState(site="scale2.encoder.0.self", shows_planes=True))
    page = Page(asked, moment, ready)
    assert sites_behind(page) == tuple(f"scale{scale}.encoder.0.self" for scale in (1, 2, 3))
    unseen = (asked.put(AttentionState()), asked.put(SceneState(camera="front")), replace(asked, query=None))
    assert all(sites_behind(replace(page, state=state)) == () for state in unseen)
    assert sites_behind(replace(page, ready=replace(ready, attention=None))) == ()
    assert sites_behind(replace(page, ready=None)) == ()
