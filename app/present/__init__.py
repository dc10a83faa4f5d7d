"""Pure functions from a moment and a reply to what a page shows: HTML panels and arrays. Knows no viewer.

Put `STYLE` on the page once. Every panel is one string; clicks are told by `data-k` on what was clicked, through the
attribute that the caller passes as `on_pick` (trusted: everything else is escaped).
"""

from app.present.attention import attention_html, attention_image, places_html
from app.present.attention_maps import AttentionLook, site_words
from app.present.cloud import EventCloud, event_cloud
from app.present.moment import ARRAYS, PICTURES, Moment
from app.present.pictures import (
    Tones,
    camera_frame_html,
    camera_image,
    event_image_html,
    event_picture,
    reconstruction_html,
    reconstruction_image,
)
from app.present.provenance import ModelFacts, provenance_html
from app.present.style import STYLE
from app.present.timeline import curve_of, now_html, timeline_html, timeline_key_html
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
    "attention_image",
    "camera_frame_html",
    "camera_image",
    "curve_of",
    "event_cloud",
    "event_image_html",
    "event_picture",
    "now_html",
    "places_html",
    "provenance_html",
    "reconstruction_html",
    "reconstruction_image",
    "site_words",
    "timeline_html",
    "timeline_key_html",
    "voxel_html",
]
