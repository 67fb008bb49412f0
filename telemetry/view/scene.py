"""The three-dimensional view: aircraft, ground, wind and path, in NED metres from the point of departure."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import rerun as rr

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from telemetry.view import cockpit, surroundings
from telemetry.view.aircraft import Aircraft, place_of
from telemetry.view.colours import CYAN, TRAIL, WIND
from telemetry.view.turning import about_z, quaternion

TRAIL_POINTS = 400
"""Longest path shown, in points half a second apart."""
ROSE_RADIUS = 0.85
"""Radius of the compass rose on the ground, in heights of the aircraft above it, so that it looks as large from all."""
LEAST_ROSE = 18.0
"""Its smallest radius [m]."""
SHOWN_WIND = 0.5
"""Wind that is shown from here on [m/s]."""


class Scene:
    """Logs the aircraft and its surroundings to one recording."""

    def __init__(self, recording: Any) -> None:
        """Log everything that does not move by itself.

        Args:
            recording: The ``rerun.RecordingStream``.
        """
        self._recording = recording
        self._trail: list[list[float]] = []
        self._trail_time = -math.inf
        self._kept: dict[str, tuple[float, ...]] = {}
        self._heading = 0.0
        self._static("world", rr.ViewCoordinates.FRD)
        self._static("world/chase", rr.ViewCoordinates.FRD)
        self._static("world/aircraft", rr.ViewCoordinates.FRD)
        self._aircraft = Aircraft(recording)
        self._static("world/aircraft/cockpit", cockpit.frame())
        self._static("world/horizon/sky", surroundings.sky())
        self._static("world/horizon/plain", surroundings.plain())
        self._static("world/horizon/far_hills", surroundings.hills(0))
        self._static("world/horizon/near_hills", surroundings.hills(1))
        for name, part in surroundings.sun().items():
            self._static(f"world/horizon/sun/{name}", part)
        self._static("world/ground/fields", surroundings.fields())
        tree, places = surroundings.trees()
        self._static("world/ground/trees", tree)
        self._static("world/ground/trees", places)
        for name, part in surroundings.runway().items():
            self._static(f"world/runway/{name}", part)
        self._static("world/rose/marks", surroundings.compass_rose())
        self._static(
            "world/rose/height", rr.LineStrips3D([[[0, 0, 0], [0, 0, -1]]], colors=[(*CYAN, 90)], radii=[-0.7])
        )

    def update(self, row: FloatArray, *, trail: bool = True) -> None:
        """Show the aircraft as it is in one row.

        Args:
            trail: The place is part of the path.
        """
        time_s = float(row[COLUMN.time_s])
        position = place_of(row)
        heading = about_z(math.radians(row[COLUMN.heading_deg]))
        self._log("world/chase", rr.Transform3D(translation=position, quaternion=quaternion(heading)))
        self._aircraft.update(row)
        self._move_ground(row, position, departure=trail)
        if trail and time_s - self._trail_time >= 0.5:
            self._trail_time = time_s
            self._trail = [*self._trail[1 - TRAIL_POINTS :], position]
            track = [[north, east, -0.2] for north, east, _ in self._trail]
            self._log(
                "world/trail",
                rr.LineStrips3D([self._trail, track], colors=[TRAIL, (*TRAIL, 110)], radii=[-1.5, -1.0]),
            )

    def _move_ground(self, row: FloatArray, position: list[float], *, departure: bool) -> None:
        """Take horizon, compass rose and wind arrow along; lay the runway along the heading of the departure."""
        if departure and "runway" not in self._kept:
            self._changed("runway")
            self._heading = math.radians(row[COLUMN.heading_deg])
            self._log("world/runway", rr.Transform3D(quaternion=quaternion(about_z(self._heading))))
        north, east, down = position
        cosine, sine = math.cos(self._heading), math.sin(self._heading)
        along, right = (
            surroundings.PATTERN * float(np.round(way / surroundings.PATTERN))
            for way in (cosine * north + sine * east, cosine * east - sine * north)
        )
        if self._changed("ground", self._heading, along, right):
            place = [cosine * along - sine * right, sine * along + cosine * right, 0.0]
            turned = quaternion(about_z(self._heading))
            self._log("world/ground", rr.Transform3D(translation=place, quaternion=turned))
        self._log("world/horizon", rr.Transform3D(translation=[north, east, 0.0]))
        size = max(LEAST_ROSE, -ROSE_RADIUS * down)
        self._log("world/rose", rr.Transform3D(translation=[north, east, 0.0], scale=[size, size, max(-down, 0.01)]))
        wind_north, wind_east = float(row[COLUMN.wind_north_m_s]), float(row[COLUMN.wind_east_m_s])
        if math.hypot(wind_north, wind_east) >= SHOWN_WIND:
            # Past the aircraft's tail fins, as a wind-sock would hang, a second of its way long.
            blown = 0.5 * np.array([wind_north, wind_east, 0.0])
            above = np.array([north, east, down - 6.5])
            self._changed("wind")
            self._log(
                "world/wind",
                rr.Arrows3D(vectors=[blown], origins=[above - 0.5 * blown], colors=[WIND], radii=[0.11]),
            )
        elif self._kept.pop("wind", None) is not None:
            self._log("world/wind", rr.Clear(recursive=False))

    def _changed(self, name: str, *values: float) -> bool:
        """Whether something is elsewhere than when this was last asked."""
        before = self._kept.get(name)
        self._kept[name] = values
        return before != values

    def _log(self, path: str, archetype: Any) -> None:
        self._recording.log(path, archetype)

    def _static(self, path: str, archetype: Any) -> None:
        self._recording.log(path, archetype, static=True)
