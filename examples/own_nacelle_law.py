"""A nacelle law of your own: tilts by airspeed along the middle of the conversion corridor.

    python examples/own_nacelle_law.py                                     # from anywhere
    rtsim fly typical_conversion --nacelle own_nacelle_law:MiddleOfTheRoad # in this folder: live, with the view

A nacelle law is a class without arguments whose ``step`` gets sensors and the pilot's command and gives the nacelle
rate [rad/s]; negative is forward, towards airplane mode.
"""

from __future__ import annotations

import numpy as np

import scenarios
from rtsim.command import Command, Sensors
from rtsim.corridor.boundaries import load_corridor
from rtsim.units import deg
from scenarios.files.options import Overrides

FASTEST = deg(7.5)
"""Of the XV-15's own switch [rad/s]."""


class MiddleOfTheRoad:
    """The nacelle angle at which the airspeed is as far from the low side as from the high one."""

    def __init__(self) -> None:
        corridor = load_corridor("design")
        self.angles = np.radians(np.linspace(90.0, 0.0, 91))
        self.speeds = np.maximum.accumulate([float(corridor.centre_speed(angle)) for angle in self.angles])

    def step(self, sensors: Sensors, command: Command, dt: float) -> float:
        """One call.

        Args:
            sensors: What the instruments show.
            command: What the pilot asks for.
            dt: Time to the next call [s].
        """
        wanted = float(np.interp(sensors.airspeed, self.speeds, self.angles))
        return min(max(1.5 * (wanted - sensors.nacelle_angle), -FASTEST), FASTEST)


def main() -> None:
    """Fly the airspeeds of the typical conversion, with the nacelles of its table and with these."""
    for nacelle in ("programme", "own_nacelle_law:MiddleOfTheRoad"):
        flight = scenarios.fly("typical_conversion", speed="max", overrides=Overrides(nacelle=nacelle))
        assert flight.metrics is not None
        margin, flapping = flight.metrics.corridor.worst_margin_kt, flight.metrics.flapping_deg.peak
        print(f"{nacelle:<32} worst margin {margin:4.1f} kn, flapping {flapping:.2f} deg at most,", end=" ")
        print(f"nacelles end at {flight['nacelle_deg'][-1]:.1f} deg")


if __name__ == "__main__":
    main()
