"""The inspectors by name, and what the palette can do with them and with a change."""

from __future__ import annotations

from app.state import intents as ask
from app.views.inspect.state import Inspector, ResetAll, ShowOriginal
from app.views.view import Command

INSPECTORS: dict[Inspector, tuple[str, str]] = {
    "matters": ("Ablation", "the image without each part"),
    "change": ("Intervention", "mask, ablate, zero, edit events"),
    "twin": ("Effect over time", "a change against the original run"),
    "sources": ("Pixel sources", "events, bins, state, scales, skips"),
    "search": ("Causal search", "the window it rests on"),
    "events": ("Event attribution", "its gradient, event by event"),
    "input": ("Network input", "exact voxel grid, bins, token"),
    "state": ("ConvLSTM state", "gates, channels by energy"),
    "memory": ("Memory depth", "windows each pixel needs"),
    "rollout": ("Attention rollout", "all layers multiplied"),
    "time": ("Attention over time", "kymograph, entropy, local mass"),
    "spread": ("Uncertainty", "spread under event dropout"),
}
_TO_INSPECTORS = ask.ShowWorkspace("inspect"), ask.OpenTab("inspect")
COMMANDS = (
    Command("Change: show the original", None, ShowOriginal(True)),
    Command("Change: show it changed again", None, ShowOriginal(False)),
    Command("Change: reset all", None, ResetAll()),
    *(
        Command(f"Inspector: {title}", None, (*_TO_INSPECTORS, ask.Set("inspect", "opened", name)))
        for name, (title, _) in INSPECTORS.items()
    ),
)
