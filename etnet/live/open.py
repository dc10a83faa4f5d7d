"""From what is written after `--live` to a source: a camera, an address, a webcam, or a recording to replay."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.live.address import Address
from etnet.live.buffer import Keep
from etnet.live.layouts import LayoutName
from etnet.live.source import LiveSource

CAMERAS = ("davis346", "dvxplorer", "evk3-hd", "evk4", "vga", "triton")
"""Kinds of cameras that the driver knows."""
KINDS = f"camera, {', '.join(CAMERAS)} (each with :SERIAL), stdin, tcp:PORT, udp:PORT, webcam[:NUMBER], or a recording"

WEBCAM_SIDE = 240
"""Pixels of a webcam's longer side: what one busy core simulates at 30 frames a second."""


@dataclass(frozen=True, slots=True)
class SourceOptions:
    """What some sources need to be told."""

    sensor: Sensor | None = None
    """Of a stream that does not tell the size itself."""
    layout: LayoutName | None = None
    """Of a stream; by default Event Stream over TCP and standard input, `t64_x16_y16_on8` over UDP."""
    speed: float = 1.0
    """Of a replay; 0 is as fast as it goes."""
    is_looped: bool = False
    """Whether a replay begins again."""
    contrast: float = 0.2
    """Of a webcam's simulated sensor: the change of natural-log intensity that makes an event."""


def open_source(
    text: str,
    options: SourceOptions | None = None,
    is_stopped: Callable[[], bool] = lambda: False,
    tell: Callable[[str], None] = lambda _: None,
) -> LiveSource:
    """The source that `text` names. Raises RecordingError with the forms it may have.

    A file that is called like a camera is `./davis346`.

    A stream that does not know its sensor yet waits for what tells it, until `is_stopped`; one over TCP tells so.
    Only the source that is named is imported: the viewer's command line loads this module at every start.
    """
    options = options or SourceOptions()
    kind, _, rest = text.partition(":")
    if text in ("stdin", "-"):
        from etnet.live.stdin import InputStream

        return InputStream(Address("stdin"), options.sensor, options.layout or "es", is_stopped=is_stopped)
    if kind == "tcp":
        from etnet.live.tcp import Listener

        listener = Listener(_address("tcp", rest), options.layout or "es", options.sensor)
        tell(f"listening on {listener.address}")
        try:
            return listener.stream(is_stopped)
        except BaseException:
            listener.close()
            raise
    if kind == "udp":
        if options.sensor is None:
            raise RecordingError(f"{text}: datagrams do not tell the sensor's size; state it: --sensor 346x260")
        from etnet.live.udp import UdpStream

        return UdpStream(_address("udp", rest), options.sensor, options.layout or "t64_x16_y16_on8")
    if kind == "webcam" and (rest == "" or rest.isdigit()):
        from etnet.live.webcam import Webcam
        from etnet.simulation.video import VideoConfig

        return Webcam(int(rest or 0), VideoConfig(contrast=options.contrast, longest_side=WEBCAM_SIDE))
    if kind in ("camera", *CAMERAS):
        from etnet.live.driver import CameraSource

        return CameraSource(None if kind == "camera" else kind, rest or None)
    if Path(text).exists():
        from etnet.events.open import open_recording
        from etnet.live.replay import Replay

        return Replay(open_recording(text), options.speed, options.is_looped)
    raise RecordingError(f"{text}: neither a file nor a live source; wanted {KINDS}")


def parsed_sensor(text: str) -> Sensor:
    """346x260 as a sensor."""
    found = re.fullmatch(r"(\d{1,5})[x×](\d{1,5})", text.strip())
    if found is None or not (0 < int(found[1]) <= 65_535 and 0 < int(found[2]) <= 65_535):
        raise RecordingError(f"a sensor of {text!r} is not understood; write it as 346x260")
    return Sensor(int(found[1]), int(found[2]))


def parsed_keep(text: str) -> Keep:
    """60s, 512MB, or both with a comma between."""
    keep = {"seconds": 60.0, "num_bytes": 512 << 20}
    for part in text.split(","):
        found = re.fullmatch(r"([0-9.]+)\s*(s|MB)", part.strip())
        try:
            value = float(found[1]) if found else -1.0
        except ValueError:
            value = -1.0
        if found is None or value < 0:
            raise RecordingError(f"--keep {text!r} is not understood; write 60s, 512MB or 60s,512MB")
        keep["seconds" if found[2] == "s" else "num_bytes"] = value if found[2] == "s" else int(value * (1 << 20))
    return Keep(float(keep["seconds"]), int(keep["num_bytes"]))


def _address(transport: str, text: str) -> Address:
    host, _, port = text.rpartition(":")
    if not port.isdigit() or int(port) > 65_535:
        raise RecordingError(f"{transport}:{text}: no port; write {transport}:7777 or {transport}:HOST:7777")
    return Address("tcp" if transport == "tcp" else "udp", host.strip("[]") or "127.0.0.1", int(port))
