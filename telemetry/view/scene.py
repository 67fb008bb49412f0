"""The three-dimensional view: aircraft, rotors, ground, wind and path, in NED metres from the point of departure."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import rerun as rr

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from telemetry.view import airframe, undercarriage
from telemetry.view.colours import AMBER, CYAN, LEFT_ROTOR, RIGHT_ROTOR, TEXT, TRAIL, WIND
from telemetry.view.strokes import LineArt

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

ROSE_RADIUS = 0.85
"""Radius of the compass rose on the ground, in heights of the aircraft above it, so that it looks as large from all."""
LEAST_ROSE = 18.0
"""Its smallest radius [m]."""
SHOWN_WIND = 0.5
"""Wind that is shown from here on [m/s]."""
SURFACE_STEP = 0.2
"""Control surfaces are shown in steps of this, so that what hardly moves sends nothing [deg]."""

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
        self._kept: dict[str, tuple[float, ...]] = {}
        self._static("world", rr.ViewCoordinates.FRD)
        self._static("world/chase", rr.ViewCoordinates.FRD)
        for name, mesh in (("body", airframe.fuselage()), ("wing", airframe.wing()), ("tail", airframe.tail())):
            self._static(f"world/aircraft/{name}", _mesh(mesh))
        self._legs = undercarriage.legs()
        self._surfaces = {"elevator": airframe.elevator()}
        for name, side, colour in SIDES:
            self._static(f"world/aircraft/fairing_{name}", _mesh(undercarriage.fairing(side)))
            self._log_static_rotor(f"world/aircraft/nacelle_{name}", side, colour)
            self._surfaces[f"flap_{name}"] = airframe.flap(side)
            self._surfaces[f"flaperon_{name}"] = airframe.flaperon(side)
            self._surfaces[f"rudder_{name}"] = airframe.rudder(side)
        for name, surface in self._surfaces.items():
            self._static(f"world/aircraft/{name}/mesh", _mesh(surface.mesh))
        self._log_ground()

    def update(self, row: FloatArray, *, trail: bool = True) -> None:
        """Show the aircraft as it is in one row.

        Args:
            trail: The place is part of the path.
        """
        time_s, nacelle = float(row[COLUMN.time_s]), math.radians(row[COLUMN.nacelle_deg])
        position = place_of(row)
        heading = _about_z(math.radians(row[COLUMN.heading_deg]))
        self._log("world/chase", rr.Transform3D(translation=position, quaternion=_quaternion(heading)))
        centre = [*position[:2], position[2] - undercarriage.STANDING_HEIGHT]  # altitude is 0 standing on the wheels
        self._log("world/aircraft", rr.Transform3D(translation=centre, quaternion=_quaternion(attitude_of(row))))
        azimuth = 2.0 * math.pi * ((SHOWN_TURNS_PER_SECOND * time_s) % 1.0)
        for name, side, _ in SIDES:
            path = f"world/aircraft/nacelle_{name}"
            pivot = airframe.PIVOT * [1.0, side, 1.0]
            self._log(path, rr.Transform3D(translation=pivot, quaternion=_quaternion(_about_y(nacelle))))
            hub = _quaternion(hub_of(row, side))
            self._log(f"{path}/hub", rr.Transform3D(translation=[airframe.MAST_LENGTH, 0.0, 0.0], quaternion=hub))
            self._log(f"{path}/hub/blades", rr.Transform3D(quaternion=_quaternion(_about_x(side * azimuth))))
        self._move_surfaces(row)
        self._move_legs(row)
        self._move_ground(row, position, departure=trail)
        self._log(
            "world/height",
            rr.LineStrips3D([[position, [*position[:2], 0.0]]], colors=[(*CYAN, 90)], radii=[-0.7]),
        )
        if trail and time_s - self._trail_time >= 0.5:
            self._trail_time = time_s
            self._trail = [*self._trail[1 - TRAIL_POINTS :], position]
            track = [[north, east, -0.2] for north, east, _ in self._trail]
            self._log(
                "world/trail",
                rr.LineStrips3D([self._trail, track], colors=[TRAIL, (*TRAIL, 110)], radii=[-1.5, -1.0]),
            )

    def _move_surfaces(self, row: FloatArray) -> None:
        for name, angle in surface_angles(row).items():
            shown = SURFACE_STEP * float(np.round(angle / SURFACE_STEP))
            if self._changed(name, shown):
                surface = self._surfaces[name]
                turned = _quaternion(_about(surface.axis, math.radians(shown)))
                self._log(f"world/aircraft/{name}", rr.Transform3D(translation=surface.place, quaternion=turned))

    def _move_legs(self, row: FloatArray) -> None:
        """Fold the legs, which are not there while they are up, and press their wheels."""
        down = undercarriage.extended(float(row[COLUMN.nacelle_deg]))
        used = round(undercarriage.stroke_used(float(row[COLUMN.weight_on_wheels])), 2)
        if not self._changed("legs", down, used):
            return
        for name, leg in self._legs.items():
            path = f"world/aircraft/leg_{name}"
            if not down:
                self._log(path, rr.Clear(recursive=True))
                self._kept.pop(path, None)
                continue
            if self._changed(path):
                self._log(f"{path}/strut", _mesh(leg.strut))
                self._log(f"{path}/wheels", _mesh(leg.wheels))
            folded = _quaternion(_about_y(math.radians(leg.folded_deg * (1.0 - down))))
            self._log(path, rr.Transform3D(translation=leg.place, quaternion=folded))
            self._log(f"{path}/wheels", rr.Transform3D(translation=[0.0, 0.0, -used * leg.stroke]))

    def _move_ground(self, row: FloatArray, position: list[float], *, departure: bool) -> None:
        """Take plain, compass rose and wind arrow along; lay the runway along the heading of the departure."""
        if departure and "runway" not in self._kept:
            self._changed("runway")
            ahead = _about_z(math.radians(row[COLUMN.heading_deg]))
            self._log("world/runway", rr.Transform3D(quaternion=_quaternion(ahead)))
        snapped = [_SNAP * math.floor(place / _SNAP) for place in position[:2]]
        if self._changed("ground", *snapped):
            self._log("world/ground", rr.Transform3D(translation=[*snapped, 0.0]))
        size = max(LEAST_ROSE, -ROSE_RADIUS * position[2])
        self._log("world/rose", rr.Transform3D(translation=[*position[:2], 0.0], scale=size))
        north, east = float(row[COLUMN.wind_north_m_s]), float(row[COLUMN.wind_east_m_s])
        if math.hypot(north, east) >= SHOWN_WIND:
            # Past the aircraft's tail fins, as a wind-sock would hang, a second of its way long.
            blown = 0.5 * np.array([north, east, 0.0])
            above = np.array([*position[:2], position[2] - 6.5])
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

    def _log_static_rotor(self, path: str, side: float, colour: airframe.Colour) -> None:
        self._static(f"{path}/pod", _mesh(airframe.nacelle()))
        self._static(f"{path}/hub/disc", _glass(airframe.disc(colour), DISC_OPACITY))
        self._static(f"{path}/hub/rim", rr.LineStrips3D([airframe.circle(96)], colors=[colour], radii=[0.035]))
        self._static(f"{path}/hub/blades", _mesh(airframe.blades(side)))
        # A thin ring square to the mast: the distance of the rim from it is the flapping.
        square = airframe.circle(96) + np.array([airframe.MAST_LENGTH, 0.0, 0.0])
        self._static(f"{path}/square", rr.LineStrips3D([square], colors=[(220, 225, 232, 120)], radii=[-0.5]))

    def _log_ground(self) -> None:
        """A plain that moves along in steps of its own pattern, a compass rose, and a runway that stands still."""
        reach, width = 4000.0, 1500.0
        plain = _rectangle(-reach, reach, 4.0 * width, 0.4)
        self._static("world/ground/plain", rr.Mesh3D(**plain, albedo_factor=(58, 74, 58, 255)))
        lines = [[[x, -width, 0.0], [x, width, 0.0]] for x in np.arange(-1500.0, 1500.0 + GROUND_STEP, GROUND_STEP)] + [
            [[-1500.0, y, 0.0], [1500.0, y, 0.0]] for y in np.arange(-width, width + GROUND_STEP, GROUND_STEP)
        ]
        self._static("world/ground/grid", rr.LineStrips3D(lines, colors=[(84, 102, 84)], radii=[0.3]))
        self._static("world/rose/marks", compass_rose())
        runway = _rectangle(-150.0, _RUNWAY_LENGTH, 15.0, 0.1)
        self._static("world/runway", rr.Mesh3D(**runway, albedo_factor=(70, 74, 82, 255)))
        dashes = [[[x, 0.0, -0.1], [x + 30.0, 0.0, -0.1]] for x in np.arange(0.0, _RUNWAY_LENGTH, 60.0)]
        edges = [[[-150.0, y, -0.1], [_RUNWAY_LENGTH, y, -0.1]] for y in (-14.0, 14.0)]
        self._static(
            "world/runway/marks",
            rr.LineStrips3D([*dashes, *edges], colors=[(225, 228, 232)], radii=[0.45] * len(dashes) + [0.25] * 2),
        )
        posts = np.arange(1000.0, _RUNWAY_LENGTH, 1000.0)
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


def place_of(row: FloatArray) -> list[float]:
    """Where the aircraft is: north, east, down [m]."""
    return [float(row[COLUMN.north_m]), float(row[COLUMN.east_m]), -float(row[COLUMN.altitude_m])]


def attitude_of(row: FloatArray) -> list[float]:
    """Body to north, east, down as a quaternion x y z w: heading, then pitch, then bank."""
    bank, pitch, heading = (
        math.radians(row[column]) for column in (COLUMN.bank_deg, COLUMN.pitch_deg, COLUMN.heading_deg)
    )
    return _product(_about_z(heading), _product(_about_y(pitch), _about_x(bank)))


def hub_of(row: FloatArray, side: float) -> list[float]:
    """One rotor's disc to its nacelle as a quaternion x y z w.

    Positive flapping tilts the disc from the mast (+x) to what is ahead in helicopter mode (+z), and inboard.

    Args:
        side: 1 right, -1 left.
    """
    forward = math.radians(
        row[COLUMN.longitudinal_flapping_deg] + side * row[COLUMN.differential_longitudinal_flapping_deg]
    )
    inboard = math.radians(row[COLUMN.lateral_flapping_deg] + side * row[COLUMN.differential_lateral_flapping_deg])
    return _product(_about_y(-forward), _about_z(-side * inboard))


def surface_angles(row: FloatArray) -> dict[str, float]:
    """How far each control surface is turned about its hinge [deg]: trailing edge down, or to the right."""
    droop = float(np.interp(row[COLUMN.flap_deg], *airframe.FLAPERON_OF_FLAP))
    angles = {"elevator": float(row[COLUMN.elevator_deg])}
    for name, side, _ in SIDES:
        angles[f"flap_{name}"] = float(row[COLUMN.flap_deg])
        angles[f"flaperon_{name}"] = droop - side * float(row[COLUMN.aileron_deg])
        angles[f"rudder_{name}"] = float(row[COLUMN.rudder_deg])
    return angles


def compass_rose() -> Any:
    """A ring of radius 1 on the ground with marks every 30 degrees and the letters of the four quarters."""
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    strips = [np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], 1)]
    colours: list[Any] = [TEXT]
    for degrees in range(0, 360, 30):
        outward = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees)), 0.0])
        strips.append(np.array([outward, 1.07 * outward]))
        colours.append(TEXT)
    for letter, degrees in (("N", 0), ("E", 90), ("S", 180), ("W", 270)):
        art = LineArt()
        art.text(letter, 0.0, 0.0, height=0.22, colour=TEXT, align="centre")
        outward = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees)), 0.0])
        right = np.array([-outward[1], outward[0], 0.0])
        for strip in art.strips:  # x right, y down the page: read with its quarter ahead
            strips.append(1.24 * outward + np.outer(strip[:, 0], right) - np.outer(strip[:, 1], outward))
            colours.append(AMBER if letter == "N" else TEXT)
    return rr.LineStrips3D(strips, colors=colours, radii=[-1.1])


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


def _about(axis: FloatArray, angle: float) -> list[float]:
    x, y, z = math.sin(0.5 * angle) * axis
    return [x, y, z, math.cos(0.5 * angle)]


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
