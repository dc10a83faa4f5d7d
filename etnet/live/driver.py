"""Event cameras through `neuromorphic-drivers` (the extra `live`): DAVIS346, DVXplorer, EVK3 HD, EVK4, …

A device belongs to the thread that reads it, so settings are changed there, between two packets.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from importlib import import_module
from typing import Any

import numpy as np
from jaxtyping import UInt8

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.triggers import Triggers
from etnet.live.driver_faults import fault_of, sentence
from etnet.live.driver_settings import CameraSettings
from etnet.live.driver_status import Drops, Told, num_overflows
from etnet.live.source import CameraFrame, Packet, Setting, no_triggers

MODULE = "neuromorphic_drivers"
TIMEOUT = 0.1
"""Seconds after which the driver returns without events."""
LOOK_AGAIN = 0.5
"""Seconds from one look for an unplugged camera to the next."""
MOST_CHANGES = 64
"""Settings that wait to be changed; older wishes go."""


@dataclass(frozen=True, slots=True)
class ListedCamera:
    """A camera that the driver sees. `kind` is the short name on the command line, "davis346"."""

    kind: str
    model: str
    serial: str | None
    fault: str | None
    """Why it cannot be used, as a sentence."""


def driver_module() -> Any:
    """The driver. Raises RecordingError with the command that installs it."""
    try:
        return import_module(MODULE)
    except ImportError as error:
        raise RecordingError(
            "live cameras need the driver: pip install neuromorphic-drivers; a stream or a recording needs nothing more"
        ) from error


def list_cameras(module: Any = None) -> tuple[ListedCamera, ...]:
    """What is plugged in."""
    module = module or driver_module()
    try:
        listed = module.list_devices()
    except RuntimeError as error:
        raise RecordingError(f"USB cannot be looked through ({error}); is there a USB controller?") from error
    return tuple(
        ListedCamera(
            kind_of(device.name.name), device.name.value, device.serial,
            None if device.error is None else sentence(device.name.value, device.error),
        )
        for device in listed
    )  # fmt: skip


def kind_of(name: str) -> str:
    """ "davis346" of the driver's INIVATION_DAVIS346; "evk3-hd" of PROPHESEE_EVK3_HD."""
    return name.partition("_")[2].lower().replace("_", "-")


class CameraSource:
    """One camera. `kind` and `serial` choose among several; without them the one that is plugged in."""

    def __init__(self, kind: str | None = None, serial: str | None = None, module: Any = None) -> None:
        self._module = module or driver_module()
        self._changes: deque[tuple[str, int]] = deque(maxlen=MOST_CHANGES)
        camera = self._chosen(kind, serial)
        self.kind, self._serial = camera.kind, camera.serial
        self.name = camera.model if camera.serial is None else f"{camera.model} {camera.serial}"
        self.format = "live through neuromorphic-drivers"
        self._settings: CameraSettings | None = None
        self._drops = Drops()
        self._unsaid: tuple[Setting, ...] = ()
        """Settings that were changed, until a packet tells of them."""
        self._device = self._opened()
        properties = self._device.properties()
        self.sensor = Sensor(int(properties.width), int(properties.height))
        types = _module_of(self._module, self.kind)
        has_limiter = "rate_limiter" in {entry.name for entry in fields(types.Configuration)}
        limiter = types.RateLimiter if has_limiter else None
        self._settings = CameraSettings(types.Configuration(), self._device.biases_bounds(), limiter)

    def packets(self, is_stopped: Callable[[], bool]) -> Iterator[Packet]:
        """What the driver hands over. An unplugged camera is looked for until it is back."""
        while not is_stopped():
            if self._device is None:
                time.sleep(LOOK_AGAIN)
                back = self._is_back()
                yield self._empty(f"{self.name}: the camera is back") if back else self._empty()
                continue
            try:
                self._apply_changes()
                status, packet = next(self._device)
                yield self._packet(status, packet)
            except StopIteration:
                return
            except RuntimeError as error:
                self._close_device()
                if fault_of(str(error)) != "unplugged" and self._is_listed():
                    raise RecordingError(sentence(self.name, str(error))) from error
                yield self._empty(sentence(self.name, "no such device"))

    def settings(self) -> tuple[Setting, ...]:
        """The rate limiter, the sensor's filters and exposure where it has them, and the biases."""
        return self._set.listed

    def change(self, name: str, value: int) -> None:
        """Change a setting before the next packet."""
        self._set.check(self.name, name, value)
        self._changes.append((name, value))

    def close(self) -> None:
        """Give the camera back."""
        self._close_device()

    def _packet(self, status: Any, packet: Any) -> Packet:
        told = Told.of(status)
        num_lost = self._drops.since(told.num_dropped, num_overflows(packet))
        if packet is None:
            return Packet(
                Events.empty(self.sensor), told.until, num_lost=num_lost, delay=told.delay, backlog=told.backlog,
                changed=self._said(),
            )  # fmt: skip
        frames = tuple(
            CameraFrame(_moment(frame), _pixels(frame.pixels)) for frame in getattr(packet, "frames", None) or ()
        )
        return Packet(
            _events(packet.polarity_events, self.sensor), told.until, frames, _edges(packet.trigger_events),
            num_lost, told.delay, told.backlog, self._said(),
        )  # fmt: skip

    def _empty(self, note: str | None = None) -> Packet:
        return Packet(Events.empty(self.sensor), changed=self._said(), notes=() if note is None else (note,))

    def _said(self) -> tuple[Setting, ...]:
        changed, self._unsaid = self._unsaid, ()
        return changed

    def _apply_changes(self) -> None:
        if not self._changes:
            return
        wanted: dict[str, int] = {}
        while self._changes:
            name, value = self._changes.popleft()
            wanted[name] = value
        # Said even where the camera is pulled out now: it is opened again with them.
        self._unsaid += self._set.change(wanted)
        assert self._device is not None
        self._device.update_configuration(self._set.configuration)

    @property
    def _set(self) -> CameraSettings:
        assert self._settings is not None
        return self._settings

    def _chosen(self, kind: str | None, serial: str | None) -> ListedCamera:
        listed = list_cameras(self._module)
        fitting = [c for c in listed if kind in (None, c.kind) and serial in (None, c.serial)]
        said = "; ".join(f"{c.kind} {c.serial or ''}".strip() for c in listed) or "none at all"
        if not fitting:
            raise RecordingError(f"{sentence(kind or 'camera', 'no device found')} (plugged in: {said})")
        if len(fitting) > 1:
            raise RecordingError(f"several cameras are plugged in ({said}); name one, as in --live davis346:SERIAL")
        if fitting[0].fault is not None:
            raise RecordingError(fitting[0].fault)
        return fitting[0]

    def _opened(self) -> Any:
        try:
            return self._module.open(
                configuration=None if self._settings is None else self._settings.configuration,
                iterator_timeout=TIMEOUT,
                serial=self._serial,
            ).__enter__()
        except RuntimeError as error:
            raise RecordingError(sentence(self.name, str(error))) from error

    def _is_listed(self) -> bool:
        listed = list_cameras(self._module)
        return any(c.kind == self.kind and c.serial == self._serial and c.fault is None for c in listed)

    def _is_back(self) -> bool:
        try:
            if not self._is_listed():
                return False
            self._device = self._opened()
        except RecordingError:
            return False
        self._drops.opened_again()
        return True

    def _close_device(self) -> None:
        device, self._device = self._device, None
        if device is not None:
            device.__exit__(None, None, None)


def _module_of(module: Any, kind: str) -> Any:
    """The driver's types for one kind of camera: `inivation_davis346` of "davis346"."""
    wanted = "_" + kind.replace("-", "_")
    return next(getattr(module, name) for name in dir(module) if name.endswith(wanted) and name.islower())


def _events(rows: np.ndarray | None, sensor: Sensor) -> Events:
    """Fields t (u64, µs), x, y (u16, from the top left), on."""
    if rows is None or len(rows) == 0:
        return Events.empty(sensor)
    p = np.where(rows["on"], 1, -1).astype(np.int8)
    return Events(rows["x"].astype(np.uint16), rows["y"].astype(np.uint16), rows["t"].astype(np.int64), p, sensor)


def _edges(rows: np.ndarray | None) -> Triggers:
    """Fields t (u64, µs), id (the input), and the edge: 0 falling, 1 rising, 2 a pulse."""
    if rows is None or len(rows) == 0:
        return no_triggers()
    names = rows.dtype.names or ()
    edge = next(name for name in ("polarity", "rising", "edge") if name in names)
    channels = rows["id"].astype(np.int16) if "id" in names else np.zeros(len(rows), np.int16)
    told = rows[edge].astype(np.int8)
    return Triggers(rows["t"].astype(np.int64), channels, np.where(told == 2, 0, 2 * told - 1).astype(np.int8))


def _moment(frame: Any) -> int:
    """The middle of the exposure, where the camera tells it."""
    if frame.exposure_start_t is None or frame.exposure_end_t is None:
        return int(frame.t)
    return (int(frame.exposure_start_t) + int(frame.exposure_end_t)) // 2


def _pixels(pixels: np.ndarray) -> UInt8[np.ndarray, "h w"]:
    """The driver's 16 bits, of which the sensor gives the upper ten, as 8."""
    return (pixels >> 8).astype(np.uint8) if pixels.dtype.itemsize > 1 else pixels.astype(np.uint8)
