"""A sensor's parameters under v2e's names (Hu, Liu, Delbruck 2021), and cameras whose figures are published."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

from etnet.errors import RecordingError
from etnet.simulation.sensor import SensorTraits


@dataclass(frozen=True, slots=True)
class PixelSettings:
    """One sensor. Thresholds are changes of natural-log intensity; the names are v2e's where v2e has the parameter."""

    pos_thres: float = 0.2
    """Change of natural-log intensity that makes an ON event."""
    neg_thres: float = 0.2
    """The same for an OFF event."""
    sigma_thres: float = 0.0
    """Standard deviation of the pixels' thresholds, in the same unit."""
    cutoff_hz: float = 0.0
    """Bandwidth of a white pixel; darker ones are slower in proportion. 0: no limit."""
    leak_rate_hz: float = 0.0
    """ON events that a pixel gives each second with nothing before it."""
    shot_noise_rate_hz: float = 0.0
    """Noise events of a black pixel each second; a white one gives a quarter."""
    refractory_us: float = 0.0
    """Dead time of a pixel after an event."""
    lag_us: float = 0.0
    """How much later than the frames' stamps the events come."""
    hot_share: float = 0.0
    """Share of pixels that fire by themselves."""
    hot_hz: float = 30.0
    """Their events each second, at most."""
    dark: float = 0.01
    """Dark current: the sensor sees log(intensity + dark), intensity 1 being white."""

    def __post_init__(self) -> None:
        for name in ("pos_thres", "neg_thres"):
            if not 0.01 <= getattr(self, name) <= 5:
                raise RecordingError(f"{name} is {getattr(self, name):g}; it takes 0.01 (many events) to 5 (few)")
        if not 0.0001 <= self.dark <= 1:
            raise RecordingError(f"dark is {self.dark:g}; it takes 0.0001 to 1")
        if not 0 <= self.hot_share <= 1:
            raise RecordingError(f"hot_share is {self.hot_share:g}; it takes a share in 0 … 1")
        rates = "cutoff_hz", "leak_rate_hz", "shot_noise_rate_hz", "hot_hz"
        for name in ("sigma_thres", *rates, "refractory_us", "lag_us"):
            if not 0 <= getattr(self, name) < 1e7:
                raise RecordingError(f"{name} is {getattr(self, name):g}; it takes 0 (switched off) or more")

    @property
    def traits(self) -> SensorTraits:
        """What the pixels are made from."""
        return SensorTraits(
            threshold_on=self.pos_thres,
            threshold_off=self.neg_thres,
            mismatch=self.sigma_thres / (self.pos_thres * self.neg_thres) ** 0.5,
            refractory_us=self.refractory_us,
            leak_hz=self.leak_rate_hz,
            shot_hz=self.shot_noise_rate_hz,
            hot_share=self.hot_share,
            hot_hz=self.hot_hz,
            lag_us=self.lag_us,
            dark=self.dark,
            cutoff_hz=self.cutoff_hz,
        )

    @property
    def as_attributes(self) -> dict[str, float]:
        """Name and value of each parameter, in six digits."""
        return {one.name: float(f"{getattr(self, one.name):.6g}") for one in fields(self)}


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera with its published size and figures. What is not published is 0 or, says `source`, an assumption."""

    name: str
    size: tuple[int, int]
    """Width and height in pixels."""
    pixels: PixelSettings
    source: str


_IDEAL = PixelSettings()
CAMERAS: dict[str, Camera] = {
    camera.name: camera
    for camera in (
        Camera(
            "DAVIS240C",
            (240, 180),
            replace(_IDEAL, pos_thres=0.11, neg_thres=0.11, sigma_thres=0.035, leak_rate_hz=0.1, refractory_us=100),
            "Brandli et al. 2014 (JSSC 49:10): minimum contrast sensitivity 11 %, matching 3.5 %. "
            "Leak of about 0.1 Hz: Nozaki and Delbruck 2017. Dead time: an assumption",
        ),
        Camera(
            "DAVIS346",
            (346, 260),
            replace(_IDEAL, pos_thres=0.2, neg_thres=0.2, sigma_thres=0.03, leak_rate_hz=0.1, refractory_us=500),
            "Taverni et al. 2018 (TCAS-II 65:5) for the sensor; thresholds, spread, leak and dead time: the defaults "
            "of v2e, which Hu et al. 2021 chose for a DAVIS346",
        ),
        Camera(
            "DVXplorer",
            (640, 480),
            replace(_IDEAL, pos_thres=0.14, neg_thres=0.14, refractory_us=200),
            "iniVation, DVXplorer specifications: 640 × 480, nominal contrast sensitivity 13 % (ln 1.13 is 0.12) to "
            "27.5 %; dead time: an assumption",
        ),
        Camera(
            "DVXplorer-Lite",
            (320, 240),
            replace(_IDEAL, pos_thres=0.14, neg_thres=0.14, refractory_us=200),
            "as the DVXplorer, at 320 × 240",
        ),
        Camera(
            "EVK3-HD",
            (1280, 720),
            replace(_IDEAL, pos_thres=0.25, neg_thres=0.25, refractory_us=100),
            "Finateu et al. 2020 (ISSCC 5.10): 1280 × 720; Prophesee states a nominal contrast threshold of 25 %; dead "
            "time: an assumption",
        ),
        Camera(
            "EVK4",
            (1280, 720),
            replace(_IDEAL, pos_thres=0.25, neg_thres=0.25, refractory_us=100),
            "Sony and Prophesee IMX636: 1280 × 720, nominal contrast threshold 25 %; dead time: an assumption",
        ),
    )
}


def camera_named(name: str) -> Camera:
    """The camera of this name, in any case."""
    found = {known.lower(): camera for known, camera in CAMERAS.items()}.get(name.lower())
    if found is None:
        raise RecordingError(f"no camera is called {name!r}; choose from {', '.join(CAMERAS)}")
    return found
