"""A stand-in for `neuromorphic_drivers` that hands out packets as the real module's types state them.

The types are the real module's where it is installed (dataclasses of settings, bounds, status, names); only the device
itself is made up. It holds to the rules of the real one: a device belongs to the thread that reads it.
"""

import threading
from types import SimpleNamespace

import neuromorphic_drivers as real
import numpy as np
from neuromorphic_drivers import status
from neuromorphic_drivers.generated.devices.inivation_davis346 import BiasesBounds, Bounds

POLARITY = np.dtype([("t", "<u8"), ("x", "<u2"), ("y", "<u2"), ("on", "?")])
TRIGGER = np.dtype([("t", "<u8"), ("id", "u1"), ("polarity", "u1")])


def polarity_events(events):
    rows = np.zeros(len(events), POLARITY)
    rows["t"], rows["x"], rows["y"], rows["on"] = events.t, events.x, events.y, events.p > 0
    return rows


def davis_packet(events=None, triggers=None, frames=(), overflows=None):
    """The attributes of Davis346Packet."""
    return SimpleNamespace(
        polarity_events=None if events is None else polarity_events(events),
        imu_events=None,
        trigger_events=triggers,
        frames=list(frames),
        polarity_events_overflow_indices=None if overflows is None else np.array(overflows),
        imu_events_overflow_indices=None,
        trigger_events_overflow_indices=None,
        frames_overflow_indices=None,
    )


def davis_frame(t, pixels, exposure=4000):
    """The attributes of Frame; 10 bits, multiplied by 64."""
    return SimpleNamespace(
        start_t=t - exposure - 200, exposure_start_t=t - exposure - 100, exposure_end_t=t - 100, t=t, pixels=pixels
    )


class Device:
    """What `open` gives."""

    def __init__(self, driver, steps) -> None:
        self._driver, self._steps = driver, steps
        self._thread = None
        self.configurations = []
        self.is_closed = False

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.is_closed = True

    def __iter__(self):
        return self

    def __next__(self):
        self._check()
        step = next(self._steps, None)
        if step is None:
            raise StopIteration
        if isinstance(step, Exception):
            raise step
        if step == "timeout":
            return status.Status(system_time=1.0, ring=None), None
        packet, current_t = step
        ring = status.RingStatus(
            system_time=1.0, backlog=0, raw_packets=1, clutch_engaged=False, current_t=current_t, dropped_packets=0
        )
        return status.Status(system_time=1.0, ring=ring), packet

    def properties(self):
        return real.inivation_davis346.Properties()

    def biases_bounds(self):
        return BiasesBounds(**{name: Bounds(0, 2047) for name in BiasesBounds.__dataclass_fields__})

    def update_configuration(self, configuration):
        self._check()
        configuration.serialize()  # fails where a value is none of its type
        self.configurations.append(configuration)

    def _check(self):
        self._thread = self._thread or threading.get_ident()
        if self.is_closed:
            raise RuntimeError("__next__ called after __exit__")
        if self._thread != threading.get_ident():
            raise RuntimeError("__next__ called while device is used by a different thread")


class StandIn:
    """The module. `plugged_in` are its cameras, `openings` what each opening gives: steps, or an error."""

    inivation_davis346 = real.inivation_davis346

    def __init__(self, openings, plugged_in=None, error=None) -> None:
        self._openings = iter(openings)
        self.plugged_in = [("INIVATION_DAVIS346", "00000391", error)] if plugged_in is None else plugged_in
        self.devices = []

    def list_devices(self):
        return [
            real.ListedDevice(real.Name[name], real.Connection.USB_SUPER, "", serial, error)
            for name, serial, error in self.plugged_in
        ]

    def open(self, configuration=None, iterator_timeout=None, serial=None):
        assert iterator_timeout is not None, "without one the reader cannot be stopped"
        steps = next(self._openings)
        if isinstance(steps, Exception):
            raise steps
        device = Device(self, iter(steps))
        if configuration is not None:
            device.configurations.append(configuration)
        self.devices.append(device)
        return device
