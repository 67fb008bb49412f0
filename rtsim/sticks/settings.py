"""How sticks are shaped and what happens when they are silent; changed in flight by parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from rtsim.errors import InputError
from rtsim.units import deg, to_deg


@dataclass(frozen=True, slots=True, kw_only=True)
class StickSettings:
    """Settings of a stick handler. SI and radians."""

    dead_band: float = 0.0
    """Part of half travel around the centre that counts as the centre."""
    expo: float = 0.0
    """0 straight, 1 cubic: softer around the centre, full travel unchanged."""
    scale: float = 1.0
    """Stick and pedals at full deflection, as a part of half travel."""
    detents: bool = False
    """Nacelle switch: True runs to detents (the paper's), False moves while held."""
    nacelle_rate: float = deg(7.5)
    """Nacelle rate of switch and commands; slower near the stops [rad/s]."""
    loss_time: float = 0.5
    """Sticks count as lost after this time without input [s]."""
    blend_time: float = 0.2
    """Time in which the controls pass to sticks that are back [s]."""
    ramp_time: float = 0.3
    """Time in which stick and pedals go to trim when they are lost [s]."""
    trim_rate: float = 0.1
    """Rate of the trim buttons [half travels/s]."""

    def __post_init__(self) -> None:
        for name, (low, high) in _RANGES.items():
            value = getattr(self, name)
            if not (math.isfinite(value) and low <= value <= high):
                raise InputError("is out of range", key=name, value=value, allowed=f"{low:g} to {high:g}")

    def with_parameter(self, name: str, value: float) -> StickSettings:
        """These settings with one MAVLink parameter changed; other parameters change nothing.

        Args:
            name: Name of the parameter (``XV_...``).
            value: Its value, in the unit of the parameter.

        Raises:
            InputError: The value is out of range.
        """
        if name == "XV_NAC_RATE":
            return replace(self, nacelle_rate=deg(value))
        if name == "XV_NAC_MODE":
            return replace(self, detents=value == 1.0)
        field = PARAMETER_FIELDS.get(name)
        return self if field is None else replace(self, **{field: value})  # type: ignore[arg-type]  # all are floats

    def parameters(self) -> dict[str, float]:
        """These settings as MAVLink parameters."""
        values = {name: float(getattr(self, field)) for name, field in PARAMETER_FIELDS.items()}
        return {**values, "XV_NAC_RATE": round(to_deg(self.nacelle_rate), 9), "XV_NAC_MODE": float(self.detents)}


PARAMETER_FIELDS: dict[str, str] = {
    "XV_STK_DEAD": "dead_band",
    "XV_STK_EXPO": "expo",
    "XV_STK_SCALE": "scale",
    "XV_MC_LOSS_T": "loss_time",
    "XV_MC_BLEND_T": "blend_time",
    "XV_MC_RAMP_T": "ramp_time",
    "XV_TRIM_RATE": "trim_rate",
}
"""Setting behind each parameter that is used as it is."""
_RANGES = {
    "dead_band": (0.0, 0.3),
    "expo": (0.0, 1.0),
    "scale": (0.1, 1.0),
    "nacelle_rate": (deg(0.5), deg(7.5) + 1e-12),
    "loss_time": (0.2, 10.0),
    "blend_time": (0.02, 5.0),
    "ramp_time": (0.02, 5.0),
    "trim_rate": (0.01, 1.0),
}


def shaped(settings: StickSettings, deflection: float) -> float:
    """Stick for a deflection: dead band, expo and scale.

    Args:
        settings: The shape.
        deflection: -1 to 1.

    Returns:
        The stick, -1 to 1; odd, monotonic, and continuous at the edge of the dead band.
    """
    size = abs(deflection)
    if size <= settings.dead_band:
        return 0.0
    size = min((size - settings.dead_band) / (1.0 - settings.dead_band), 1.0)
    size = settings.scale * ((1.0 - settings.expo) * size + settings.expo * size**3)
    return math.copysign(size, deflection)
