"""The three-dimensional view: aircraft, rotors, ground and path, in NED metres from the point of departure."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import rerun as rr

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from telemetry.view import airframe
from telemetry.view.colours import CYAN, LEFT_ROTOR, RIGHT_ROTOR, TRAIL

SHOWN_TURNS_PER_SECOND = 0.45
"""Blades are shown this slowly: at 30 pictures a second 589 rpm would look like noise."""
TRAIL_POINTS = 400
"""Longest path shown, in points half a second apart."""
DISC_OPACITY = 70
"""Opacity of the rotor discs, 0 to 255."""
GROUND_STEP = 50.0
"""Spacing of the ground's grid [m]."""
SIDES = (("left", -1.0, LEFT_ROTOR), ("right", 1.0, RIGHT_ROTOR))
"""Name, sign of y and rotor colour of each side."""

_RUNWAY_LENGTH = 20_000.0
_SNAP = 500.0


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
        self._static("world", rr.ViewCoordinates.FRD)
        self._static("world/chase", rr.ViewCoordinates.FRD)
        for name, mesh in (("body", airframe.fuselage()), ("wing", airframe.wing()), ("tail", airframe.tail())):
            self._static(f"world/aircraft/{name}", _mesh(mesh))
        for name, side, colour in SIDES:
            self._log_static_rotor(f"world/aircraft/nacelle_{name}", side, colour)
        self._log_ground()

    def update(self, row: FloatArray, *, trail: bool = True) -> None:
        """Show the aircraft as it is in one row.

        Args:
            trail: The place is part of the path.
        """
        time_s, nacelle = float(row[COLUMN.time_s]), math.radians(row[COLUMN.nacelle_deg])
        position = [float(row[COLUMN.distance_m]), 0.0, -float(row[COLUMN.altitude_m])]
        pitch = math.radians(row[COLUMN.pitch_deg])
        self._log("world/chase", rr.Transform3D(translation=position))
        self._log("world/aircraft", rr.Transform3D(translation=position, quaternion=_quaternion(_about_y(pitch))))
        forward = math.radians(row[COLUMN.longitudinal_flapping_deg])
        sideways = math.radians(row[COLUMN.lateral_flapping_deg])
        azimuth = 2.0 * math.pi * ((SHOWN_TURNS_PER_SECOND * time_s) % 1.0)
        for name, side, _ in SIDES:
            path = f"world/aircraft/nacelle_{name}"
            pivot = airframe.PIVOT * [1.0, side, 1.0]
            self._log(path, rr.Transform3D(translation=pivot, quaternion=_quaternion(_about_y(nacelle))))
            # Positive flapping tilts the disc from the mast (+x) to what is ahead in helicopter mode (+z).
            hub = _product(_about_y(-forward), _about_z(side * sideways))
            self._log(
                f"{path}/hub", rr.Transform3D(translation=[airframe.MAST_LENGTH, 0.0, 0.0], quaternion=_quaternion(hub))
            )
            self._log(f"{path}/hub/blades", rr.Transform3D(quaternion=_quaternion(_about_x(-side * azimuth))))
        snapped = _SNAP * math.floor(position[0] / _SNAP)
        self._log("world/ground", rr.Transform3D(translation=[snapped, 0.0, 0.0]))
        self._log(
            "world/height", rr.LineStrips3D([[position, [position[0], 0.0, 0.0]]], colors=[(*CYAN, 90)], radii=[-0.7])
        )
        if trail and time_s - self._trail_time >= 0.5:
            self._trail_time = time_s
            self._trail = [*self._trail[1 - TRAIL_POINTS :], position]
            self._log("world/trail", rr.LineStrips3D([self._trail], colors=[TRAIL], radii=[-1.5]))

    def _log_static_rotor(self, path: str, side: float, colour: airframe.Colour) -> None:
        self._static(f"{path}/pod", _mesh(airframe.nacelle()))
        self._static(f"{path}/hub/disc", _glass(airframe.disc(colour), DISC_OPACITY))
        self._static(f"{path}/hub/rim", rr.LineStrips3D([airframe.circle(96)], colors=[colour], radii=[0.035]))
        self._static(f"{path}/hub/blades", _mesh(airframe.blades(side)))
        # A thin ring square to the mast: the distance of the rim from it is the flapping.
        square = airframe.circle(96) + np.array([airframe.MAST_LENGTH, 0.0, 0.0])
        self._static(f"{path}/square", rr.LineStrips3D([square], colors=[(220, 225, 232, 120)], radii=[-0.5]))

    def _log_ground(self) -> None:
        """A plain that moves along in steps of its own pattern, and a marked runway that stands still."""
        reach, width = 4000.0, 1500.0
        plain = _rectangle(-reach, reach, 4.0 * width, 0.4)
        self._static("world/ground/plain", rr.Mesh3D(**plain, albedo_factor=(58, 74, 58, 255)))
        lines = [[[x, -width, 0.0], [x, width, 0.0]] for x in np.arange(-1500.0, 1500.0 + GROUND_STEP, GROUND_STEP)] + [
            [[-1500.0, y, 0.0], [1500.0, y, 0.0]] for y in np.arange(-width, width + GROUND_STEP, GROUND_STEP)
        ]
        self._static("world/ground/grid", rr.LineStrips3D(lines, colors=[(84, 102, 84)], radii=[0.3]))
        runway = _rectangle(-150.0, _RUNWAY_LENGTH, 15.0, 0.1)
        self._static("world/runway", rr.Mesh3D(**runway, albedo_factor=(70, 74, 82, 255)))
        dashes = [[[x, 0.0, -0.1], [x + 30.0, 0.0, -0.1]] for x in np.arange(0.0, _RUNWAY_LENGTH, 60.0)]
        edges = [[[-150.0, y, -0.1], [_RUNWAY_LENGTH, y, -0.1]] for y in (-14.0, 14.0)]
        self._static(
            "world/runway/marks",
            rr.LineStrips3D([*dashes, *edges], colors=[(225, 228, 232)], radii=[0.45] * len(dashes) + [0.25] * 2),
        )
        posts = np.arange(0.0, _RUNWAY_LENGTH, 1000.0)
        self._static(
            "world/runway/posts",
            rr.LineStrips3D(
                [[[x, y, 0.0], [x, y, -12.0]] for x in posts for y in (-20.0, 20.0)],
                colors=[(255, 196, 60)],
                radii=[0.4],
            ),
        )

    def _log(self, path: str, archetype: Any) -> None:
        self._recording.log(path, archetype)

    def _static(self, path: str, archetype: Any) -> None:
        self._recording.log(path, archetype, static=True)


def _mesh(mesh: airframe.Mesh) -> Any:
    return rr.Mesh3D(
        vertex_positions=mesh.vertices.astype(np.float32),
        triangle_indices=mesh.triangles,
        vertex_normals=mesh.normals.astype(np.float32),
        vertex_colors=mesh.colours,
    )


def _glass(mesh: airframe.Mesh, opacity: int) -> Any:
    """A mesh to look through; the viewer heeds opacity in the albedo only, not in vertex colours."""
    red, green, blue, _ = (int(value) for value in mesh.colours[0])
    return rr.Mesh3D(
        vertex_positions=mesh.vertices.astype(np.float32),
        triangle_indices=mesh.triangles,
        vertex_normals=mesh.normals.astype(np.float32),
        albedo_factor=(red, green, blue, opacity),
    )


def _rectangle(start: float, end: float, half_width: float, depth: float) -> dict[str, Any]:
    """A level rectangle facing up, ``depth`` metres below the ground's zero so that lines lie on it."""
    corners = [
        [start, -half_width, depth],
        [end, -half_width, depth],
        [end, half_width, depth],
        [start, half_width, depth],
    ]
    return {
        "vertex_positions": corners,
        "triangle_indices": [[0, 1, 2], [0, 2, 3]],
        "vertex_normals": [[0.0, 0.0, -1.0]] * 4,
    }


def _about_x(angle: float) -> list[float]:
    return [math.sin(0.5 * angle), 0.0, 0.0, math.cos(0.5 * angle)]


def _about_y(angle: float) -> list[float]:
    return [0.0, math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle)]


def _about_z(angle: float) -> list[float]:
    return [0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle)]


def _product(a: list[float], b: list[float]) -> list[float]:
    """Quaternion product, x y z w: first b, then a."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]


def _quaternion(xyzw: list[float]) -> Any:
    return rr.Quaternion(xyzw=xyzw)
