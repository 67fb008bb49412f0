"""The flight from above, north up, the aircraft in the middle: its track over the ground, its nose, the wind.

Units are those of the drawing: x right (east), y down (south); the ring's radius is ``RING``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from rtsim.units import KNOT
from telemetry.view.colours import DIM, FRAME, GREEN, GRID, TEXT, TRAIL, WHITE, WIND
from telemetry.view.strokes import LineArt

BOUNDS = ((-108.0, 108.0), (-104.0, 104.0))
"""What the view shows: x range, y range."""
RING = 80.0
"""Radius of the ring."""
TRAIL_POINTS = 400
"""Longest track, in points half a second apart."""
FITTING_POINTS = 120
"""So many of the last points are inside the ring."""
PICTURES_PER_DRAWING = 3
"""It is drawn in every third picture only."""
SHOWN_WIND_KT = 1.0
"""Wind that is shown from here on [kn]."""

_LEAST_RADIUS = 50.0
_VECTOR_S = 10.0


class GroundMap:
    """Logs the map to one recording."""

    def __init__(self, recording: Any) -> None:
        """Log what does not move.

        Args:
            recording: The ``rerun.RecordingStream``.
        """
        self._recording = recording
        self._updates = 0
        self._trail: list[tuple[float, float]] = []
        self._trail_time = -math.inf
        recording.log("map/rose", _rose().archetype(0.0), static=True)

    def update(self, row: FloatArray) -> None:
        """Show one row."""
        here = (float(row[COLUMN.north_m]), float(row[COLUMN.east_m]))
        time_s = float(row[COLUMN.time_s])
        if time_s - self._trail_time >= 0.5:
            self._trail_time = time_s
            self._trail = [*self._trail[1 - TRAIL_POINTS :], here]
        if self._updates % PICTURES_PER_DRAWING == 0:
            art = LineArt()
            radius = ring_radius(self._trail, here)
            _draw_track(art, [*self._trail, here], radius)
            _draw_aircraft(art, row, radius)
            art.text(_distance(radius), 0.75 * RING, -0.95 * RING, height=8.0, colour=DIM)
            _draw_wind(art, row)
            self._recording.log("map/now", art.archetype(1.0))
        self._updates += 1


def ring_radius(trail: list[tuple[float, float]], here: tuple[float, float]) -> float:
    """Radius of the ring [m]: 1, 2 or 5 times a power of ten, around the last part of the track.

    Args:
        trail: North and east of the points flown [m].
        here: North and east of the aircraft [m].
    """
    reach = max((math.dist(point, here) for point in trail[-FITTING_POINTS:]), default=0.0)
    reach = max(reach, _LEAST_RADIUS)
    power = 10.0 ** math.floor(math.log10(reach))
    return next(power * step for step in (1.0, 2.0, 5.0, 10.0) if power * step >= reach * (1.0 - 1e-9))


def on_map(north: float, east: float) -> FloatArray:
    """Where a direction points on the map.

    Args:
        north: Its part to the north.
        east: Its part to the east.
    """
    return np.array([east, -north])


def _rose() -> LineArt:
    art = LineArt()
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    for radius, colour in ((RING, FRAME), (0.5 * RING, GRID)):
        art.line(radius * np.stack([np.sin(angle), -np.cos(angle)], 1), colour, radius=-0.8)
    for degrees in range(0, 360, 30):
        outward = _towards(float(degrees))
        art.line([RING * outward, (RING + 4.0) * outward], DIM, radius=-0.8)
        if degrees % 90 == 0:
            x, y = (RING + 14.0) * outward
            art.text("NESW"[degrees // 90], x, y, height=9.0, colour=TEXT, align="centre", weight=1.2)
    return art


def _draw_track(art: LineArt, track: list[tuple[float, float]], radius: float) -> None:
    """The track as far as it is on the map, and the point of departure."""
    here = np.array(track[-1])
    places = np.array([on_map(north, east) for north, east in np.array(track) - here]) * (RING / radius)
    outside = np.flatnonzero(np.hypot(places[:, 0], places[:, 1]) > 1.25 * RING)
    shown = places[outside[-1] + 1 if len(outside) else 0 :]
    if len(shown) > 1:
        art.line(shown, TRAIL, radius=-1.5)
    if not len(outside):
        x, y = places[0]
        art.line([[x - 3.0, y - 3.0], [x + 3.0, y + 3.0]], DIM)
        art.line([[x - 3.0, y + 3.0], [x + 3.0, y - 3.0]], DIM)


def _draw_aircraft(art: LineArt, row: FloatArray, radius: float) -> None:
    """Where it will be in ten seconds, and its plan: wing, body and tail."""
    speed = abs(float(row[COLUMN.ground_speed_kt])) * KNOT
    going = _towards(float(row[COLUMN.track_deg])) * min(speed * _VECTOR_S / radius, 0.95) * RING
    art.line([[0.0, 0.0], going], GREEN, radius=-1.2)
    ahead = _towards(float(row[COLUMN.heading_deg]))
    right = np.array([-ahead[1], ahead[0]])
    for along, half, weight in ((1.0, 10.0, 1.3), (-7.0, 4.0, 1.1)):
        art.line([along * ahead - half * right, along * ahead + half * right], WHITE, radius=weight)
    art.line([7.0 * ahead, -8.0 * ahead], WHITE, radius=1.3)


def _draw_wind(art: LineArt, row: FloatArray) -> None:
    north, east = float(row[COLUMN.wind_north_m_s]), float(row[COLUMN.wind_east_m_s])
    speed = math.hypot(north, east) / KNOT
    if speed < SHOWN_WIND_KT:
        return
    origin = math.degrees(math.atan2(-east, -north)) % 360.0
    art.text(f"{round(origin) % 360:03d}/{speed:.0f} kn", -104.0, -96.0, height=8.0, colour=WIND)
    blown = on_map(north, east) / math.hypot(north, east)
    across = np.array([-blown[1], blown[0]])
    middle, tip = np.array([-88.0, -74.0]), np.array([-88.0, -74.0]) + 12.0 * blown
    art.line([middle - 12.0 * blown, tip], WIND, radius=1.2)
    art.line([tip - 7.0 * blown + 5.0 * across, tip, tip - 7.0 * blown - 5.0 * across], WIND, radius=1.2)


def _towards(course_deg: float) -> FloatArray:
    return on_map(math.cos(math.radians(course_deg)), math.sin(math.radians(course_deg)))


def _distance(metres: float) -> str:
    return f"{metres / 1000.0:g} km" if metres >= 1000.0 else f"{metres:.0f} m"
