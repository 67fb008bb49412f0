"""Writes the tables of handling numbers into docs/aids.md.

After a change of the aircraft or of the aids:

    python -m docs.handling
"""

from __future__ import annotations

import math
import re
from pathlib import Path

from rtsim.analysis.handling import Response, handling, lateral_handling
from rtsim.analysis.handling_levels import bandwidth_level, dutch_roll_level, roll_mode_level, spiral_level
from rtsim.choices import AidName
from rtsim.lpv.aircraft import load_aircraft
from rtsim.units import deg, kt

PAGE = Path(__file__).parent / "aids.md"
BEGIN, END = "<!-- written by python -m docs.handling -->", "<!-- end -->"
PITCH_CONDITIONS = ((0, 90), (20, 90), (40, 82), (60, 75), (80, 75), (105, 50), (130, 25), (170, 0))
CONDITIONS = ((0, 90), (20, 90), (40, 90), (60, 75), (80, 75), (100, 60), (120, 30), (170, 0))
STABILITY: tuple[AidName, ...] = ("rate_damping", "attitude_retention", "trim_bias")
PITCH_AIDS: dict[str, tuple[AidName, ...]] = {
    "bare": (),
    "rate damping": ("rate_damping",),
    "+ attitude retention, bias": STABILITY,
    "+ altitude and airspeed hold": (*STABILITY, "altitude_hold", "airspeed_hold"),
}
DAMPED: tuple[AidName, ...] = ("roll_damping", "yaw_damping")
AIDS: dict[str, tuple[AidName, ...]] = {
    "bare": (),
    "damped": DAMPED,
    "held": (*DAMPED, "bank_retention", "heading_hold", "turn_coordination"),
}


def pitch_table() -> str:
    """Roots and pitch bandwidth with each layer of aids."""
    aircraft = load_aircraft()
    lines = ["| condition | " + " | ".join(PITCH_AIDS) + " |", "|---" * (1 + len(PITCH_AIDS)) + "|"]
    for airspeed, nacelle in PITCH_CONDITIONS:
        cells = []
        for aids in PITCH_AIDS.values():
            found = handling(aircraft, airspeed=kt(airspeed), nacelle=deg(nacelle), aids=aids)
            level = bandwidth_level("pitch", found.pitch)
            cells.append(f"{found.rightmost:.2f} / {_pair(found.oscillation)} / {found.pitch.bandwidth:.2f} ({level})")
        lines.append(f"| {airspeed} kn, {nacelle}° | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def lateral_table() -> str:
    """Bandwidths, Dutch roll, roll mode and spiral, each with its level."""
    aircraft = load_aircraft()
    heads = ("condition", "aids", "roll", "yaw", "oscillation", "roll mode, s", "spiral, 1/s", "rightmost")
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    for airspeed, nacelle in CONDITIONS:
        for words, aids in AIDS.items():
            found = lateral_handling(aircraft, airspeed=kt(airspeed), nacelle=deg(nacelle), aids=aids)
            cells = (
                f"{airspeed} kn, {nacelle}°",
                words,
                f"{_response(found.roll)} ({bandwidth_level('roll', found.roll)})",
                f"{_response(found.yaw)} ({bandwidth_level('yaw', found.yaw)})",
                f"{_pair(found.dutch_roll)} ({dutch_roll_level(found.dutch_roll)})",
                _real(-1.0 / found.roll_mode, roll_mode_level(found.roll_mode)),
                _real(found.spiral, spiral_level(found.spiral)),
                f"{found.rightmost:.2f}",
            )
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _response(response: Response) -> str:
    return f"{response.bandwidth:.2f}, {response.phase_delay:.2f}"


def _pair(root: complex) -> str:
    frequency = abs(root)
    return f"{frequency:.2f}, {-root.real / frequency:.2f}" if frequency else "none"


def _real(value: float, level: int) -> str:
    return "-" if math.isnan(value) else f"{value:.2f} ({level})"


def main() -> None:
    """Write the tables."""
    tables = iter((pitch_table(), lateral_table()))
    pattern = f"{re.escape(BEGIN)}.*?{re.escape(END)}"
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(
        re.sub(pattern, lambda _: f"{BEGIN}\n{next(tables)}\n{END}", text, flags=re.DOTALL), encoding="utf-8"
    )


if __name__ == "__main__":
    main()
