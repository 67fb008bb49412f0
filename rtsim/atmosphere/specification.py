"""What the air does in a flight, as data: turbulence and discrete gusts. Loads no compiled code."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

from rtsim.errors import InputError
from rtsim.units import KNOT

Severity = Literal["none", "light", "moderate", "severe"]
GustShape = Literal["one-minus-cosine", "build-up", "ramp"]
GustAxes = Literal["earth", "body"]

SEVERITY_WIND: dict[Severity, float] = {
    "none": 0.0,
    "light": 15.0 * KNOT,
    "moderate": 30.0 * KNOT,
    "severe": 45.0 * KNOT,
}
"""Wind at 20 ft by severity [m/s] (MIL-F-8785C figure 9)."""
LARGEST_WIND = 60.0 * KNOT
"""Largest wind at 20 ft [m/s]."""
LARGEST_GUST = 60.0 * KNOT
"""Largest amplitude of a discrete gust [m/s]."""

MINIMUM_SPEED = 30.0 * KNOT
"""Slowest passage through the frozen field [m/s]: in hover it is the wind that carries the turbulence past. The MOCM's
design gusts use the same bound."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Turbulence:
    """Dryden turbulence, MIL-F-8785C. SI."""

    wind_at_20_ft: float
    """Wind at 20 ft, which sets the severity [m/s]; 0 is none. ``SEVERITY_WIND`` holds the named ones."""
    fade_in: float = 2.0
    """Time over which it builds up from nothing [s]: a flight starts trimmed, in calm air."""

    def __post_init__(self) -> None:
        """Refuse what is out of range (:class:`InputError`)."""
        _within("wind_at_20_ft", self.wind_at_20_ft, 0.0, LARGEST_WIND, "m/s")
        _within("fade_in", self.fade_in, 0.0, 60.0, "s")

    @classmethod
    def of_severity(cls, severity: Severity, *, fade_in: float = 2.0) -> Turbulence:
        """Give the turbulence of a named severity.

        Args:
            severity: ``none``, ``light``, ``moderate`` or ``severe``: 0, 15, 30, 45 kn of wind at 20 ft.
            fade_in: Time over which it builds up [s].

        Raises:
            InputError: There is no such severity.
        """
        if severity not in SEVERITY_WIND:
            raise InputError(
                "is not a severity", key="severity", value=severity, allowed=", ".join(SEVERITY_WIND), mend="choose one"
            )
        return cls(wind_at_20_ft=SEVERITY_WIND[severity], fade_in=fade_in)


@dataclass(frozen=True, slots=True, kw_only=True)
class Gust:
    """One discrete gust, the same over the whole aircraft. SI."""

    start: float
    """When it is met [s]."""
    ahead: float = 0.0
    """Amplitude from ahead, a headwind positive; with ``axes="body"`` along body x [m/s]."""
    below: float = 0.0
    """Amplitude from below, an updraft positive; with ``axes="body"`` along body z [m/s]."""
    lateral: float = 0.0
    """Amplitude from the right; with ``axes="body"`` along body y [m/s]."""
    shape: GustShape = "one-minus-cosine"
    """``one-minus-cosine`` rises and falls, ``build-up`` (half a cosine) and ``ramp`` (straight) rise and stay."""
    duration: float | None = None
    """Time from beginning to end of the pulse or of the rise [s]; 0 with ``ramp``: a sharp edge."""
    length: float | None = None
    """The same as a distance flown [m]; one of the two is given."""
    axes: GustAxes = "earth"
    """``earth``: horizontal and vertical, turned into body axes by pitch and bank; ``body``: as given."""

    def __post_init__(self) -> None:
        """Refuse what is out of range or contradicts itself (:class:`InputError`)."""
        _within("start", self.start, 0.0, 36_000.0, "s")
        for name, amplitude in (("ahead", self.ahead), ("below", self.below), ("lateral", self.lateral)):
            _within(name, amplitude, -LARGEST_GUST, LARGEST_GUST, "m/s")
        for name, value, allowed in (
            ("shape", self.shape, get_args(GustShape)),
            ("axes", self.axes, get_args(GustAxes)),
        ):
            if value not in allowed:
                raise InputError("is not known", key=name, value=value, allowed=", ".join(allowed), mend="choose one")
        if (self.duration is None) == (self.length is None):
            raise InputError(
                "needs either a duration or a length", key="gust", mend="give duration in seconds or length in metres"
            )
        smallest = 0.0 if self.shape == "ramp" else 0.01
        if self.duration is not None:
            _within("duration", self.duration, smallest, 3600.0, "s")
        if self.length is not None:
            _within("length", self.length, smallest, 100_000.0, "m")


@dataclass(frozen=True, slots=True, kw_only=True)
class AirSpecification:
    """All that the air does in a flight; the default is calm."""

    turbulence: Turbulence | None = None
    """Turbulence, or None."""
    gusts: tuple[Gust, ...] = ()
    """Discrete gusts, added where they overlap."""
    minimum_speed: float = MINIMUM_SPEED
    """Slowest passage through the frozen field, for turbulence and for gusts given by length [m/s]."""
    lateral: bool = False
    """Turbulence blows from the side, in roll and in yaw too, whenever there is any."""

    def __post_init__(self) -> None:
        """Refuse what is out of range (:class:`InputError`)."""
        _within("minimum_speed", self.minimum_speed, 1.0, 100.0, "m/s")

    @property
    def turbulent(self) -> bool:
        """Whether there is turbulence from the start."""
        return self.turbulence is not None and self.turbulence.wind_at_20_ft > 0.0


def _within(key: str, value: float, low: float, high: float, unit: str) -> None:
    if not (math.isfinite(value) and low <= value <= high):
        raise InputError("is out of range", key=key, value=value, allowed=f"{low:g} to {high:.4g} {unit}")


CALM = AirSpecification()
"""Air that does nothing."""
