"""What a visitor of the demo sees before viser's client has started: the first events, moving, and the first sentence.

It stands in the page as it is sent, and moves by the style sheet alone: a browser that is busy with a script shows it.
"""

from __future__ import annotations

import base64

import numpy as np

from app.html.elements import escape
from app.views.demo.html import SAYINGS
from etnet.events.events import Events, Sensor
from etnet.events.recording import Recording
from etnet.render.encode import webp
from etnet.render.events import event_image
from etnet.windows import Policy, plan_windows

NUM_PICTURES = 16
"""`demo.css` steps through as many."""
WIDEST = 320
"""Pixels: events of larger sensors are binned."""


def first_html(recording: Recording, policy: Policy) -> str:
    """The first windows' events as one strip of pictures below each other; nothing where there are too few windows."""
    windows = plan_windows(recording, policy)
    if len(windows) < NUM_PICTURES:
        return ""
    pictures = []
    for index in range(NUM_PICTURES):
        window = windows[index]
        events = _binned(recording.read(window.start, window.stop))
        pictures.append(event_image(events, "polarity", window.t_start, window.t_stop)[0].colours)
    height, width, _ = pictures[0].shape
    strip = "data:image/webp;base64," + base64.b64encode(webp(np.concatenate(pictures), None)).decode("ascii")
    return (
        f'<div class="etv-opening" data-testid="first"><h1>{escape(SAYINGS["events"])}</h1>'
        f'<div><span style="--ratio:{width / height:.4f}"><img alt="Events" src="{strip}"></span></div></div>'
    )


def _binned(events: Events) -> Events:
    factor = -(-events.sensor.width // WIDEST)
    if factor == 1:
        return events
    sensor = Sensor(events.sensor.width // factor, events.sensor.height // factor)
    x, y = events.x // factor, events.y // factor
    inside = (x < sensor.width) & (y < sensor.height)
    return Events(x[inside], y[inside], events.t[inside], events.p[inside], sensor)
