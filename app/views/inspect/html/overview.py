"""What stands in the tab while no inspector is open: ablation at the chosen pixel as bars, and the list."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.html.controls import choose_pixel, part_words, percent, plain_bar
from app.html.elements import ON_PICK, escape, panel
from app.html.units import resolution
from app.views.inspect.commands import INSPECTORS
from app.views.inspect.results import AblatedParts
from app.views.inspect.state import Inspector

if TYPE_CHECKING:
    from etnet.inspection.anatomy import Anatomy

NEEDS: dict[Inspector, str] = {
    "matters": "ablation",
    "search": "levels",
    "events": "gradient",
    "state": "gates",
    "rollout": "rollout",
    "time": "attention",
}
"""What a network has to have for an inspector, by the library's name of it."""
_HINT = "Its value without TPA, each skip, this window’s events and the state before then stands here."


def ablation_html(query: tuple[int, int] | None, found: AblatedParts | None, waits: str) -> str:
    """How far the pixel moves without each part."""
    if query is None:
        return panel("ablation", choose_pixel(_HINT))
    head = f"<h4>Pixel {query[0]}, {query[1]}</h4>"
    lead = '<div class="et-note">Ablation at this pixel: how far it moves without each part</div>'
    if found is None:
        return panel("ablation", head, lead, waits)
    moved = {name: abs(found.at(name, query)) for name in found.differences}
    largest = max(moved.values(), default=0.0)
    rows = "".join(
        f'<span class="et-note">{escape(part_name(name))}</span><span class="et-measure" data-testid="moved">'
        f"{plain_bar(value, largest)}<b>{percent(value, is_signed=False)}</b></span>"
        for name, value in moved.items()
    )
    return panel("ablation", head, lead, f'<div class="et-table et-two et-bars">{rows}</div>', waits)


def part_name(name: str) -> str:
    """ "Skip, 1/2", "State before"."""
    words = part_words(name)[0]
    return words[:1].upper() + words[1:]


def list_html(lacks: dict[str, str]) -> str:
    """Every inspector; one that has nothing to show of this network says so when it is pointed at or opened."""
    rows: list[str] = []
    for name, (title, line) in INSPECTORS.items():
        said = lacks.get(NEEDS.get(name, ""), "")
        words = "not in this network" if said else line
        hint = f' title="{escape(said)}"' if said else ""
        rows.append(
            f'<button data-k="set:inspect.opened:{name}" {ON_PICK} data-testid="open-{name}"{hint}>{escape(title)}'
            f"<span>{escape(words)}</span></button>"
        )
    return panel("inspector-list", "<h4>Inspectors</h4>", f'<div class="et-inspectors">{"".join(rows)}</div>')


def stage_words(name: str, anatomy: Anatomy | None = None) -> str:
    """A part of the sources figure in standard words; a level's resolution only where it is known to have one."""
    kind, _, number = name.partition(" ")
    match kind:
        case "bin":
            return f"Bin {number}"
        case "level":
            own = "" if anatomy is None else level_words(anatomy, int(number))
            return f"Level {number}" if own in ("", f"level {number}") else f"Level {number} ({own})"
        case "scale":
            return f"Scale {resolution(int(number))}"
        case "skip":
            return part_name(name)
    return name[:1].upper() + name[1:]


def level_words(anatomy: Anatomy, level: int) -> str:
    """A recurrent level by its resolution, or, where levels have none of their own, by its number."""
    return resolution(level) if anatomy.memory == "ConvLSTM" else f"level {level}"
