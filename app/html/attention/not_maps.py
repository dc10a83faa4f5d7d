"""What attention maps are not: one click from every map."""

from __future__ import annotations

from app.html.elements import icon_button

NOT = (
    ("Not the reason for a pixel", "Skips and the upsampler go round TPA. Look at the bars: they are measured."),
    ("Not the contribution", "α is a mixing weight. ‖αvW_O‖ weighs it by what arrives."),
    ("Not where in the scene", "After the first layer a token already mixes others."),
    ("Not unique", "Heads can cancel each other, and a sharp head may write where nothing attends."),
    ("Not signed", "A weight can brighten or darken. Signs are in ablations and gradients."),
    ("Not always in known land", "Positions that training never met say more about the position code."),
)


def not_icon(key: str, is_on: bool) -> str:
    """The button; a click sends `key`."""
    return icon_button(key, "help", "What attention maps are not", is_on=is_on)


def explained_html() -> str:
    """All of it."""
    rows = "".join(f"<dt>{title}</dt><dd>{words}</dd>" for title, words in NOT)
    return f'<dl class="et-not" data-testid="not"><h4>What attention maps are not</h4>{rows}</dl>'
