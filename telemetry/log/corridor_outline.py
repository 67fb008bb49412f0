"""The conversion corridor as plain arrays, for pictures; the corridor itself lives in ``rtsim.corridor``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rtsim.errors import InputError

LINES = ("low", "high", "centre", "turn_low", "turn_high")
"""The lines of an outline, in the order of its fields."""


@dataclass(frozen=True, slots=True)
class CorridorOutline:
    """Two boundaries and the centre line, each a polyline of equally many nacelle angles [deg] and airspeeds [kn]."""

    name: str
    """Name of the corridor, ``design`` or ``flight``."""
    low_nacelle_deg: tuple[float, ...]
    """Nacelle angles of the low-speed boundary's corners."""
    low_kt: tuple[float, ...]
    """Airspeeds of the low-speed boundary's corners."""
    high_nacelle_deg: tuple[float, ...]
    """Nacelle angles of the high-speed boundary's corners."""
    high_kt: tuple[float, ...]
    """Airspeeds of the high-speed boundary's corners."""
    centre_nacelle_deg: tuple[float, ...] = ()
    """Nacelle angles of the centre line's corners."""
    centre_kt: tuple[float, ...] = ()
    """Airspeeds of the centre line's corners."""
    turn_low_nacelle_deg: tuple[float, ...] = ()
    """Nacelle angles at which a turn moves the low-speed side."""
    turn_low_kt: tuple[float, ...] = ()
    """By how much, for each unit of load factor above 1."""
    turn_high_nacelle_deg: tuple[float, ...] = ()
    """The same of the high-speed side off the downstop."""
    turn_high_kt: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Refuse lines whose two coordinates differ in number."""
        for line in LINES:
            if len(getattr(self, f"{line}_nacelle_deg")) != len(getattr(self, f"{line}_kt")):
                raise InputError("a corridor line needs as many angles as airspeeds", key=line)

    @classmethod
    def from_lines(
        cls,
        name: str,
        *,
        low: Sequence[Sequence[float]],
        high: Sequence[Sequence[float]],
        centre: Sequence[Sequence[float]] = ((), ()),
        turn_low: Sequence[Sequence[float]] = ((), ()),
        turn_high: Sequence[Sequence[float]] = ((), ()),
    ) -> CorridorOutline:
        """Compose an outline from (nacelle angles [deg], airspeeds [kn]) pairs.

        Args:
            name: Name of the corridor.
            low: Low-speed boundary.
            high: High-speed boundary.
            centre: Centre line; empty where there is none.
            turn_low: What a turn adds to the low-speed side for each unit of load factor above 1.
            turn_high: The same of the high-speed side.
        """
        pairs = (low, high, centre, turn_low, turn_high)
        return cls(name, *(tuple(float(value) for value in line) for pair in pairs for line in pair))

    def turned(self, side: str, load_factor: float) -> tuple[list[float], list[float]]:
        """One side in a turn: nacelle angles [deg] and airspeeds [kn]; nothing where a turn moves it nowhere.

        Args:
            side: ``low`` or ``high``.
            load_factor: That of the turn.
        """
        nacelle, moved = getattr(self, f"turn_{side}_nacelle_deg"), getattr(self, f"turn_{side}_kt")
        corners = sorted(zip(getattr(self, f"{side}_nacelle_deg"), getattr(self, f"{side}_kt"), strict=True))
        if not nacelle:
            return [], []
        level = np.interp(nacelle, *np.array(corners).T)
        return list(nacelle), (level + (load_factor - 1.0) * np.array(moved)).tolist()

    def to_dict(self) -> dict[str, Any]:
        """As JSON values."""
        return {key: getattr(self, key) for key in self.__dataclass_fields__}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> CorridorOutline:
        """Read back what ``to_dict`` gave, also after JSON.

        Args:
            values: The entries by field name.
        """
        lines: dict[str, Any] = {key: value if key == "name" else tuple(value) for key, value in values.items()}
        return cls(**lines)
