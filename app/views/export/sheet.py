"""One moment as one picture to take home: the pictures, the voxel bins, the maps of a pixel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import UInt8

from app.engine.requests import Ready
from app.html.attention.changed import change_words
from app.html.attention.maps import AttentionLook, Site, head_words, map_ends, over_frame, row_of
from app.html.moment import NUM_BINS, Moment
from app.html.pictures import Tones, camera_image, event_picture, reconstruction_image
from app.html.units import bin_words, count, resolution, short
from app.views.export.state import Sheet
from etnet.errors import EtnetError
from etnet.render.board import Row, Scale, Section, Tile, board
from etnet.render.colours import diverging, sequential
from etnet.render.events import EventStyle
from etnet.render.voxels import voxel_limit, voxel_tiles

if TYPE_CHECKING:
    from etnet.nets.attention import Attention


_VERBS = {"attends to": "attends to", "attended by": "is attended by"}


def sheet_picture(
    sheet: Sheet,
    moment: Moment,
    ready: Ready,
    network: str,
    look: AttentionLook | None,
    tones: Tones,
    style: EventStyle,
) -> UInt8[np.ndarray, "h w 3"]:
    """The voxel bins, the maps, or the whole layout; maps are left out of a layout that has none.

    Raises:
        EtnetError: maps were asked for by themselves, and there are none.
    """
    has_maps = look is not None and ready.attention is not None and bool(ready.attention.sites)
    if sheet == "attention" and not has_maps:
        raise EtnetError("there are no attention maps here; choose a pixel, and a network with attention")
    sections = []
    if sheet == "layout":
        sections.append(_pictures(moment, ready, tones, style))
    if sheet in ("layout", "voxels"):
        sections.append(_voxels(moment))
    if sheet in ("layout", "attention") and look is not None and ready.attention is not None and has_maps:
        sections.append(_maps(ready, ready.attention, look))
    start, stop = moment.seconds
    facts = [
        f"window {moment.index} of 0 - {count(len(moment.windows) - 1)}",
        f"{start:.3f} ... {stop:.3f} s",
        f"{count(moment.window.num_events)} events",
        f"{moment.recording.sensor} px",
        f"{network}, {ready.contract.runtime.precision}",
    ]
    facts += [] if ready.request.is_original else [change_words(*ready.request.change[:2])]
    return board(moment.recording.name, "    ".join(facts), sections)


def _pictures(moment: Moment, ready: Ready, tones: Tones, style: EventStyle) -> Section:
    tiles = [
        Tile(event_picture(moment, style)[0].colours, "Events", style),
        Tile(reconstruction_image(ready, tones), "Reconstruction"),
    ]
    found = camera_image(moment, tones)
    if found is not None:
        grey, stamp = found
        tiles.append(Tile(grey, "Camera", f"{(stamp - moment.recording.span.start) / 1e6:.3f} s"))
    return Section([Row(tiles)])


def _voxels(moment: Moment) -> Section:
    limit = voxel_limit(moment.voxel)
    bins, _ = voxel_tiles(moment.voxel, moment.recording.sensor.width, limit)
    tiles = [Tile(tile, f"Bin {index}", bin_words(index)) for index, tile in enumerate(bins)]
    scale = Scale(diverging(), f"darker, -{short(limit)}", f"+{short(limit)}, brighter")
    return Section([Row(tiles)], f"Network input (voxel grid, {NUM_BINS} bins): polarity sum", scale)


def _maps(ready: Ready, attention: Attention, look: AttentionLook) -> Section:
    sites = {Site.of(name): name for name in attention.sites}
    layers = list(dict.fromkeys(site.row for site in sites))
    rows = []
    for scale in sorted({site.scale for site in sites}, reverse=True):
        tiles: list[Tile | None] = []
        for part, layer, kind in layers:
            name = sites.get(Site(scale, part, layer, kind))
            title = f"{part.capitalize()} {layer}, {kind}" if not rows else ""
            tiles.append(None if name is None else Tile(_map(ready, attention, look, name), title))
        rows.append(Row(tiles, resolution(scale)))
    who = head_words(look.head, look.gather)
    title = f"Attention: what pixel {look.query[0]}, {look.query[1]} {_VERBS[look.direction]}, {who}"
    return Section(rows, title, Scale(sequential(), *map_ends(look)))


def _map(ready: Ready, attention: Attention, look: AttentionLook, name: str) -> UInt8[np.ndarray, "h w 3"]:
    return over_frame(ready, look, row_of(ready, attention, name, look), look.query)
