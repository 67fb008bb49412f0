"""A pilot and a protection law in Python that fly through the ways that only Python takes."""

from __future__ import annotations

from rtsim.command import Command, Intervention, Margins, Reference, Sensors


class Careful:
    """Slows the nacelles near the corridor's edge and holds the stick back where the nose is high."""

    def step(
        self, sensors: Sensors, command: Command, margins: Margins, dt: float
    ) -> tuple[Command, list[Intervention]]:
        """Limit the command."""
        del dt
        margin = min(margins.low, margins.high)
        share = min(max(margin / 4.0, 0.0), 1.0)
        rate = command.nacelle_rate * share
        stick = command.stick - 0.05 * max(sensors.pitch - 0.2, 0.0)
        found = []
        if rate != command.nacelle_rate:
            found.append(
                Intervention("corridor-low", "nacelle_rate", "limit", command.nacelle_rate, rate, margin, margin / 2.0)
            )
        return Command(stick, command.lever, rate), found


class Steady:
    """Holds the hover by pitch, airspeed and climb rate."""

    def step(self, sensors: Sensors, reference: Reference, dt: float) -> Command:
        """Give the command."""
        del dt
        wanted = 0.03 * (reference.airspeed - sensors.airspeed)
        stick = -1.2 * (-wanted - sensors.pitch) + 1.0 * sensors.pitch_rate
        lever = 0.5 + 0.03 * (reference.altitude - sensors.altitude) - 0.06 * sensors.climb_rate
        return Command(min(max(stick, -1.0), 1.0), min(max(lever, 0.0), 1.0), reference.nacelle_rate)
