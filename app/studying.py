"""One visitor's studies: which are asked, and what is known of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from app.studies import Finding, Study, Tell


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """A letter to the visitor's thread: news of the study in a slot."""

    slot: str
    finding: Finding


class Studies(Protocol):
    """The engine, as far as studies go."""

    def study(self, visitor: str, slot: str, study: Study, tell: Tell) -> None:
        """Ask; replaces what stood in the slot."""
        ...

    def drop_study(self, visitor: str, slot: str) -> None:
        """Forget what stands in the slot."""
        ...


class Studying:
    """Keeps what is asked equal to what is wanted. Used by the visitor's thread alone."""

    def __init__(self, engine: Studies, visitor: str, post: Callable[[Found], None]) -> None:
        self._engine = engine
        self._visitor = visitor
        self._post = post
        self._asked: dict[str, Study] = {}
        self.findings: dict[str, Finding] = {}
        """The newest news by slot. While a changed question is worked on, the answer to the last one stays: compare
        `finding.study` with what is on show to tell."""

    def want(self, studies: Mapping[str, Study]) -> None:
        """Ask what is new, drop what is no longer wanted."""
        for slot in [slot for slot in self._asked if slot not in studies]:
            del self._asked[slot]
            self.findings.pop(slot, None)
            self._engine.drop_study(self._visitor, slot)
        for slot, study in studies.items():
            if self._asked.get(slot) != study:
                self._asked[slot] = study
                self._engine.study(self._visitor, slot, study, lambda slot, finding: self._post(Found(slot, finding)))

    def drop(self, slot: str) -> None:
        """This answer is not wanted any more, whatever else is."""
        if slot in self._asked:
            self.want({name: study for name, study in self._asked.items() if name != slot})

    def take(self, found: Found) -> bool:
        """Fold one letter; whether it is about what is asked now."""
        if self._asked.get(found.slot) != found.finding.study:
            return False
        self.findings[found.slot] = found.finding
        return True
