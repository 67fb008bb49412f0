"""Ways to ask the model, and labels."""

from __future__ import annotations

from typing import Any

from rtsim.validation.bench import Bench
from rtsim.validation.check import Measure


def level(quantity: str, airspeed_kt: float, nacelle_deg: float, **rest: Any) -> Measure:
    """Ask a level trim.

    Args:
        quantity: A property of ``bench.Level``.
        airspeed_kt: Airspeed [kn].
        nacelle_deg: Nacelle angle [deg].
        **rest: As of ``Bench.condition``.
    """

    def measure(bench: Bench) -> float:
        return float(getattr(bench.level(airspeed_kt, nacelle_deg, **rest), quantity))

    return measure


def label(value: float, unit: str = "kn") -> str:
    """A condition as the end of a check's name.

    Args:
        value: Its number.
        unit: Its unit.
    """
    return f"{value:g}{unit}".replace(".", "p")
