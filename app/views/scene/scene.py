"""The middle of the page: event cloud, frame plane and camera of one visitor."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import viser
from jaxtyping import UInt8

from app.html.moment import Moment
from app.html.pictures import event_picture, reconstruction_image
from app.session.layout import place_camera
from app.state import intents as ask
from app.views.attention.html.grid import attention_image, sites_behind
from app.views.attention.html.links import links_of
from app.views.inspect.html.attribution import traced_cloud
from app.views.inspect.results import Traced
from app.views.scene.event_cloud import POINTS_AT_REST, POINTS_IN_MOTION, CloudNode
from app.views.scene.frame_plane import FramePlane
from app.views.scene.links import LinksNode
from app.views.scene.map_planes import MapPlanes
from app.views.scene.points import EventCloud, event_cloud
from app.views.scene.space import Space
from app.views.view import Page

LAGGING = 0.45
"""Brightness of a picture that belongs to another window than the one on show."""


class SceneView:
    """Draws a page into the scene; places the camera when the preset or the canvas changes."""

    def __init__(
        self, client: viser.ClientHandle, dispatch: Callable[[ask.Intent], None], is_phone: bool = False
    ) -> None:
        self._client = client
        self._is_phone = is_phone
        self._cloud = CloudNode(client.scene)
        self._plane = FramePlane(client.scene, dispatch)
        self._links = LinksNode(client.scene)
        self._maps = MapPlanes(client.scene)
        self._placed: tuple[Space, ask.Camera, float] | None = None

    def show(self, page: Page) -> EventCloud | None:
        """Draw the moment; the cloud that is drawn, if any."""
        if page.moment is None:
            return None
        state, space = page.state, Space(page.moment.recording.sensor)
        behind = sites_behind(page.ready, page.look, state)
        shows_cloud = not behind and state.shows_events and state.camera != "front" and state.workspace != "demo"
        cloud = _cloud(page, page.moment) if shows_cloud else None
        key, picture = picture_of(page, self._is_phone)
        with self._client.atomic():
            self._cloud.set_visible(shows_cloud)
            if cloud is not None:
                self._cloud.show(space, cloud)
            self._plane.show(space, key, picture)
            self._maps.show(space, *_maps(page, behind))
            self._links.show(space, state.query, links_of(page.ready, state.query) if state.inside.shows_links else ())
        self.place(space, state.camera)
        return cloud

    def put_back(self) -> None:
        """Whatever a hand did to the camera: with the next moment it stands where its preset wants it."""
        self._placed = None

    def place(self, space: Space, camera: ask.Camera, again: bool = False) -> None:
        """Put the camera to its preset if preset, sensor or canvas changed, or if it is asked for `again`."""
        aspect = round(self._client.camera.aspect, 2)
        if again or self._placed != (space, camera, aspect):
            self._placed = (space, camera, aspect)
            place_camera(self._client, space, camera)


def _cloud(page: Page, moment: Moment) -> EventCloud:
    """The window's events; where a pixel is traced back, those of all its windows in the colours of what it owes."""
    limit = POINTS_IN_MOTION if page.is_moving else POINTS_AT_REST
    found = page.results.get("inside.traced")
    traced = None if found is None else found.value
    if isinstance(traced, Traced) and found is not None and traced.windows[-1].index == moment.index:
        return traced_cloud(traced, found.job, limit)
    return event_cloud(moment, limit)


def _maps(page: Page, sites: tuple[str, ...]) -> tuple[object, tuple[UInt8[np.ndarray, "h w 3"], ...]]:
    """A key that tells these maps from others, and the maps."""
    ready, look = page.ready, page.look
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
    if shows_act and state.show.act == "events" and page.moment is not None:
        image, _ = event_picture(page.moment, state.event_image)
        return ("events", page.moment.key, state.event_image), image
    if ready is None:
        return None, None
    lags = page.lags
    if (shows_act or state.workspace == "attention") and page.look is not None and ready.attention is not None:
        image = attention_image(ready, page.look, state.site)
        if image is not None:
            return ("attention", ready.key, page.look, state.site, lags), _dimmed(image, lags)
    grey = cv2.cvtColor(reconstruction_image(ready, page.tones), cv2.COLOR_GRAY2RGB)
    return ("frame", ready.key, page.tones, lags), _dimmed(grey, lags)


def _dimmed(image: UInt8[np.ndarray, "h w 3"], lags: bool) -> UInt8[np.ndarray, "h w 3"]:
    return (image * LAGGING).astype(np.uint8) if lags else image
