"""Pure functions from a moment and a reply to what a page shows: HTML panels and arrays. Knows no viewer.

Put `STYLE` on the page once. Every panel is one string; clicks are told by `data-k` on what was clicked, through the
attribute that the caller passes as `on_pick` (trusted: everything else is escaped).
"""

from app.present.attention import AttentionLook, attention_html, attention_plane, site_words
from app.present.cloud import EventCloud, event_cloud
from app.present.moment import ARRAYS, PICTURES, Moment
from app.present.pictures import (
    Tones,
    camera_frame_html,
    camera_grey,
    event_image_html,
    event_picture,
    frame_grey,
    reconstruction_html,
)
from app.present.provenance import ModelFacts, provenance_html
from app.present.style import STYLE
from app.present.timeline import timeline_html
from app.present.voxels import voxel_html

__all__ = [
    "ARRAYS",
    "PICTURES",
    "STYLE",
    "AttentionLook",
    "EventCloud",
    "ModelFacts",
    "Moment",
    "Tones",
    "attention_html",
    "attention_plane",
    "camera_frame_html",
    "camera_grey",
    "event_cloud",
    "event_image_html",
    "event_picture",
    "frame_grey",
    "provenance_html",
    "reconstruction_html",
    "site_words",
    "timeline_html",
    "voxel_html",
]
