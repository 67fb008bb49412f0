"""The conversion corridor as plain arrays, for pictures; the corridor itself lives in ``rtsim.corridor``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rtsim.errors import InputError


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

    def __post_init__(self) -> None:
        """Refuse lines whose two coordinates differ in number."""
        for line in ("low", "high", "centre"):
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
    ) -> CorridorOutline:
        """Compose an outline from (nacelle angles [deg], airspeeds [kn]) pairs.

        Args:
            name: Name of the corridor.
            low: Low-speed boundary.
            high: High-speed boundary.
            centre: Centre line; empty where there is none.
        """
        lines = [tuple(float(value) for value in line) for pair in (low, high, centre) for line in pair]
        return cls(name, *lines)

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
