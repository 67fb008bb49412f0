"""A pilot of your own: hovers in gusts by sticks, lever and pedals.

    python examples/own_pilot.py                                 # from anywhere
    rtsim fly hover --pilot own_pilot:Hoverer                    # in this folder: live, with the view

A pilot is a class without arguments whose ``step`` gets sensors and reference, SI and radians, in every frame, and
gives a ``Command``. Signs: stick forward, lateral stick right and pedal right are positive, and so are nose up, bank
right and nose right.
"""

from __future__ import annotations

import math

import scenarios
from rtsim.command import Command, Reference, Sensors
from scenarios.files.options import Overrides


class Hoverer:
    """Leans against the speed that is not wanted, and holds height by power and heading by pedal."""

    def __init__(self) -> None:
        self.lever = 0.72
        """About the power of a hover; learned while flying."""

    def step(self, sensors: Sensors, reference: Reference, dt: float) -> Command:
        """One frame.

        Args:
            sensors: What the instruments show.
            reference: What the flight is meant to do now.
            dt: Length of the frame [s].
        """
        pitch = -0.02 * (reference.airspeed - sensors.airspeed)  # nose down to go faster
        bank = 0.02 * (reference.lateral_velocity - sensors.lateral_velocity)
        turn = math.remainder(reference.heading - sensors.heading, math.tau)  # the short way round
        climb = 0.2 * (reference.altitude - sensors.altitude) - sensors.climb_rate
        self.lever += 0.02 * climb * dt
        return Command(
            stick=1.5 * (sensors.pitch - pitch) + 1.5 * sensors.pitch_rate,
            lever=self.lever + 0.05 * climb,
            nacelle_rate=reference.nacelle_rate,
            lateral_stick=1.5 * (bank - sensors.bank) - 1.0 * sensors.roll_rate,
            pedal=1.0 * turn - 1.0 * sensors.yaw_rate,
        )


def main() -> None:
    """Hover for 15 s in light gusts from all sides and say how well."""
    gusts = Overrides(pilot="own_pilot:Hoverer", turbulence="light", lateral_turbulence=True, duration=15.0)
    flight = scenarios.fly("hover", speed="max", overrides=gusts)
    height = abs(flight["altitude_m"] - 100.0).max()
    print(f"{flight.end_reason}: height within {height:.1f} m, bank within {abs(flight['bank_deg']).max():.1f} deg,")
    print(f"ends {math.hypot(flight['north_m'][-1], flight['east_m'][-1]):.0f} m from where it began")


if __name__ == "__main__":
    main()
