"""A protection law of your own: stops the nacelles before they leave the conversion corridor.

    python examples/own_protection_law.py                                              # from anywhere
    rtsim test own_protection_law.toml --protection own_protection_law:StopTheNacelles # in this folder

A protection law is a class without arguments whose ``step`` gets sensors, command and margins 50 times a second, and
gives the command back, changed or not, with its reasons. ``own_protection_law.toml`` says what it is tested against.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import scenarios
from rtsim.command import Command, Intervention, Margins, Sensors
from scenarios.verdicts.tester import Tester

ENOUGH = 0.1
"""Nacelle travel that is left before the boundary [rad]."""


class StopTheNacelles:
    """Lets the nacelles tilt forward while there is travel left."""

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
        if command.nacelle_rate >= 0.0 or margins.nacelle_forward > ENOUGH:
            return command, []
        why = Intervention("stall_attitude", "nacelle_rate", "limit", command.nacelle_rate, 0.0, margins.low, 2.0)
        return replace(command, nacelle_rate=0.0), [why]


def main() -> None:
    """Test the law, and no law at all, and say what is found."""
    scenario = scenarios.load_scenario(Path(__file__).with_suffix(".toml"))
    for law in ("off", "own_protection_law:StopTheNacelles"):
        case = Tester(law=law).run(scenario)
        print(f"{law}: {case.verdict}, {case.metrics['depth_kt']:.1f} kn outside the corridor at the deepest")
        for finding in case.failures:
            print(f"    {finding.name}: {finding.sentence}")


if __name__ == "__main__":
    main()
