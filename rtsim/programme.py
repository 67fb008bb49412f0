"""What a flight is meant to do: airspeed, nacelle angle and altitude as piecewise-linear functions of time.

A programme is either given with its times, or as waypoints that a timing rule turns into times. The rule is that of
the paper's Table 1 (explained in ``docs/scenarios.md``): a segment lasts as long as the slowest of its motions needs,
``dt = max(|nacelle step| / rate, |airspeed step| / acceleration cap, |altitude step| / climb rate)``.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.places import Places
from rtsim.units import deg, kt, to_deg, to_kt

AIRSPEED_RANGE = (kt(-40.0), kt(260.0))
"""Airspeeds a programme may ask for [m/s]: from rearward hover flight to the flaps-up limit on the downstop."""
NACELLE_RANGE = (0.0, deg(90.0))
"""Nacelle angles a programme may ask for [rad]."""
ALTITUDE_RANGE = (-5.0, 10_000.0)
"""Altitudes a programme may ask for [m]; below 0 the pilot presses the wheels onto the ground."""
START_ALTITUDE_RANGE = (0.0, 10_000.0)
"""Altitudes at which a flight may start [m]."""
MAX_NACELLE_RATE = deg(12.0)
"""Fastest nacelle motion that may be assigned [rad/s]; the pilot's switch is slower."""
LARGEST_BANK = deg(60.0)
"""Largest bank a programme may ask for [rad]."""
LARGEST_TURN_RATE = deg(30.0)
"""Fastest turn a programme may ask for [rad/s]."""
LARGEST_LATERAL = kt(35.0)
"""Fastest sideward flight a programme may ask for [m/s]."""
_ROUNDING = 1e-9

TURN = Places("bank", "rate", "heading")
"""What a point asks for: a bank angle (0: straight on), a turn rate, or a heading."""

NacelleMotion = Literal["spread", "rate"]
"""``spread``: linear over the whole segment; ``rate``: at the nacelle rate first, then held."""


LATERAL_ROWS = {"turn_kind": "turn_kind", "turn": "turn_rad", "lateral": "lateral_m_s", "track": "track"}
"""Rows of a programme that straight flights do not have, with their keys in a file."""


@dataclass(frozen=True, slots=True)
class ProgrammePoint:
    """Airspeed [m/s], nacelle angle [rad] and altitude [m] at one instant, or their rates per second."""

    airspeed: float
    nacelle_angle: float
    altitude: float


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A point a flight passes, and how fast the segment that leads to it may be flown. SI and radians."""

    airspeed: float
    """Airspeed at the point [m/s]."""
    nacelle_angle: float
    """Nacelle angle at the point [rad]."""
    altitude: float
    """Altitude at the point [m]."""
    acceleration: float = kt(3.0)
    """Largest change of airspeed per second on the way here [m/s^2]."""
    nacelle_rate: float = deg(3.0)
    """Nacelle rate on the way here [rad/s]."""
    climb_rate: float = 2.0
    """Largest vertical speed on the way here [m/s]."""
    hold: float = 0.0
    """Time to stay at the point once it is reached [s]."""
    turn: tuple[int, float] = (TURN.bank, 0.0)
    """What turning is asked for: one of ``TURN``, and its value [rad, rad/s, rad]."""
    lateral: float = 0.0
    """Airspeed to the right [m/s]; with ``track`` speed over the ground."""
    track: bool = False
    """Whether the line over the ground is held, too."""


@dataclass(frozen=True, slots=True, eq=False)
class Programme:
    """Airspeed, nacelle angle and altitude over time: linear between the points, held after the last."""

    time: FloatArray
    """Times of the points [s], shape (points,), from 0, increasing."""
    airspeed: FloatArray
    """Airspeeds [m/s], shape (points,)."""
    nacelle_angle: FloatArray
    """Nacelle angles [rad], shape (points,)."""
    altitude: FloatArray
    """Altitudes [m], shape (points,)."""
    turn_kind: FloatArray = field(default_factory=lambda: np.zeros(0))
    """What each point asks for, ``TURN``, shape (points,); none: straight on. Towards a point that asks for the same as
    the one before it is linear; else bank and turn rate begin at 0, and a heading is asked for at once."""
    turn: FloatArray = field(default_factory=lambda: np.zeros(0))
    """Its value [rad, rad/s, rad], shape (points,)."""
    lateral: FloatArray = field(default_factory=lambda: np.zeros(0))
    """Airspeeds to the right [m/s], shape (points,); on a track speeds over the ground."""
    track: FloatArray = field(default_factory=lambda: np.zeros(0))
    """1 where the way to the point keeps to its line over the ground, shape (points,)."""

    def __post_init__(self) -> None:
        """Copy the arrays, make them read-only and refuse what cannot be flown (:class:`InputError`)."""
        points = np.size(self.time)
        for name in ("time", "airspeed", "nacelle_angle", "altitude", *LATERAL_ROWS):
            values = np.array(getattr(self, name), dtype=np.float64).reshape(-1)
            if name in LATERAL_ROWS and values.size == 0:
                values = np.zeros(points)
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        _check_times(self.time)
        for name, low, high, to_user, unit in (
            ("airspeed", *AIRSPEED_RANGE, to_kt, "kn"),
            ("nacelle_angle", *NACELLE_RANGE, to_deg, "deg"),
            ("altitude", *ALTITUDE_RANGE, float, "m"),
            ("turn_kind", 0.0, 2.0, float, ""),
            ("lateral", -LARGEST_LATERAL, LARGEST_LATERAL, to_kt, "kn"),
            ("track", 0.0, 1.0, float, ""),
            ("turn", -1e6, 1e6, to_deg, "deg"),
        ):
            values = getattr(self, name)
            if values.shape != self.time.shape:
                raise InputError("needs one value per point in time", key=f"programme {name}", value=len(values))
            bad = ~((values >= low - _ROUNDING) & (values <= high + _ROUNDING))
            if bad.any():
                first = int(np.argmax(bad))
                raise InputError(
                    f"point {first} is out of range",
                    key=f"programme {name}",
                    value=float(to_user(float(values[first]))),
                    allowed=f"{to_user(low):g} to {to_user(high):g} {unit}",
                    mend="choose a value in this range",
                )
        _check_nacelle_rate(self.time, self.nacelle_angle)
        for kind, largest, what in ((TURN.bank, LARGEST_BANK, "bank"), (TURN.rate, LARGEST_TURN_RATE, "turn rate")):
            asked = np.where(self.turn_kind == kind, np.abs(self.turn), 0.0)
            if np.any(asked > largest + _ROUNDING):
                raise InputError(
                    f"point {int(np.argmax(asked))} asks for too much {what}", key="programme turn",
                    value=round(to_deg(float(asked.max())), 3), allowed=f"at most {to_deg(largest):g} deg or deg/s",
                )  # fmt: skip

    @property
    def symmetric(self) -> bool:
        """Whether it asks for no turn and no sideward flight."""
        return not (self.turn.any() or self.turn_kind.any() or self.lateral.any() or self.track.any())

    @classmethod
    def hold(cls, *, airspeed: float, nacelle_angle: float, altitude: float) -> Programme:
        """A programme of one point that is held for ever.

        Args:
            airspeed: Airspeed to hold [m/s].
            nacelle_angle: Nacelle angle to hold [rad].
            altitude: Altitude to hold [m].
        """
        return cls(np.zeros(1), np.array([airspeed]), np.array([nacelle_angle]), np.array([altitude]))

    @property
    def duration(self) -> float:
        """Time of the last point [s]; 0 for a hold."""
        return float(self.time[-1])

    def at(self, time: float) -> ProgrammePoint:
        """What is asked for at a time.

        Args:
            time: Time since the start [s]; before 0 the first point holds, after the end the last.
        """
        return ProgrammePoint(
            float(np.interp(time, self.time, self.airspeed)),
            float(np.interp(time, self.time, self.nacelle_angle)),
            float(np.interp(time, self.time, self.altitude)),
        )

    def rates_at(self, time: float) -> ProgrammePoint:
        """Rates per second from this time on (the slope of the segment that starts here, at a corner).

        Args:
            time: Time since the start [s].
        """
        segment = int(np.searchsorted(self.time, time, side="right")) - 1
        if segment < 0 or segment >= len(self.time) - 1:
            return ProgrammePoint(0.0, 0.0, 0.0)
        span = float(self.time[segment + 1] - self.time[segment])
        change = [
            float(values[segment + 1] - values[segment]) / span
            for values in (self.airspeed, self.nacelle_angle, self.altitude)
        ]
        return ProgrammePoint(*change)

    def starting_at(self, time: float) -> Programme:
        """The rest of this programme from a time on, with its clock starting at 0 there.

        Args:
            time: Where to join [s], from 0 to :attr:`duration`.
        """
        if not 0.0 <= time <= self.duration:
            raise InputError("lies outside the programme", key="time", value=time, allowed=f"0 to {self.duration:g} s")
        later = self.time > time + _ROUNDING
        here = self.at(time)
        return Programme(
            np.concatenate(([0.0], self.time[later] - time)),
            np.concatenate(([here.airspeed], self.airspeed[later])),
            np.concatenate(([here.nacelle_angle], self.nacelle_angle[later])),
            np.concatenate(([here.altitude], self.altitude[later])),
            *(np.concatenate(([row], getattr(self, name)[later])) for name, row in self._lateral_at(time).items()),
        )

    def _lateral_at(self, time: float) -> dict[str, float]:
        """What is asked for beside airspeed, nacelle angle and altitude at a time, row by row."""
        end = int(np.searchsorted(self.time, time, side="left"))
        end = min(end, self.time.size - 1)
        begin = max(end - 1, 0)
        share = 1.0
        if end > begin:
            share = (time - float(self.time[begin])) / float(self.time[end] - self.time[begin])
        kind, goal = float(self.turn_kind[end]), float(self.turn[end])
        start = 0.0 if kind != TURN.heading else goal
        if self.turn_kind[begin] == kind:
            start = float(self.turn[begin])
        lateral = float(self.lateral[begin]) + share * float(self.lateral[end] - self.lateral[begin])
        return {
            "turn_kind": kind,
            "turn": start + share * (goal - start),
            "lateral": lateral,
            "track": float(self.track[end]),
        }

    def raised(self, height: float) -> Programme:
        """The same programme, flown higher or lower.

        Args:
            height: Height added to every altitude [m].
        """
        return replace(self, altitude=self.altitude + height)

    def to_dict(self) -> dict[str, list[float]]:
        """Plain lists (SI) for a file's metadata; :meth:`from_dict` gives the identical programme back."""
        return {
            "time_s": self.time.tolist(),
            "airspeed_m_s": self.airspeed.tolist(),
            "nacelle_angle_rad": self.nacelle_angle.tolist(),
            "altitude_m": self.altitude.tolist(),
            **({} if self.symmetric else {key: getattr(self, name).tolist() for name, key in LATERAL_ROWS.items()}),
        }

    @classmethod
    def from_dict(cls, data: dict[str, list[float]]) -> Programme:
        """Read what :meth:`to_dict` wrote.

        Args:
            data: The four lists, by name.
        """
        names = ("time_s", "airspeed_m_s", "nacelle_angle_rad", "altitude_m")
        missing = [name for name in names if name not in data]
        if missing:
            raise InputError("is missing", key=f"programme {missing[0]}", mend=f"give the lists {', '.join(names)}")
        lateral = {name: np.array(data[key], dtype=np.float64) for name, key in LATERAL_ROWS.items() if key in data}
        return cls(*(np.array(data[name], dtype=np.float64) for name in names), **lateral)


def timed_programme(waypoints: Sequence[Waypoint], *, nacelle_motion: NacelleMotion = "spread") -> Programme:
    """Turn waypoints into times by the paper's rule.

    The first waypoint is the start. Each later one adds a segment as long as the slowest of its motions needs; the
    airspeed and the altitude change linearly over the whole segment.

    Args:
        waypoints: The points in order; the first one's rates are not used, its hold is.
        nacelle_motion: ``spread`` moves the nacelles evenly over the segment (Table 1 read as linear in time),
            ``rate`` moves them at the nacelle rate and then holds.

    Raises:
        InputError: If there is no waypoint, a segment has no length, or a rate is not positive.
    """
    if not waypoints:
        raise InputError("has no points", key="programme points", mend="give at least one point")
    first = waypoints[0]
    rows: list[tuple[float, ...]] = [(0.0, first.airspeed, first.nacelle_angle, first.altitude, *_lateral_of(first))]
    if first.hold > 0.0:
        rows.append((first.hold, *rows[0][1:]))
    for number, (start, end) in enumerate(itertools.pairwise(waypoints), start=1):
        duration, nacelle_time = _segment_time(number, start, end)
        begin = rows[-1][0]
        if nacelle_motion == "rate" and 0.0 < nacelle_time < duration * (1.0 - _ROUNDING):
            share = nacelle_time / duration
            airspeed = start.airspeed + share * (end.airspeed - start.airspeed)
            altitude = start.altitude + share * (end.altitude - start.altitude)
            kind, turn, lateral, track = _lateral_of(end)
            before = start.turn[1] if start.turn[0] == end.turn[0] else 0.0 if kind != TURN.heading else turn
            halfway = (kind, before + share * (turn - before), start.lateral + share * (lateral - start.lateral), track)
            rows.append((begin + nacelle_time, airspeed, end.nacelle_angle, altitude, *halfway))
        if duration > 0.0:
            rows.append((begin + duration, end.airspeed, end.nacelle_angle, end.altitude, *_lateral_of(end)))
        if end.hold > 0.0:
            rows.append((begin + duration + end.hold, end.airspeed, end.nacelle_angle, end.altitude, *_lateral_of(end)))
    return Programme(*np.array(rows).T)


def _lateral_of(point: Waypoint) -> tuple[float, float, float, float]:
    return float(point.turn[0]), point.turn[1], point.lateral, float(point.track)


def _segment_time(number: int, start: Waypoint, end: Waypoint) -> tuple[float, float]:
    """Duration of one segment and of its nacelle motion [s]."""
    times = []
    for name, change, rate in (
        ("nacelle rate", end.nacelle_angle - start.nacelle_angle, end.nacelle_rate),
        ("acceleration", end.airspeed - start.airspeed, end.acceleration),
        ("climb rate", end.altitude - start.altitude, end.climb_rate),
    ):
        if not (rate > 0.0 and np.isfinite(rate)):
            raise InputError(
                f"the {name} must be positive", key=f"programme point {number}", value=rate, mend="give a positive rate"
            )
        times.append(abs(change) / rate)
    duration = max(times)
    if duration == 0.0 and end.hold <= 0.0:
        raise InputError(
            "repeats the point before it without a hold",
            key=f"programme point {number}",
            mend="give it a hold time or leave it out",
        )
    return duration, times[0]


def _check_times(time: FloatArray) -> None:
    """Refuse an empty, unordered or non-finite time axis."""
    if time.size == 0:
        raise InputError("has no points", key="programme", mend="give at least one point")
    if not np.isfinite(time).all():
        raise InputError("has a time that is not a number", key="programme time")
    if time[0] != 0.0:
        raise InputError("the first time must be 0", key="programme time", value=float(time[0]))
    late = np.flatnonzero(np.diff(time) <= 0.0)
    if late.size:
        point = int(late[0]) + 1
        raise InputError(
            f"point {point} is not later than the point before it",
            key="programme time",
            value=float(time[point]),
            allowed=f"more than {float(time[point - 1]):g} s",
            mend="give increasing times",
        )


def _check_nacelle_rate(time: FloatArray, nacelle_angle: FloatArray) -> None:
    """Refuse nacelle motion faster than the conversion actuators."""
    if time.size < 2:
        return
    rates = np.abs(np.diff(nacelle_angle) / np.diff(time))
    fastest = int(np.argmax(rates))
    if rates[fastest] > MAX_NACELLE_RATE * (1.0 + _ROUNDING):
        raise InputError(
            f"the nacelles move too fast on the way to point {fastest + 1}",
            key="programme nacelle_angle",
            value=round(to_deg(float(rates[fastest])), 3),
            allowed=f"at most {to_deg(MAX_NACELLE_RATE):g} deg/s",
            mend="give the segment more time",
        )
