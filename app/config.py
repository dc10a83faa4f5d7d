"""The viewer's command line: this dataclass is what `etnet-view` takes."""

from __future__ import annotations

import secrets
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal
from urllib.parse import urlsplit

import tyro

from etnet.errors import EtnetError
from etnet.events.cleaning import parse_cleaning
from etnet.events.opened_as import View
from etnet.events.stated import Stated
from etnet.files import printable
from etnet.live.buffer import Keep
from etnet.live.layouts import LayoutName
from etnet.live.open import SourceOptions, parsed_keep, parsed_sensor
from etnet.live.record import check_recordable

LOOPBACK_HOSTS = ("127.0.0.1", "localhost", "::1")
MIN_BUDGET = 64
"""MB: room for a few states of the default network at 346×260."""


UPLOADS = 256
"""MB that a visitor may hand over where nothing is said and only this machine reaches the viewer."""
MOST_UPLOADS = 4096
LONGEST_TOKEN = 200
MOST_CACHE = 1 << 20


class ConfigError(EtnetError):
    """The viewer was asked for something that does not go together."""


def _is_web_address(text: str) -> bool:
    """Whether it names a host, and nothing below it: the page asks for all that it needs from the root."""
    try:
        parts = urlsplit(text)
    except ValueError:
        return False
    is_root = parts.path in ("", "/") and not parts.query and not parts.fragment
    return parts.scheme in ("http", "https") and bool(parts.hostname) and is_root


def _region(text: str) -> tuple[int, int, int, int]:
    parts = text.split(",")
    try:
        x, y, width, height = (int(part) for part in parts)
    except ValueError:
        raise ConfigError(f"--roi {text}: wanted x,y,width,height in pixels, for example 40,20,240,180") from None
    return x, y, width, height


@dataclass(frozen=True)
class LiveConfig:
    """How the source of --live is taken."""

    keep: str = "60s,512MB"
    """How much of --live is held: seconds, MB, or both."""
    record: Path | None = None
    """Write --live to this file from its first event on: .aedat4 or .h5."""
    sensor: str | None = None
    """WIDTHxHEIGHT of a stream that does not tell it."""
    layout: LayoutName | None = None
    """Of a stream: es (Event Stream), t64_x16_y16_on8 or t32_x16_y15_on1 (faery's)."""
    loop: bool = False
    """Replay a recording again and again."""
    rate: tuple[float, float] | None = None
    """Lowest and highest Mev/s: the biases of an EVK4 or DAVIS346 follow to stay between."""

    def buffer(self) -> Keep:
        """`keep`, understood."""
        return parsed_keep(self.keep)

    def options(self) -> SourceOptions:
        """What some sources need to be told."""
        sensor = None if self.sensor is None else parsed_sensor(self.sensor)
        return SourceOptions(sensor, self.layout, is_looped=self.loop)


@dataclass(frozen=True)
class ViewerConfig:
    """Inspect event-camera recordings, and the network that turns them into images, in a browser."""

    file: tyro.conf.Positional[Path | None] = None
    """A recording: a file, a folder or a zip; or a video, seen as an event sensor would; or a session file (.json),
    whose recording is shown as it was then. Without it a bundled one."""
    data: Path | None = None
    """A folder whose recordings are offered in the page."""
    model: str = "etnet-half"
    """A bundled model's name, a weights file, or a Python file of your own that defines `network`."""
    device: str = "cpu"
    """Where the network runs: cpu, cuda, cuda:1 …"""
    precision: Literal["auto", "fp32", "bf16"] = "fp32"
    """auto takes the faster of fp32 and bf16 on this machine, if both agree."""
    host: str = "127.0.0.1"
    """Where to listen. For any host but this machine's own a token is made up, unless --token gives one."""
    port: int = 8080
    """Where to listen; the next free port is taken if it is busy."""
    token: str | None = None
    """What visitors must give as ?token=… in the address; the printed address has it."""
    public_url: str | None = None
    """The address by which a proxy in front of the viewer is reached; a host of its own, without a path."""
    budget: Annotated[int, tyro.conf.arg(metavar="MB")] = 1024
    """Memory for frames and recurrent states of all visitors, in MB."""
    cache: Annotated[int | Literal["off"], tyro.conf.arg(metavar="{off,MB}")] = 1024
    """Disk for frames and states that are kept until the next start, in MB, or off; `etnet cache` lists them. What
    visitors upload is never kept."""
    threads: int | None = None
    """Threads for the network; as many as torch likes by default. Frames are exact for one number of threads."""
    roi: Annotated[str | None, tyro.conf.arg(metavar="X,Y,W,H", aliases=["--region"])] = None
    """Show a region of the sensor only, in pixels."""
    downsample: Literal[1, 2, 4] | None = None
    """Bin 2×2 or 4×4 pixels. By default large sensors are brought to a size that runs, and the page says so."""
    flip: Literal["none", "horizontal", "vertical", "both"] = "none"
    rotate: Literal[0, 90, 180, 270] = 0
    """Degrees clockwise."""

    filter: str | None = None
    """Take noise out first: hot, a time such as 5ms, both (hot,5ms), or with a neighbour count (hot,5ms,2)."""

    stated: Annotated[Stated, tyro.conf.arg(name="")] = field(default_factory=Stated)
    """Of FILE, and of what lies in --data."""

    uploads: Annotated[int | Literal["off"] | None, tyro.conf.arg(metavar="{off,MB}")] = None
    """MB that a visitor may upload from the browser, or off. By default 256, and off where others can come in
    (--demo, --public-url, --host). A visitor's files are private, and go with them."""

    live: str | None = None
    """Show a source while it comes: camera (--live alone), davis346, evk4 …, webcam, stdin, tcp:7777, udp:7777, or a
    recording that is replayed at its own speed."""
    source: Annotated[LiveConfig, tyro.conf.arg(name="")] = field(default_factory=LiveConfig)

    views: Annotated[tuple[Path, ...], tyro.conf.arg(name="view", metavar="FILE"), tyro.conf.UseAppendAction] = ()
    """A Python file of your own that is shown as a tab: it defines show(moment). May be given again."""

    follow: bool = False
    """For a talk: all pages show the moment of the one that leads, each with a pointer of its own. The page at this
    machine leads, or the first one."""

    camera: bool = True
    """Whether a visitor may look at themselves as a simulated sensor sees them, with the browser's own camera."""
    take_home: bool = True
    """Whether the demo hands out three seconds of what it shows as a page."""

    demo: bool = False
    """For a stand in public: shows itself until somebody touches it, and starts over when they have gone."""

    check: bool = False
    """With --demo: try what the demo needs without a browser, say what will fail, and end."""

    def __post_init__(self) -> None:
        if self.check and not self.demo:
            raise ConfigError("--check tries what a demo needs; give --demo with it")
        if self.follow and self.demo:
            raise ConfigError("--follow shows one page to all, --demo each visitor a page of their own; give one")
        if self.demo and self.data is not None:
            raise ConfigError("--demo shows FILE and the bundled recordings only; leave --data out")
        if not 0 <= self.port <= 65_535:
            raise ConfigError(f"--port {self.port}: wanted 0 … 65,535 (0 takes any free port)")
        if self.budget < MIN_BUDGET:
            raise ConfigError(f"--budget {self.budget}: wanted at least {MIN_BUDGET} MB")
        if isinstance(self.cache, int) and not 1 <= self.cache <= MOST_CACHE:
            raise ConfigError(f"--cache {self.cache}: wanted off or 1 … {MOST_CACHE:,} MB")
        if self.threads is not None and self.threads < 1:
            raise ConfigError(f"--threads {self.threads}: wanted at least 1")
        if isinstance(self.uploads, int) and not 1 <= self.uploads <= MOST_UPLOADS:
            raise ConfigError(
                f"--uploads {self.uploads}: wanted off or 1 … {MOST_UPLOADS:,} MB; larger files open from --data FOLDER"
            )
        self._check_token()
        if self.data is not None and not self.data.is_dir():
            raise ConfigError(f"--data {self.data}: there is no such folder")
        if self.views and self.is_open:
            raise ConfigError("--view runs your own code: it is not for --demo, --public-url or another --host")
        if self.live is None and self.source != LiveConfig():
            raise ConfigError(
                "--keep, --record, --sensor, --layout, --loop and --rate say how --live is taken; add --live"
            )
        if self.live is not None and (self.roi or self.flip != "none" or self.rotate):
            raise ConfigError("--live is shown whole; leave --roi, --flip and --rotate out")
        if self.source.record is not None:
            check_recordable(self.source.record, overwrite=False)
        _ = self.region, self.stated.assumptions(), self.source.buffer(), self.source.options()
        _ = parse_cleaning(self.filter)

    def _check_token(self) -> None:
        if self.token is None and self.host not in LOOPBACK_HOSTS:
            object.__setattr__(self, "token", secrets.token_urlsafe(18))
        if self.token is not None and not 1 <= len(self.token) <= LONGEST_TOKEN:
            raise ConfigError(
                f"--token: {len(self.token)} characters; wanted 1 … {LONGEST_TOKEN}, or leave it out and one is made up"
            )
        if self.token is not None and self.token != printable(self.token):
            raise ConfigError("--token: holds bytes that are no UTF-8; an address cannot carry them")
        if self.public_url is not None and not _is_web_address(self.public_url):
            raise ConfigError(
                f"--public-url {self.public_url}: wanted an address such as https://show.example, without a path"
            )

    @property
    def region(self) -> tuple[int, int, int, int] | None:
        """`roi` as numbers: x, y, width, height."""
        return None if self.roi is None else _region(self.roi)

    def view(self, downsample: Literal[1, 2, 4]) -> View:
        """Which part of a recording is seen, and how."""
        return View(self.region, downsample, self.flip, self.rotate)

    @property
    def is_open(self) -> bool:
        """Whether others than who started the viewer can come in."""
        return self.demo or self.public_url is not None or self.host not in LOOPBACK_HOSTS

    @property
    def upload_megabytes(self) -> int | None:
        """MB that a visitor may hand over; `None` where nothing is taken."""
        if self.uploads is not None:
            return self.uploads if isinstance(self.uploads, int) else None
        return None if self.is_open else UPLOADS

    @property
    def cache_bytes(self) -> int | None:
        """The budget on disk in bytes; `None` where nothing is kept."""
        return self.cache << 20 if isinstance(self.cache, int) else None

    @property
    def budget_bytes(self) -> int:
        """The budget in bytes."""
        return self.budget << 20
