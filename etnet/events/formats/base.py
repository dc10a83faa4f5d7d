"""What a format is: how its files are known, and what opening one gives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from etnet.errors import EtnetError, RecordingError
from etnet.events.assumptions import Assumptions, Progress
from etnet.events.cache import Scratch
from etnet.events.events import Sensor
from etnet.events.provenance import Provenance
from etnet.events.recording import EventSource, GroundTruth, Growth, Inertial, Remark, Span
from etnet.events.triggers import Triggers

HEAD_BYTES = 4096


@dataclass(frozen=True)
class Request:
    """A file to open. `head` is its first bytes (none of a folder), `members` the files in a folder or zip archive.

    What a reader opens and must be closed with the recording goes into `resources`; large decoded data into `scratch`.
    `patience`: seconds that making an index may take; None waits for all of it.
    """

    path: Path
    name: str
    head: bytes
    members: tuple[str, ...]
    assume: Assumptions
    progress: Progress
    resources: ExitStack
    scratch: Scratch
    patience: float | None = None

    @property
    def suffix(self) -> str:
        """The file's suffix in lower case, with its point."""
        return self.path.suffix.lower()


@dataclass(frozen=True)
class Opened:
    """What a reader gives: events, sensor, span, and what there was to say."""

    format: str
    source: EventSource
    sensor: Sensor
    span: Span
    remarks: tuple[Remark, ...] = ()
    ground_truth: GroundTruth | None = None
    inertial: Inertial | None = None
    growth: Growth | None = None
    triggers: Triggers | None = None
    provenance: Provenance | None = None


@dataclass(frozen=True)
class Format:
    """One line of the table of formats. `suffixes` help only where the content leaves a choice.

    `is_known_by_content`: false where nothing but the suffix tells; such a format is taken where no other one fits.
    `holds_events`: of a file that was recognised, whether events are in it; a table may hold anything.
    """

    name: str
    suffixes: tuple[str, ...]
    recognises: Callable[[Request], bool]
    open: Callable[[Request], Opened]
    is_known_by_content: bool = True
    holds_events: Callable[[Request], bool] = lambda _: True


@dataclass
class Remarks:
    """Remarks as they gather while a file is opened."""

    kept: list[Remark] = field(default_factory=list)

    def detected(self, text: str) -> None:
        """Found in the file."""
        self.kept.append(Remark("detected", text))

    def repaired(self, text: str) -> None:
        """Mended."""
        self.kept.append(Remark("repaired", text))

    def assumed(self, text: str) -> None:
        """Taken for granted."""
        self.kept.append(Remark("assumed", text))

    def advise(self, text: str) -> None:
        """Doubtful: a person should look at it before the recording is trusted."""
        self.kept.append(Remark("advice", text))


@contextmanager
def contained(
    name: str, what: str, verb: str = "read", remedy: str = "the file may be truncated or damaged"
) -> Iterator[None]:
    """Turn whatever a library throws into a RecordingError.

    Rust libraries panic with an exception that derives from BaseException and not from Exception, so all is caught here
    but what ends the program.
    """
    try:
        yield
    except (EtnetError, KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except MemoryError as slip:
        raise RecordingError(f"{name}: to {verb} {what} asks for more memory than there is; {remedy}") from slip
    except BaseException as slip:
        reason = (str(slip).strip().splitlines() or [type(slip).__name__])[0][:200]
        raise RecordingError(f"{name}: cannot {verb} {what} ({reason}); {remedy}") from slip
