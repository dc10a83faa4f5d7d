"""A stand-in for `neuromorphic_drivers` that hands out packets as the real module's types state them.

The types are the real module's where it is installed (dataclasses of settings, bounds, status, names); only the device
itself is made up. It holds to the rules of the real one: a device belongs to the thread that reads it.
"""

import threading
from types import SimpleNamespace

import neuromorphic_drivers as real
import numpy as np
from neuromorphic_drivers import status

TYPES = {
    "INIVATION_DAVIS346": real.inivation_davis346,
    "INIVATION_DVXPLORER": real.inivation_dvxplorer,
    "PROPHESEE_EVK3_HD": real.prophesee_evk3_hd,
    "PROPHESEE_EVK4": real.prophesee_evk4,
}
MOST = {"INIVATION_DAVIS346": 2047, "INIVATION_DVXPLORER": 7}
"""Bound of each bias; 200 for the others."""
POLARITY = np.dtype([("t", "<u8"), ("x", "<u2"), ("y", "<u2"), ("on", "?")])
TRIGGER = np.dtype([("t", "<u8"), ("id", "u1"), ("polarity", "u1")])


def polarity_events(events):
    rows = np.zeros(len(events), POLARITY)
    rows["t"], rows["x"], rows["y"], rows["on"] = events.t, events.x, events.y, events.p > 0
    return rows


def davis_packet(events=None, triggers=None, frames=(), overflows=None, others=None):
    """The attributes of Davis346Packet. `others`: overflows of the columns beside the events, by their names."""
    packet = SimpleNamespace(
        polarity_events=None if events is None else polarity_events(events),
        imu_events=None,
        trigger_events=triggers,
        frames=list(frames),
        polarity_events_overflow_indices=None if overflows is None else np.array(overflows),
        imu_events_overflow_indices=None,
        trigger_events_overflow_indices=None,
        frames_overflow_indices=None,
    )
    for kind, indices in (others or {}).items():
        assert hasattr(packet, f"{kind}_overflow_indices")
        setattr(packet, f"{kind}_overflow_indices", np.array(indices))
    return packet


def davis_frame(t, pixels, exposure=4000):
    """The attributes of Frame; 10 bits, multiplied by 64."""
    return SimpleNamespace(
        start_t=t - exposure - 200, exposure_start_t=t - exposure - 100, exposure_end_t=t - 100, t=t, pixels=pixels
    )


class Device:
    """What `open` gives. A step is "timeout", an error, or (packet, current_t) and what else the ring tells."""

    def __init__(self, name, steps) -> None:
        self._name, self._steps = name, steps
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
        packet, current_t, *told = step
        ring = {"system_time": 1.0, "backlog": 0, "raw_packets": 1, "clutch_engaged": False, "dropped_packets": 0}
        ring |= {"current_t": current_t, **(told[0] if told else {})}
        return status.Status(system_time=1.0, ring=status.RingStatus(**ring)), packet

    def properties(self):
        return TYPES[self._name].Properties()

    def biases_bounds(self):
        types = TYPES[self._name]
        bounds = types.Bounds(0, MOST.get(self._name, 200))
        return types.BiasesBounds(**dict.fromkeys(types.BiasesBounds.__dataclass_fields__, bounds))

    def update_configuration(self, configuration):
        self._check()
        assert isinstance(configuration, TYPES[self._name].Configuration)
        configuration.serialize()  # fails where a value is none of its type
        self.configurations.append(configuration)

    def _check(self):
        self._thread = self._thread or threading.get_ident()
        if self.is_closed:
            raise RuntimeError("__next__ called after __exit__")
        if self._thread != threading.get_ident():
            raise RuntimeError("__next__ called while device is used by a different thread")


def evt3_packet(events=None):
    """The attributes of Evt3Packet, of an EVK3 HD or EVK4."""
    return SimpleNamespace(
        polarity_events=None if events is None else polarity_events(events),
        trigger_events=None,
        polarity_events_overflow_indices=None,
        trigger_events_overflow_indices=None,
    )


class StandIn:
    """The module. `plugged_in` are its cameras, `openings` what each opening gives: steps, or an error."""

    inivation_davis346 = real.inivation_davis346
    inivation_dvxplorer = real.inivation_dvxplorer
    prophesee_evk3_hd = real.prophesee_evk3_hd
    prophesee_evk4 = real.prophesee_evk4

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
        name = next(name for name, number, _ in self.plugged_in if serial in (None, number))
        device = Device(name, iter(steps))
        if configuration is not None:
            device.configurations.append(configuration)
        self.devices.append(device)
        return device
