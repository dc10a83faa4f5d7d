"""All views of the page, in order. A new one is a folder and a line here."""

from __future__ import annotations

from app.views.appearance import VIEW as APPEARANCE
from app.views.attention import VIEW as ATTENTION
from app.views.compare import VIEW as COMPARE
from app.views.demo import VIEW as DEMO
from app.views.events import VIEW as EVENTS
from app.views.export import VIEW as EXPORT
from app.views.filter import VIEW as FILTER
from app.views.inspect import VIEW as INSPECT
from app.views.reconstruction import VIEW as RECONSTRUCTION
from app.views.recording import VIEW as RECORDING
from app.views.scene import VIEW as SCENE
from app.views.timeline import VIEW as TIMELINE
from app.views.video import VIEW as VIDEO
from app.views.view import View
from app.views.voxels import VIEW as VOXELS

VIEWS: tuple[View, ...] = (
    TIMELINE,
    RECONSTRUCTION,
    EVENTS,
    SCENE,
    VOXELS,
    ATTENTION,
    INSPECT,
    COMPARE,
    RECORDING,
    VIDEO,
    APPEARANCE,
    FILTER,
    EXPORT,
    DEMO,
)
