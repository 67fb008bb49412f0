"""Protection laws with a planted fault each, to see how ``rtsim break`` finds them.

Each is the law ``full`` but where it does nothing. What is broken is known, so what is found can be judged: see
``docs/breaking.md``.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

from rtsim.command import Command, Intervention, Margins, Sensors
from rtsim.protection.laws import BuiltInLaw

KNOT = 1852.0 / 3600.0


class _Full(ABC):
    """The law ``full`` with a hole."""

    def __init__(self) -> None:
        self._full = BuiltInLaw("full")
        self._time = 0.0

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
        return (command, []) if self._asleep(sensors, margins) else answer

    @abstractmethod
    def _asleep(self, sensors: Sensors, margins: Margins) -> bool:
        """Whether it does nothing."""


class LowSpeed(_Full):
    """A wrong branch at low speed: below 22 kn, near the low-speed side."""

    def _asleep(self, sensors: Sensors, margins: Margins) -> bool:
        return sensors.airspeed < 22.0 * KNOT and margins.low < 5.0 * KNOT


class Corner(_Full):
    """A hole in one corner of the corridor: at the high-speed side, nacelles between 78 and 80 deg."""

    def _asleep(self, sensors: Sensors, margins: Margins) -> bool:
        return 78.0 < math.degrees(sensors.nacelle_angle) < 80.0 and margins.high < 11.0 * KNOT


class Late(_Full):
    """Something that happens only late: after 30 s, nacelles between 52 and 53 deg, near the low-speed side."""

    def _asleep(self, sensors: Sensors, margins: Margins) -> bool:
        late = self._time > 30.0 and margins.low < 9.0 * KNOT
        return late and 52.0 < math.degrees(sensors.nacelle_angle) < 53.0
