"""The conversion corridor as a picture: Rerun has no plot of one signal over another, so it is drawn.

One knot is one unit to the right, one degree of nacelle angle is 2.7 units up; helicopter mode is at the top.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from telemetry.log.corridor_outline import CorridorOutline
from telemetry.view.colours import CYAN, DIM, FRAME, GRID, HIGH_SIDE, LEVELS, LOW_SIDE, TEXT, TRAIL, WHITE
from telemetry.view.strokes import Align, Colour, LineArt, text_width

UNITS_PER_DEGREE = 2.7
"""Vertical scale."""
SLOWEST_KT, FASTEST_KT = -40.0, 200.0
"""Airspeeds at the left and right edge."""
HIGHEST_DEG = 95.0
"""Nacelle angle at the upper edge."""
BOUNDS = ((-72.0, 212.0), (-20.0, 292.0))
"""What the view shows: x range, y range."""
TURN_STEP = 0.04
"""Steps of load factor in which the sides of a turn are drawn: 2 kn at most."""
TRAIL_POINTS = 400
"""Longest trail, in points half a second apart."""

_MARGIN_HEIGHT = 14.0


def height_of(nacelle_deg: float) -> float:
    """Vertical place of a nacelle angle.

    Args:
        nacelle_deg: Nacelle angle [deg].
    """
    return (HIGHEST_DEG - nacelle_deg) * UNITS_PER_DEGREE


class CorridorPlot:
    """Logs the corridor and the aircraft's place in it to one recording."""

    def __init__(self, recording: Any, outline: CorridorOutline | None) -> None:
        """Log axes and boundaries.

        Args:
            recording: The ``rerun.RecordingStream``.
            outline: The corridor in force; None draws axes only.
        """
        self._recording = recording
        self._updates = 0
        self._trail: list[list[float]] = []
        self._trail_time = -math.inf
        self._outline, self._turn = outline, 1.0
        axes = LineArt()
        if outline is not None:
            _fill_inside(axes, outline)
        _draw_axes(axes)
        if outline is not None:
            _draw_boundaries(axes, outline)
        recording.log("corridor/static", axes.archetype(0.0), static=True)

    def update(self, row: FloatArray) -> None:
        """Show the point, its margins and its trail."""
        speed, nacelle = float(row[COLUMN.airspeed_kt]), float(row[COLUMN.nacelle_deg])
        if self._updates % 2 == 0:
            margins = LineArt()
            self._draw_margins(margins, row)
            self._recording.log("corridor/margins", margins.archetype(2.5))
            self._show_turn(float(row[COLUMN.bank_deg]))
        self._updates += 1
        art = LineArt()
        point_x, point_y = min(max(speed, SLOWEST_KT), FASTEST_KT), height_of(nacelle)
        colour = LEVELS[level_of(row)]
        target = [float(row[COLUMN.airspeed_reference_kt]), height_of(float(row[COLUMN.nacelle_reference_deg]))]
        art.line(_circle(target, 6.5), CYAN, radius=-1.2)
        art.line(_circle([point_x, point_y], 2.0), colour, radius=2.2)
        art.line(_circle([point_x, point_y], 5.0), WHITE, radius=-1.2)
        self._recording.log("corridor/now", art.archetype(3.0))
        time_s = float(row[COLUMN.time_s])
        if time_s - self._trail_time >= 0.5:
            self._trail_time = time_s
            self._trail = [*self._trail[1 - TRAIL_POINTS :], [point_x, point_y]]
            if len(self._trail) > 1:
                trail = LineArt()
                trail.line(self._trail, TRAIL, radius=-1.4)
                self._recording.log("corridor/trail", trail.archetype(2.0))

    def _show_turn(self, bank_deg: float) -> None:
        """Dashed sides where a turn has moved them, in steps of load factor that the eye can tell apart."""
        load = round(1.0 / math.cos(math.radians(min(abs(bank_deg), 60.0))) / TURN_STEP) * TURN_STEP
        if self._outline is None or load == self._turn:
            return
        self._turn = load
        art = LineArt()
        for side, colour in (("low", LOW_SIDE), ("high", HIGH_SIDE)) if load > 1.0 else ():
            nacelles, speeds = self._outline.turned(side, load)
            line = _place(tuple(nacelles), tuple(speeds)) if nacelles else np.zeros((0, 2))
            for start, end in itertools.pairwise(line):
                _dash(art, start, end, colour, radius=-1.6)
        self._recording.log("corridor/turn", art.archetype(1.0))

    @staticmethod
    def _draw_margins(art: LineArt, row: FloatArray) -> None:
        """A level line from the point to each boundary, with the number of knots on its free side."""
        speed, y = float(row[COLUMN.airspeed_kt]), height_of(float(row[COLUMN.nacelle_deg]))
        for margin, direction, colour in (
            (float(row[COLUMN.margin_low_kt]), -1.0, LOW_SIDE),
            (float(row[COLUMN.margin_high_kt]), 1.0, HIGH_SIDE),
        ):
            end = min(max(speed + direction * margin, SLOWEST_KT), FASTEST_KT)
            art.line([[speed, y], [end, y]], colour, radius=-1.2)
            art.line([[end, y - 3.0], [end, y + 3.0]], colour, radius=-1.4)
            above = y - 13.0 if y > 30.0 else y + 14.0
            words = f"{margin:+.0f}"
            half = 0.5 * text_width(words, _MARGIN_HEIGHT) + 5.0
            # Between point and boundary if there is room, else beyond the boundary.
            away = margin + half if 0.0 <= margin < 2.0 * half else half
            art.text(
                words, speed + direction * away, above, height=_MARGIN_HEIGHT, colour=colour, align="centre", weight=1.2
            )


def level_of(row: FloatArray) -> int:
    """Corridor level of a row as an index, 0 clear to 3 exceedance."""
    level = row[COLUMN.corridor_level]
    return int(level) if 0.0 <= level <= 3.0 else 0


def _circle(centre: list[float], radius: float) -> FloatArray:
    angle = np.linspace(0.0, 2.0 * np.pi, 25)
    return np.array(centre) + radius * np.stack([np.cos(angle), np.sin(angle)], 1)


def _draw_axes(art: LineArt) -> None:
    top, bottom = height_of(HIGHEST_DEG), height_of(0.0)
    for speed in np.arange(SLOWEST_KT, FASTEST_KT + 1.0, 20.0):
        strong = speed == 0.0
        art.line([[speed, top], [speed, bottom]], FRAME if strong else GRID, radius=-0.8 if strong else -0.4)
        if speed % 40.0 == 0.0:
            art.text(f"{speed:.0f}", speed, bottom + 10.0, height=9.0, colour=DIM, align="centre")
    for angle in (0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0):
        y = height_of(angle)
        art.line([[SLOWEST_KT, y], [FASTEST_KT, y]], GRID, radius=-0.4)
        art.text(f"{angle:.0f}", SLOWEST_KT - 5.0, y, height=9.0, colour=DIM, align="right")
    art.box(SLOWEST_KT, top, FASTEST_KT, bottom, colour=FRAME, radius=-0.8)
    art.text("airspeed kn", FASTEST_KT, bottom + 25.0, height=9.0, colour=TEXT, align="right")
    art.text("nacelle\N{DEGREE SIGN}", SLOWEST_KT - 30.0, top - 11.0, height=9.0, colour=TEXT)


def _fill_inside(art: LineArt, outline: CorridorOutline) -> None:
    """Tint the inside, one level strip per degree."""
    low = np.argsort(outline.low_nacelle_deg), outline.low_nacelle_deg, outline.low_kt
    high = np.argsort(outline.high_nacelle_deg), outline.high_nacelle_deg, outline.high_kt
    for angle in np.arange(0.5, HIGHEST_DEG, 1.0):
        edges = [np.interp(angle, np.array(x)[order], np.array(y)[order]) for order, x, y in (low, high)]
        left, right = max(edges[0], SLOWEST_KT) + 1.0, min(edges[1], FASTEST_KT) - 1.0
        if right > left:
            y = height_of(float(angle))
            art.line([[left, y], [right, y]], (20, 38, 34), radius=0.5 * UNITS_PER_DEGREE + 0.05)


def _draw_boundaries(art: LineArt, outline: CorridorOutline) -> None:
    if outline.centre_kt:
        centre = _place(outline.centre_nacelle_deg, outline.centre_kt)
        for start in range(len(centre) - 1):
            _dash(art, centre[start], centre[start + 1])
    for nacelles, speeds, colour, words in (
        (outline.low_nacelle_deg, outline.low_kt, LOW_SIDE, "too slow"),
        (outline.high_nacelle_deg, outline.high_kt, HIGH_SIDE, "fast"),
    ):
        line = _place(nacelles, speeds)
        art.line(line, colour, radius=-2.0)
        order = np.argsort(nacelles)
        place = float(np.interp(14.0, np.array(nacelles)[order], np.array(speeds)[order]))
        align: Align = "right" if colour == LOW_SIDE else "left"
        shift = -6.0 if colour == LOW_SIDE else 4.0
        height = 10.0 if colour == LOW_SIDE else 7.0
        art.text(words, place + shift, height_of(14.0), height=height, colour=colour, align=align)


def _place(nacelles: tuple[float, ...], speeds: tuple[float, ...]) -> FloatArray:
    """Points of the picture for a line, inside the frame."""
    points = np.array([[speed, height_of(nacelle)] for nacelle, speed in zip(nacelles, speeds, strict=True)])
    points[:, 0] = np.clip(points[:, 0], SLOWEST_KT, FASTEST_KT)
    points[:, 1] = np.clip(points[:, 1], height_of(HIGHEST_DEG), height_of(0.0))
    return points


def _dash(art: LineArt, start: FloatArray, end: FloatArray, colour: Colour = DIM, radius: float = -0.7) -> None:
    """Dashes of three units between two points."""
    length = float(np.hypot(*(end - start)))
    for begin in np.arange(0.0, length, 6.0):
        pair = [start + (end - start) * min(1.0, at / length) for at in (begin, begin + 3.0)]
        art.line(np.array(pair), colour, radius=radius)
