"""Protection laws with a planted fault each, to see how ``rtsim break`` finds them.

Each is the law ``full`` until it comes into a region, where it gives up for good. What is broken is known, so what is
found can be judged: see ``docs/breaking.md``. The regions were chosen by how seldom random flights of the campaign
``misuse`` come there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from rtsim.command import Command, Intervention, Margins, Sensors
from rtsim.protection.laws import BuiltInLaw
from rtsim.units import KNOT


@dataclass(frozen=True, slots=True)
class Region:
    """Where and when a law gives up."""

    nacelle_deg: tuple[float, float] = (-math.inf, math.inf)
    """Between these nacelle angles."""
    low_kt: float = -math.inf
    """Nearer than this to the low-speed side, or"""
    high_kt: float = -math.inf
    """nearer than this to the high-speed side."""
    below_kt: float = math.inf
    """Below this airspeed."""
    after_s: float = 0.0
    """After this time."""

    def holds(self, time, airspeed_kt, nacelle_deg, low_kt, high_kt):  # type: ignore[no-untyped-def]
        """Whether the law gives up, at one time or at all of a flight's.

        Args:
            time: Time [s].
            airspeed_kt: Airspeed [kn].
            nacelle_deg: Nacelle angle [deg].
            low_kt: Airspeed above the corridor's low-speed side [kn].
            high_kt: Airspeed below its high-speed side [kn].
        """
        there = (nacelle_deg >= self.nacelle_deg[0]) & (nacelle_deg < self.nacelle_deg[1])
        near = (low_kt < self.low_kt) | (high_kt < self.high_kt)
        return there & near & (airspeed_kt < self.below_kt) & (time > self.after_s)


class _Full:
    """The law ``full`` that gives up."""

    region: ClassVar[Region]

    def __init__(self) -> None:
        self._full = BuiltInLaw("full")
        self._time, self._gone = 0.0, False

    def step(
        self, sensors: Sensors, command: Command, margins: Margins, dt: float
    ) -> tuple[Command, list[Intervention]]:
        """One call.

        Args:
            sensors: What the instruments show.
            command: What the pilot asks for.
            margins: Distances to the corridor's sides.
            dt: Time to the next call [s].
        """
        answer = self._full.step(sensors, command, margins, dt)
        self._time += dt
        nacelle, airspeed = math.degrees(sensors.nacelle_angle), sensors.airspeed / KNOT
        self._gone |= self.region.holds(self._time, airspeed, nacelle, margins.low / KNOT, margins.high / KNOT)
        return (command, []) if self._gone else answer


class LowSpeed(_Full):
    """A wrong branch at low speed."""

    region = Region(below_kt=20.0, low_kt=4.0)


class Hover(_Full):
    """A wrong branch at the lowest speeds."""

    region = Region(nacelle_deg=(80.0, math.inf), low_kt=8.0)


class HighCorner(_Full):
    """A hole in one corner of the corridor."""

    region = Region(nacelle_deg=(70.0, 80.0), high_kt=6.0)


class LowCorner(_Full):
    """A hole in another corner."""

    region = Region(nacelle_deg=(10.0, 20.0), low_kt=4.0)


class Late(_Full):
    """Something that happens only late."""

    region = Region(nacelle_deg=(30.0, 40.0), low_kt=6.0, high_kt=6.0, after_s=30.0)


class LateCorner(_Full):
    """The same in another place, where fewer flights come."""

    region = Region(nacelle_deg=(20.0, 30.0), low_kt=6.0, high_kt=6.0, after_s=30.0)
