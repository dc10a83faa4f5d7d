"""A moment of a playback by all that decides its bits, as a frozen value."""

from __future__ import annotations

from dataclasses import dataclass

from etnet.events.denoise import UNCLEANED, Cleaning
from etnet.events.edit import UNEDITED, EventEdit
from etnet.events.opened_as import OpenedAs
from etnet.inspection.literals import Verbatim, call
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.nets.runtime import Precision
from etnet.windows import Policy


@dataclass(frozen=True, slots=True)
class Described:
    """A moment, by all that decides its bits. `index` counts from `cold_at`."""

    recording: str
    """The path of the file."""
    model: str
    """A bundled network's name, a weights file, or a Python file that defines a network."""
    policy: Policy
    index: int
    opened: OpenedAs = OpenedAs()  # noqa: RUF009  a frozen value
    cleaning: Cleaning = UNCLEANED
    cold_at: int = 0
    """The plan's window at which the memory is empty."""
    precision: Precision = "fp32"
    """As it was resolved, never "auto"."""
    device: str = "cpu"
    threads: int | None = None
    """Threads of torch; `None` leaves them as they are."""
    intervention: Intervention = ORIGINAL
    edit: EventEdit = UNEDITED
    since: int | None = None
    """The window from which on the change holds; `None`: from `index` on."""
    once: bool = False
    """The change holds in that window alone."""

    @property
    def is_changed(self) -> bool:
        """Whether anything was intervened in or edited."""
        return self.intervention != ORIGINAL or not self.edit.changes_nothing


def change_call(moment: Described, playback: str) -> str:
    """The playback that carries the moment's change."""
    at = moment.index if moment.since is None else moment.since
    given = {name: value for name, value in (("intervention", moment.intervention), ("edit", moment.edit))
             if value not in (ORIGINAL, UNEDITED)}  # fmt: skip
    if moment.once:
        return call("twin.changed", Verbatim(playback), at, **given, once=True)
    return call(f"{playback}.branch", at, **given)
