"""The lamps under the corridor band: dark while nothing is wrong, one word and one colour where something is.

The last two always say who flies and how the aircraft is configured, without colour.

Legend:
    row: The signals.
"""

from __future__ import annotations

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from telemetry.view.colours import ACTING, AMBER, BACKGROUND, DIM, FRAME, PANEL, RED
from telemetry.view.plots import MODE_NAMES, PILOT_NAMES, acting_on, mode_of, pilot_of
from telemetry.view.strokes import Colour, LineArt

FLAPPING_HIGH = 6.0
"""Flapping that is told in amber [deg]."""
TORQUE_HIGH = 130_000.0
"""Rated mast torque [in lb]."""
LAMPS = ("FLAPPING", "TORQUE", "POWER", "ON STOP", "PROTECTION", "FAILURE")
"""Words of the lamps, row by row."""

_LEFT, _TOP, _WIDE, _HIGH, _GAP = -156.0, 136.0, 75.0, 14.0, 4.0


def lit(row: FloatArray) -> dict[str, Colour]:
    """The lamps that are on, and their colours."""
    flapping = max(row[COLUMN.flapping_left_deg], row[COLUMN.flapping_right_deg])
    torque = max(row[COLUMN.mast_torque_left_inlb], row[COLUMN.mast_torque_right_inlb])
    wrong: tuple[tuple[str, bool, Colour], ...] = (
        ("FLAPPING", flapping > FLAPPING_HIGH, AMBER),
        ("TORQUE", torque > TORQUE_HIGH, AMBER),
        ("POWER", bool(row[COLUMN.engine_power_shp] > row[COLUMN.engine_power_available_shp]), AMBER),
        ("ON STOP", bool(row[COLUMN.control_on_stop]), RED),
        ("PROTECTION", acting_on(row) > 0, ACTING),
        ("FAILURE", bool(row[COLUMN.failures]), RED),
    )
    return {word: colour for word, on, colour in wrong if on}


def draw_faces(art: LineArt) -> None:
    """Draw them dark.

    Args:
        art: What is drawn on.
    """
    for word in LAMPS:
        _lamp(art, LAMPS.index(word), word, ink=FRAME, ground=PANEL)


def draw(art: LineArt, row: FloatArray) -> None:
    """Draw those that are on, who flies, and how the aircraft is configured.

    Args:
        art: What is drawn on.
    """
    for word, colour in lit(row).items():
        _lamp(art, LAMPS.index(word), word, ink=BACKGROUND, ground=colour)
    for place, word in enumerate((PILOT_NAMES[pilot_of(row)], MODE_NAMES[mode_of(row)]), start=len(LAMPS)):
        _lamp(art, place, word, ink=DIM, ground=None)


def _lamp(art: LineArt, place: int, word: str, *, ink: Colour, ground: Colour | None) -> None:
    left, top = _LEFT + (_WIDE + _GAP) * (place % 4), _TOP + (_HIGH + _GAP) * (place // 4)
    if ground is not None:
        half = 0.5 * _HIGH
        art.line([[left + half, top + half], [left + _WIDE - half, top + half]], ground, radius=half)
    art.text(word, left + 0.5 * _WIDE, top + 0.5 * _HIGH, height=6.6, colour=ink, align="centre", weight=1.2)
