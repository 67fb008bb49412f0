"""Conversion paths as data: (airspeed, nacelle angle) points with the rates of the segments that lead to them.

A path knows no time: the paper's timing rule (:func:`rtsim.programme.timed_programme`) turns it into a programme, each
segment lasting as long as the slower of nacelle rate and acceleration cap needs. Numbers are kept in the units of
scenario files, not SI, so that a path written to a scenario file reads back to the identical programme, bit for bit.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
from collections.abc import Sequence
from dataclasses import dataclass

from rtsim.errors import InputError
from rtsim.programme import NacelleMotion, Programme, Waypoint, timed_programme
from rtsim.units import deg, kt

DEFAULT_ALTITUDE_M = 100.0
"""Altitude at which paths are flown [m]."""
SHORTEST_STEP = 1e-9
"""Two points closer than this in both coordinates are one [kn or deg]."""


@dataclass(frozen=True, slots=True)
class AccelerationCaps:
    """Largest change of airspeed per second, by the nacelle angle at which a segment begins [kn/s].

    The defaults are those of the paper's Table 1: 3 kn/s down to the 50 deg detent, 4 kn/s from there on, 5 kn/s in
    airplane mode (its text says "up to 50 kn" where its table has 50 deg).
    """

    above_detent_kt_s: float = 3.0
    """Where the nacelles stand above ``detent_deg``."""
    below_detent_kt_s: float = 4.0
    """Where they stand at or below it, above the downstop."""
    airplane_kt_s: float = 5.0
    """Where they rest on the downstop."""
    detent_deg: float = 50.0
    """Nacelle angle that separates the first two regions [deg]."""

    def at(self, start_deg: float, end_deg: float) -> float:
        """Cap of a segment [kn/s]: that of its end with the larger nacelle angle, the more careful one.

        Args:
            start_deg: Nacelle angle at the start of the segment [deg].
            end_deg: Nacelle angle at its end [deg].
        """
        angle = max(start_deg, end_deg)
        if angle <= 0.0:
            return self.airplane_kt_s
        return self.below_detent_kt_s if angle <= self.detent_deg else self.above_detent_kt_s

    @classmethod
    def uniform(cls, cap_kt_s: float) -> AccelerationCaps:
        """The same cap everywhere.

        Args:
            cap_kt_s: The cap [kn/s].
        """
        return cls(cap_kt_s, cap_kt_s, cap_kt_s)


TABLE_1_CAPS = AccelerationCaps()
"""Acceleration caps of the paper's Table 1."""


@dataclass(frozen=True, slots=True)
class PathPoint:
    """A point of a path and how fast the segment that leads to it may be flown."""

    airspeed_kt: float
    """Airspeed [kn]."""
    nacelle_deg: float
    """Nacelle angle [deg], 90 helicopter, 0 airplane."""
    acceleration_kt_s: float = 3.0
    """Largest change of airspeed per second on the way here [kn/s]."""
    nacelle_rate_deg_s: float = 3.0
    """Nacelle rate on the way here [deg/s]."""
    hold_s: float = 0.0
    """Time to stay at the point [s]."""


@dataclass(frozen=True, slots=True)
class ConversionPath:
    """A way through the conversion corridor."""

    name: str
    """Short name, lower case with underscores; also the scenario's."""
    title: str
    """One line for people."""
    points: tuple[PathPoint, ...]
    """The points in order; the first is the start, whose rates are not used."""
    description: str = ""
    """Where the path comes from, and the cap at which the nonlinear model stays controlled."""
    nacelle_motion: NacelleMotion = "rate"
    """``rate``: the nacelles move at their rate, then wait (the paper's equation 5); ``spread``: over the segment."""

    def __post_init__(self) -> None:
        """Refuse a path without segments."""
        if len(self.points) < 2:
            raise InputError("needs at least two points", key=f"path {self.name}", value=len(self.points))

    @property
    def converts(self) -> bool:
        """Whether the path leads towards airplane mode; else it is a reconversion."""
        return self.points[-1].nacelle_deg < self.points[0].nacelle_deg

    def programme(self, altitude_m: float = DEFAULT_ALTITUDE_M) -> Programme:
        """The path with its times.

        Args:
            altitude_m: Altitude to hold [m].

        Raises:
            InputError: A point is out of range or a rate is not positive.
        """
        waypoints = [
            Waypoint(
                kt(point.airspeed_kt),
                deg(point.nacelle_deg),
                altitude_m,
                acceleration=kt(point.acceleration_kt_s),
                nacelle_rate=deg(point.nacelle_rate_deg_s),
                hold=point.hold_s,
            )
            for point in self.points
        ]
        return timed_programme(waypoints, nacelle_motion=self.nacelle_motion)

    def reconversion(
        self, *, caps: AccelerationCaps | None = None, nacelle_rate_deg_s: float | None = None, hold_s: float = 8.0
    ) -> ConversionPath:
        """The same path flown backwards.

        Args:
            caps: Caps on the deceleration; None takes 2 kn/s everywhere.
            nacelle_rate_deg_s: Nacelle rate; None keeps that of each segment.
            hold_s: Time to stay at the end, while filters and pilot settle [s].
        """
        caps = AccelerationCaps.uniform(2.0) if caps is None else caps
        backwards = self.points[::-1]
        points = [PathPoint(backwards[0].airspeed_kt, backwards[0].nacelle_deg)]
        for start, end in itertools.pairwise(backwards):
            points.append(
                PathPoint(
                    end.airspeed_kt,
                    end.nacelle_deg,
                    caps.at(start.nacelle_deg, end.nacelle_deg),
                    start.nacelle_rate_deg_s if nacelle_rate_deg_s is None else nacelle_rate_deg_s,
                )
            )
        points[-1] = dataclasses.replace(points[-1], hold_s=hold_s)
        return dataclasses.replace(
            self,
            name=f"{self.name}_reconversion",
            title=f"{self.title}, flown back",
            description=f"The path {self.name} backwards, decelerating within its caps.",
            points=tuple(points),
        )

    def with_rates(self, *, nacelle_rate_deg_s: float, caps: AccelerationCaps, name: str) -> ConversionPath:
        """The same points with one nacelle rate and caps by region.

        Args:
            nacelle_rate_deg_s: Nacelle rate of every segment [deg/s].
            caps: Acceleration caps.
            name: Name of the new path.
        """
        points = [self.points[0]]
        for start, end in itertools.pairwise(self.points):
            points.append(
                dataclasses.replace(
                    end,
                    acceleration_kt_s=caps.at(start.nacelle_deg, end.nacelle_deg),
                    nacelle_rate_deg_s=nacelle_rate_deg_s,
                )
            )
        return dataclasses.replace(self, points=tuple(points), name=name)

    def to_scenario_toml(
        self,
        *,
        flight: dict[str, str | int | float | bool] | None = None,
        altitude_m: float = DEFAULT_ALTITUDE_M,
        expectations: Sequence[tuple[str, str, float | None, float | None]] = (),
    ) -> str:
        """The path as the text of a scenario file that flies the identical programme.

        Args:
            flight: Keys of the ``[flight]`` table, in the layout of ``docs/scenarios.md``.
            altitude_m: Altitude to hold [m].
            expectations: Clauses: name, metric, least and largest value (None: no limit).
        """
        lines = [
            "format = 1",
            f"name = {_text(self.name)}",
            f"title = {_text(self.title)}",
            f"description = {_text(self.description)}",
            "",
        ]
        if flight:
            lines += ["[flight]", *(f"{key} = {_value(value)}" for key, value in flight.items()), ""]
        first = self.points[0]
        lines += [
            "[start]",
            f"airspeed_kt = {_value(first.airspeed_kt)}",
            f"nacelle_deg = {_value(first.nacelle_deg)}",
            f"altitude_m = {_value(altitude_m)}",
            "",
            "[programme]",
            f"nacelle_motion = {_text(self.nacelle_motion)}",
            "points = [",
        ]
        for number, point in enumerate(self.points):
            keys = {"airspeed_kt": point.airspeed_kt, "nacelle_deg": point.nacelle_deg}
            if number:
                keys["acceleration_kt_s"] = point.acceleration_kt_s
                keys["nacelle_rate_deg_s"] = point.nacelle_rate_deg_s
            if point.hold_s:
                keys["hold_s"] = point.hold_s
            lines.append("    { " + ", ".join(f"{key} = {_value(value)}" for key, value in keys.items()) + " },")
        lines.append("]")
        for name, metric, low, high in expectations:
            lines += ["", "[[expect]]", f"name = {_text(name)}", f"metric = {_text(metric)}"]
            lines += [f"{key} = {_value(limit)}" for key, limit in (("min", low), ("max", high)) if limit is not None]
        return "\n".join(lines) + "\n"


def path_through(
    name: str,
    title: str,
    corners: Sequence[tuple[float, float]],
    *,
    nacelle_rate_deg_s: float = 3.0,
    caps: AccelerationCaps = TABLE_1_CAPS,
    hold_s: float = 4.0,
    nacelle_motion: NacelleMotion = "rate",
    description: str = "",
) -> ConversionPath:
    """A path through corners with one nacelle rate and caps by region; corners that repeat the one before are left out.

    Args:
        name: Short name.
        title: One line for people.
        corners: (airspeed [kn], nacelle angle [deg]) of the points.
        nacelle_rate_deg_s: Nacelle rate of every segment [deg/s].
        caps: Acceleration caps.
        hold_s: Time to stay at the last point [s].
        nacelle_motion: See :class:`ConversionPath`.
        description: Where the path comes from.
    """
    points = [PathPoint(float(corners[0][0]), float(corners[0][1]))]
    for airspeed, nacelle in corners[1:]:
        before = points[-1]
        if abs(airspeed - before.airspeed_kt) < SHORTEST_STEP and abs(nacelle - before.nacelle_deg) < SHORTEST_STEP:
            continue
        cap = caps.at(before.nacelle_deg, float(nacelle))
        points.append(PathPoint(float(airspeed), float(nacelle), cap, float(nacelle_rate_deg_s)))
    points[-1] = dataclasses.replace(points[-1], hold_s=hold_s)
    return ConversionPath(name, title, tuple(points), description, nacelle_motion)


def _text(value: str) -> str:
    # A JSON string is a TOML basic string: the escapes agree for everything json.dumps emits in ASCII.
    return json.dumps(value)


def _value(value: str | float | bool) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    return repr(value)
