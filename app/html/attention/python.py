"""Copy as Python: the lines that give exactly what the page shows, as a block that can be copied."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.engine.requests import FrameRequest
from app.html.elements import escape, icon_button
from app.html.moment import Moment

if TYPE_CHECKING:
    from etnet.inspection.asked import Asked
    from etnet.inspection.described import Described
    from etnet.nets.runtime import Contract


@dataclass(frozen=True, slots=True)
class Named:
    """By what names Python finds what is open: the recording's file, and the network or its file."""

    recording: str
    model: str


def described(moment: Moment, asked: FrameRequest, contract: Contract, named: Named) -> Described:
    """What was asked by all that decides its bits; `contract` is the one under which it was computed."""
    from etnet.events.opened_as import OpenedAs
    from etnet.inspection.described import Described

    return Described(
        named.recording,
        named.model,
        asked.policy,
        asked.index,
        moment.recording.opened_as or OpenedAs(),
        asked.cleaning,
        asked.cold_at,
        "bf16" if contract.runtime.precision == "bf16" else "fp32",
        contract.device,
        contract.threads,
        asked.intervention,
        asked.edit,
        asked.since,
        asked.once,
    )


def code_html(text: str, is_shown: bool, switch: str, choice: str = "", refused: str = "") -> str:
    """A button that shows the lines, and the lines with one that copies them. `switch`: its key without the word.

    `choice`: which lines, where there are several. `refused`: why there are none.
    """
    opener = icon_button(f"{switch}:{not is_shown}", "code", "Copy as Python", is_on=is_shown)
    head = f'<div class="et-caption"><span>Copy as Python</span>{opener}</div>'
    if not is_shown:
        return head
    if refused:
        return f'{head}<div class="et-say" data-testid="no-lines">{escape(refused)}</div>'
    copy = '<button class="et-button" data-etv-copy-text="1">Copy</button>'
    note = '<span class="et-note">Exact on the same machine, with the same versions. Run it where the file lies.</span>'
    return (
        f'{head}{choice}<pre class="et-code" data-testid="python" tabindex="0">{escape(text)}</pre>'
        f'<div class="et-chips">{copy}{note}</div>'
    )


def python_of(described_: Described, asked: Asked, then: Described | None = None) -> str:
    """The lines."""
    from etnet.inspection.as_python import as_python

    return as_python(described_, asked, then)
