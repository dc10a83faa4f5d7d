"""What a camera's driver lets us change, as settings: biases, the rate limiter, the sensor's own filters, exposure.

The driver is neuromorphic-drivers; its configurations are frozen trees of plain values, one class a camera. The driver
states bounds for biases alone. All others are the widths of the registers that they go to.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from typing import Any

from etnet.errors import RecordingError
from etnet.live.source import Setting

OFFERED = (
    "rate_limiter", "polarity_filter", "activity_filter", "skip_events_every", "exposure_us", "frame_interval_us",
    "readout_frames_per_second", "biases",
)  # fmt: skip
"""Of a configuration, in the order of a page. Masks, regions and the clock are not among them: they change what a
recording is."""
LIMITER = {"reference_period_us": 200, "maximum_events_per_period": 4_000}
"""The rate limiter's numbers until others are chosen: 20 Mev/s, as Prophesee's own software begins."""

_BOUNDS = {
    # Event rate controller of the IMX636: neuromorphic-drivers, devices/prophesee_evk4.rs, ErcReferencePeriod (10 bits)
    # and ErcTdTargetEventRate (22 bits).
    "reference_period_us": (1, (1 << 10) - 1),
    "maximum_events_per_period": (1, (1 << 22) - 1),
    # DAVIS: libcaer, devices/davis.h. The filters' time constants count 250 µs.
    "mask_isolated_tau": (0, 4_095),
    "refractory_period_tau": (0, 4_095),
    "skip_events_every": (0, 255),
    "exposure_us": (0, 4_194_303),
    "frame_interval_us": (0, 8_388_607),
}


class CameraSettings:
    """A camera's configuration and the settings in it. Replaced as a whole, so that any thread may read it."""

    def __init__(self, configuration: Any, bias_bounds: Any, limiter: type | None) -> None:
        """`limiter`: the driver's class of rate limiters, where the camera has one."""
        self.configuration, self._bias_bounds, self._limiter = configuration, bias_bounds, limiter
        self._resting = dict(LIMITER)
        """The limiter's numbers while it is off."""
        self.listed = self._list()

    def change(self, wanted: Mapping[str, int]) -> tuple[Setting, ...]:
        """Take new values in; the settings that were changed. Each must be within the bounds of its setting."""
        for name, value in wanted.items():
            self._put(name, value)
        self.listed = self._list()
        return tuple(setting for setting in self.listed if setting.name in wanted)

    def check(self, camera: str, name: str, value: int) -> None:
        """Raises RecordingError where there is no such setting, or it does not take this value."""
        setting = next((one for one in self.listed if one.name == name), None)
        if setting is None:
            known = ", ".join(one.name for one in self.listed)
            raise RecordingError(f"{camera}: no setting is called {name!r}; there are {known}")
        if not setting.minimum <= value <= setting.maximum:
            raise RecordingError(f"{name} is {value}; this camera takes {setting.minimum} to {setting.maximum}")

    def _put(self, name: str, value: int) -> None:
        group, _, inner = name.partition(".")
        if group != "rate_limiter":
            path = name.split(".") if hasattr(self.configuration, group) else ["biases", name]
            self.configuration = _replaced(self.configuration, path, value)
            return
        assert self._limiter is not None
        if inner:
            self._resting[inner] = value
        is_on = bool(value) if not inner else self.configuration.rate_limiter is not None
        limiter = self._limiter(**self._resting) if is_on else None
        self.configuration = replace(self.configuration, rate_limiter=limiter)

    def _list(self) -> tuple[Setting, ...]:
        found: list[Setting] = []
        for name in OFFERED:
            if name == "rate_limiter" and self._limiter is not None:
                found.append(_switch(name, self.configuration.rate_limiter is not None))
                found += [Setting(f"{name}.{key}", now, *_BOUNDS[key]) for key, now in self._resting.items()]
            elif name == "biases":
                found += self._biases()
            elif hasattr(self.configuration, name):
                found += _settings_of(name, getattr(self.configuration, name))
        return tuple(found)

    def _biases(self) -> list[Setting]:
        found = []
        for bias in fields(self.configuration.biases):
            value, bounds = getattr(self.configuration.biases, bias.name), getattr(self._bias_bounds, bias.name, None)
            if isinstance(value, bool):
                found.append(_switch(bias.name, value))
            elif bounds is not None:
                found.append(Setting(bias.name, int(value), int(bounds.minimum), int(bounds.maximum)))
        return found


def _settings_of(name: str, value: Any) -> list[Setting]:
    if is_dataclass(value):
        return [
            setting
            for entry in fields(value)
            for setting in _settings_of(f"{name}.{entry.name}", getattr(value, entry.name))
        ]
    if isinstance(value, bool):
        return [_switch(name, value)]
    if isinstance(value, Enum):
        members = list(type(value))
        words = tuple(member.name.lower().replace("_", " ") for member in members)
        return [Setting(name, members.index(value), 0, len(members) - 1, words)]
    bounds = _BOUNDS.get(name.rpartition(".")[2])
    return [] if bounds is None else [Setting(name, int(value), *bounds)]


def _switch(name: str, is_on: bool) -> Setting:
    return Setting(name, int(is_on), 0, 1, is_switch=True)


def _replaced(content: Any, path: list[str], value: int) -> Any:
    """The same tree with another value at the end of a path."""
    name, *rest = path
    before = getattr(content, name)
    if rest:
        return replace(content, **{name: _replaced(before, rest, value)})
    after = (
        bool(value) if isinstance(before, bool) else list(type(before))[value] if isinstance(before, Enum) else value
    )
    return replace(content, **{name: after})
