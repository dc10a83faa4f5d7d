"""The 3-D scene of one visitor: event cloud, frame plane, attention links and camera."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import viser
from jaxtyping import UInt8

from app.html.attention.links import links_of
from app.html.attention.maps import attention_image, site_in
from app.html.moment import Moment
from app.html.pictures import EventCloud, event_cloud, event_picture, reconstruction_image
from app.views.attention.state import AttentionState, look_of
from app.views.demo.state import DemoState
from app.views.events.state import EventsState
from app.views.page import Page
from app.views.reconstruction.state import tones_of
from app.views.scene.event_cloud import POINTS_AT_REST, POINTS_IN_MOTION, CloudNode
from app.views.scene.nodes import FramePlane, LinksNode, MapPlanes
from app.views.scene.space import Space, camera_place
from app.views.scene.state import Camera, SceneState

LAGGING = 0.45
"""Brightness of a picture that belongs to another window than the current one."""


class SceneView:
    """Draws a page into the scene; places the camera when the preset or the canvas changes."""

    def __init__(self, client: viser.ClientHandle, dispatch: Callable[[Any], None], is_phone: bool = False) -> None:
        self._client = client
        self._is_phone = is_phone
        self._cloud = CloudNode(client.scene)
        self._plane = FramePlane(client.scene, dispatch)
        self._links = LinksNode(client.scene)
        self._maps = MapPlanes(client.scene)
        self._placed: object = None

    def show(self, page: Page) -> EventCloud | None:
        """Draw the moment; the cloud that is drawn, if any."""
        if page.moment is None:
            return None
        state, space = page.state, Space(page.moment.recording.sensor)
        behind = sites_behind(page)
        scene, attention = state.of(SceneState), state.of(AttentionState)
        shows_cloud = not behind and scene.shows_events and scene.camera != "front"
        cloud = _cloud(page, page.moment) if shows_cloud else None
        key, picture = picture_of(page, self._is_phone)
        with self._client.atomic():
            self._cloud.set_visible(shows_cloud)
            if cloud is not None:
                self._cloud.show(space, cloud, has_scale=state.workspace != "demo")
            self._plane.show(space, key, picture, page.is_moving)
            if behind or self._maps.is_shown:
                self._maps.show(space, *_maps(page, behind))
            if attention.shows_links or self._links.is_shown:
                links = links_of(page.ready, state.query) if attention.shows_links else ()
                self._links.show(space, state.query, links)
        self._place(space, page)
        return cloud

    def _place(self, space: Space, page: Page) -> None:
        """Put the camera to its preset if preset, sensor, canvas or visitor changed, or if it is asked for again."""
        scene, aspect = page.state.of(SceneState), round(self._client.camera.aspect, 2)
        placed = (space, scene.camera, scene.num_asked, page.state.visit, aspect)
        if self._placed != placed:
            self._placed = placed
            _place_camera(self._client, space, scene.camera)


def _cloud(page: Page, moment: Moment) -> EventCloud:
    """The window's events, or those that an open view has coloured."""
    limit = POINTS_IN_MOTION if page.is_moving else POINTS_AT_REST
    coloured = None if page.cloud is None else page.cloud(limit)
    return event_cloud(moment, limit) if coloured is None else coloured


def sites_behind(page: Page) -> tuple[str, ...]:
    """The sites whose maps stand behind the frame: the chosen layer at every scale, the finest first.

    None unless they are asked for, nor in the front view, where they would be hidden.
    """
    state, ready = page.state, page.ready
    if ready is None or ready.attention is None or state.query is None:
        return ()
    if not state.of(AttentionState).shows_planes or state.of(SceneState).camera == "front":
        return ()
    if not ready.attention.sites:
        return ()
    layer = site_in(ready.attention, state.of(AttentionState).site).partition(".")[2]
    return tuple(sorted(name for name in ready.attention.sites if name.partition(".")[2] == layer))


def _maps(page: Page, sites: tuple[str, ...]) -> tuple[object, tuple[UInt8[np.ndarray, "h w 3"], ...]]:
    """A key that tells these maps from others, and the maps."""
    ready, look = page.ready, look_of(page)
    if ready is None or look is None or not sites:
        return None, ()
    lags = page.lags
    found = (attention_image(ready, look, site) for site in sites)
    return (ready.key, look, sites, lags), tuple(_dimmed(image, lags) for image in found if image is not None)


def picture_of(page: Page, is_phone: bool) -> tuple[object, UInt8[np.ndarray, "h w 3"] | None]:
    """What stands on the plane (events, a map or the frame: what the page is about), and what tells it apart."""
    ready, state = page.ready, page.state
    # The demo's large pictures hide the scene; on a phone, where they have no room, it is what the caption speaks of.
    shows_act = is_phone and state.workspace == "demo"
    if shows_act and state.of(DemoState).act == "events" and page.moment is not None:
        style = state.of(EventsState).event_image
        image, _ = event_picture(page.moment, style)
        return ("events", page.moment.key, style), image.colours
    if ready is None or state.of(DemoState).guess == "asked":
        return None, None
    lags, tones = page.lags, tones_of(page)
    look = look_of(page) if shows_act or state.workspace == "attention" else None
    if look is not None and ready.attention is not None:
        site = state.of(AttentionState).site
        site = site_in(ready.attention, site) if ready.attention.sites else site
        image = attention_image(ready, look, site)
        if image is not None:
            return ("attention", ready.key, look, site, lags), _dimmed(image, lags)
    grey = cv2.cvtColor(reconstruction_image(ready, tones), cv2.COLOR_GRAY2RGB)
    return ("frame", ready.key, tones, lags), _dimmed(grey, lags)


def _dimmed(image: UInt8[np.ndarray, "h w 3"], lags: bool) -> UInt8[np.ndarray, "h w 3"]:
    return (image * LAGGING).astype(np.uint8) if lags else image


def _place_camera(client: viser.ClientHandle, space: Space, camera: Camera) -> None:
    """Put the camera where a preset wants it on this canvas."""
    place = camera_place(space, camera, client.camera.aspect)
    with client.atomic():
        client.camera.up_direction = (0.0, -1.0, 0.0)
        client.camera.fov = place.fov
        client.camera.near = place.near
        client.camera.far = place.far
        client.camera.position = place.position
        client.camera.look_at = place.look_at
