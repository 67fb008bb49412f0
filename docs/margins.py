"""Writes the table of the lateral loop's margins into docs/six-degrees.md.

After a change of the aircraft, the database or the pilot's lateral half (two minutes):

    python -m docs.margins
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rtsim.analysis.frozen_loop import FrozenCommand
from rtsim.analysis.lateral_loop import Tables, lateral_loop, lateral_tables
from rtsim.lpv.database import Database
from rtsim.lpv.files.storage import load_database
from rtsim.pilot.lateral_plant import HANDS
from rtsim.units import to_deg, to_kt

PAGE = Path(__file__).parent / "six-degrees.md"
BEGIN, END = "<!-- written by python -m docs.margins -->", "<!-- end -->"
LEAST_PHASE_DEG, LEAST_GAIN_DB = 15.0, 3.0
NACELLES = ((85.0, 90.0), (75.0, 82.5), (60.0, 72.5), (30.0, 55.0), (-3.0, 25.0))
AIRSPEEDS = ((-20.0, -2.5), (0.0, 20.0), (25.0, 40.0), (45.0, 60.0), (63.5, 81.0), (84.5, 109.0), (116.0, 150.0),
             (160.0, 180.0), (190.0, 260.0))  # fmt: skip
"""Bands that hold every grid point, ends included [deg] and [kn]."""
WEAKEST = 4
"""How many points are named for each hand and kind of margin."""


@dataclass(frozen=True, slots=True)
class Point:
    """The margins of one frozen loop; a number for each hand."""

    airspeed_kt: float
    """Airspeed [kn]."""
    nacelle_deg: float
    """Nacelle angle [deg]."""
    phase_deg: tuple[float, ...]
    """Phase margins [deg]."""
    gain_db: tuple[float, ...]
    """Gain margins [dB]."""

    @property
    def name(self) -> str:
        """Airspeed and nacelle angle as the page writes them."""
        return f"{round(self.airspeed_kt, 2):g}/{round(self.nacelle_deg, 2):g}"


def margins(*, mid_cells: bool = False, every: int = 1) -> list[Point]:
    """The margins at every valid point of the grid, or in the middle of every valid cell.

    Args:
        mid_cells: Middles of cells instead of grid points.
        every: Each how manieth of them.
    """
    database = load_database()
    tables, valid = lateral_tables(database), database.valid[database.level_layer]
    v, n = database.airspeed, database.nacelle
    if mid_cells:
        valid = valid[:-1, :-1] & valid[1:, :-1] & valid[:-1, 1:] & valid[1:, 1:]
        v, n = 0.5 * (v[1:] + v[:-1]), 0.5 * (n[1:] + n[:-1])
    found, places = [], np.argwhere(valid)[::every]
    for i, j in places:
        found.append(margins_at(database, tables, float(v[i]), float(n[j])))
        _tell(len(found), len(places))
    return found


def margins_at(database: Database, tables: Tables, airspeed: float, nacelle: float) -> Point:
    """The margins of one frozen loop.

    Args:
        database: The aircraft and its pilot.
        tables: Both, prepared.
        airspeed: Airspeed [m/s].
        nacelle: Nacelle angle [rad].
    """
    one = lateral_loop(database, FrozenCommand(airspeed, nacelle), tables=tables).margins()
    phase, gain = (tuple(map(float, values)) for values in (one.phase_margin, one.gain_margin))
    return Point(to_kt(airspeed), to_deg(nacelle), phase, gain)


def page_text(grid: Sequence[Point], middles: Sequence[Point]) -> str:
    """What stands between the marks.

    Args:
        grid: Margins at the grid points.
        middles: Margins in the middles of cells.
    """
    parts = [_summary(grid, middles)]
    for hand, words in enumerate(("Lateral stick", "Pedals")):
        parts.append(f"{words}, least phase margin [deg] / least gain margin [dB] of the band:\n\n{_table(grid, hand)}")
    return "\n\n".join(parts)


def _summary(grid: Sequence[Point], middles: Sequence[Point]) -> str:
    lines = ["| | points | least phase margin, deg at kn/deg | least gain margin, dB at kn/deg | below 15° or 3 dB |",
             "|---|---|---|---|---|"]  # fmt: skip
    for words, points in (("grid points", grid), ("middles of cells", middles)):
        for hand, name in enumerate(HANDS):
            phase = _weakest(points, lambda one, hand=hand: one.phase_deg[hand])  # type: ignore[misc]
            gain = _weakest(points, lambda one, hand=hand: one.gain_db[hand])  # type: ignore[misc]
            short = [
                one for one in points if one.phase_deg[hand] < LEAST_PHASE_DEG or one.gain_db[hand] < LEAST_GAIN_DB
            ]
            named = ", ".join(f"{one.name} ({one.phase_deg[hand]:.1f}, {one.gain_db[hand]:.1f})" for one in short)
            cells = (f"{words}, {name.replace('_', ' ')}", str(len(points)), phase, gain, named or "none")
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _weakest(points: Sequence[Point], of: Callable[[Point], float]) -> str:
    return ", ".join(f"{of(one):.1f} at {one.name}" for one in sorted(points, key=of)[:WEAKEST])


def _table(points: Sequence[Point], hand: int) -> str:
    heads = [f"{low:g} to {high:g} kn" for low, high in AIRSPEEDS]
    lines = ["| nacelle | " + " | ".join(heads) + " |", "|---" * (1 + len(heads)) + "|"]
    for low, high in NACELLES:
        row = [one for one in points if low <= round(one.nacelle_deg, 2) <= high]
        cells = [_cell([one for one in row if a <= round(one.airspeed_kt, 2) <= b], hand) for a, b in AIRSPEEDS]
        lines.append(f"| {high:g}° to {low:g}° | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _cell(points: Sequence[Point], hand: int) -> str:
    if not points:
        return ""
    return f"{min(one.phase_deg[hand] for one in points):.0f} / {min(one.gain_db[hand] for one in points):.1f}"


def main() -> None:
    """Write the table."""
    text = page_text(margins(), margins(mid_cells=True))
    pattern = f"{re.escape(BEGIN)}.*?{re.escape(END)}"
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(re.sub(pattern, lambda _: f"{BEGIN}\n{text}\n{END}", page, flags=re.DOTALL), encoding="utf-8")


def _tell(done: int, of: int) -> None:
    if of > 100 and (done % 25 == 0 or done == of):
        sys.stderr.write(f"\r{done} of {of}   ")


if __name__ == "__main__":
    main()
    sys.stderr.write("\n")
