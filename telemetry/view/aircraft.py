"""The aircraft as it is seen: body, nacelles, rotors, surfaces and wheels at one place of a recording.

A recording can show several: one that flies, and ghosts of other flights, which can be looked through.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import rerun as rr

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from telemetry.view import airframe, undercarriage
from telemetry.view.colours import LEFT_ROTOR, RIGHT_ROTOR
from telemetry.view.turning import about, about_x, about_y, about_z, product, quaternion

SHOWN_TURNS_PER_SECOND = 0.45
"""Blades are shown this slowly: at 30 pictures a second 589 rpm would look like noise."""
DISC_OPACITY = 70
"""Opacity of the rotor discs, 0 to 255."""
GHOST_OPACITY = 110
"""Opacity of an aircraft that is a ghost."""
SIDES = (("left", -1.0, LEFT_ROTOR), ("right", 1.0, RIGHT_ROTOR))
"""Name, sign of y and rotor colour of each side."""
SURFACE_STEP = 0.2
"""Control surfaces are shown in steps of this, so that what hardly moves sends nothing [deg]."""
Colour = tuple[int, int, int]


class Aircraft:
    """Logs one aircraft to one recording."""

    def __init__(self, recording: Any, path: str = "world/aircraft", *, ghost: Colour | None = None) -> None:
        """Log everything that does not move by itself.

        Args:
            recording: The ``rerun.RecordingStream``.
            path: Where it is in the recording.
            ghost: Colour of an aircraft to look through; None is the aircraft itself.
        """
        self._recording, self._path, self._ghost = recording, path, ghost
        self._kept: dict[str, tuple[float, ...]] = {}
        for name, mesh in (("body", airframe.fuselage()), ("wing", airframe.wing()), ("tail", airframe.tail())):
            self._static(name, self._mesh(mesh))
        self._legs = undercarriage.legs()
        self._surfaces = {"elevator": airframe.elevator()}
        for name, side, colour in SIDES:
            self._static(f"fairing_{name}", self._mesh(undercarriage.fairing(side)))
            self._log_static_rotor(f"nacelle_{name}", side, ghost or colour)
            self._surfaces[f"flap_{name}"] = airframe.flap(side)
            self._surfaces[f"flaperon_{name}"] = airframe.flaperon(side)
            self._surfaces[f"rudder_{name}"] = airframe.rudder(side)
        for name, surface in self._surfaces.items():
            self._static(f"{name}/mesh", self._mesh(surface.mesh))

    def update(self, row: FloatArray) -> None:
        """Show it as it is in one row."""
        time_s, nacelle = float(row[COLUMN.time_s]), math.radians(row[COLUMN.nacelle_deg])
        north, east, down = place_of(row)
        centre = [north, east, down - undercarriage.STANDING_HEIGHT]  # altitude is 0 standing on the wheels
        self._recording.log(self._path, rr.Transform3D(translation=centre, quaternion=quaternion(attitude_of(row))))
        azimuth = 2.0 * math.pi * ((SHOWN_TURNS_PER_SECOND * time_s) % 1.0)
        for name, side, _ in SIDES:
            path = f"nacelle_{name}"
            pivot = airframe.PIVOT * [1.0, side, 1.0]
            self._log(path, rr.Transform3D(translation=pivot, quaternion=quaternion(about_y(nacelle))))
            hub = quaternion(hub_of(row, side))
            self._log(f"{path}/hub", rr.Transform3D(translation=[airframe.MAST_LENGTH, 0.0, 0.0], quaternion=hub))
            self._log(f"{path}/hub/blades", rr.Transform3D(quaternion=quaternion(about_x(side * azimuth))))
        self._move_surfaces(row)
        self._move_legs(row)

    def _move_surfaces(self, row: FloatArray) -> None:
        for name, angle in surface_angles(row).items():
            shown = SURFACE_STEP * float(np.round(angle / SURFACE_STEP))
            if self._changed(name, shown):
                surface = self._surfaces[name]
                turned = quaternion(about(surface.axis, math.radians(shown)))
                self._log(name, rr.Transform3D(translation=surface.place, quaternion=turned))

    def _move_legs(self, row: FloatArray) -> None:
        """Fold the legs, which are not there while they are up, and press their wheels."""
        down = undercarriage.extended(float(row[COLUMN.nacelle_deg]))
        used = round(undercarriage.stroke_used(float(row[COLUMN.weight_on_wheels])), 2)
        if not self._changed("legs", down, used):
            return
        for name, leg in self._legs.items():
            path = f"leg_{name}"
            if not down:
                self._log(path, rr.Clear(recursive=True))
                self._kept.pop(path, None)
                continue
            if self._changed(path):
                self._log(f"{path}/strut", self._mesh(leg.strut))
                self._log(f"{path}/wheels", self._mesh(leg.wheels))
            folded = quaternion(about_y(math.radians(leg.folded_deg * (1.0 - down))))
            self._log(path, rr.Transform3D(translation=leg.place, quaternion=folded))
            self._log(f"{path}/wheels", rr.Transform3D(translation=[0.0, 0.0, -used * leg.stroke]))

    def _changed(self, name: str, *values: float) -> bool:
        """Whether something is elsewhere than when this was last asked."""
        before = self._kept.get(name)
        self._kept[name] = values
        return before != values

    def _log_static_rotor(self, path: str, side: float, colour: airframe.Colour) -> None:
        self._static(f"{path}/pod", self._mesh(airframe.nacelle()))
        self._static(f"{path}/hub/disc", _glass(airframe.disc(colour), DISC_OPACITY))
        self._static(f"{path}/hub/rim", rr.LineStrips3D([airframe.circle(96)], colors=[colour], radii=[0.035]))
        self._static(f"{path}/hub/blades", self._mesh(airframe.blades(side)))
        # A thin ring square to the mast: the distance of the rim from it is the flapping.
        square = airframe.circle(96) + np.array([airframe.MAST_LENGTH, 0.0, 0.0])
        self._static(f"{path}/square", rr.LineStrips3D([square], colors=[(220, 225, 232, 120)], radii=[-0.5]))

    def _mesh(self, mesh: airframe.Mesh) -> Any:
        return rr.Mesh3D(
            vertex_positions=mesh.vertices.astype(np.float32),
            triangle_indices=mesh.triangles,
            vertex_normals=mesh.normals.astype(np.float32),
            vertex_colors=mesh.colours,
            albedo_factor=None if self._ghost is None else (*self._ghost, GHOST_OPACITY),
        )

    def _log(self, path: str, archetype: Any) -> None:
        self._recording.log(f"{self._path}/{path}", archetype)

    def _static(self, path: str, archetype: Any) -> None:
        self._recording.log(f"{self._path}/{path}", archetype, static=True)


def place_of(row: FloatArray) -> list[float]:
    """Where the aircraft is: north, east, down [m]."""
    return [float(row[COLUMN.north_m]), float(row[COLUMN.east_m]), -float(row[COLUMN.altitude_m])]


def attitude_of(row: FloatArray) -> list[float]:
    """Body to north, east, down as a quaternion x y z w: heading, then pitch, then bank."""
    bank, pitch, heading = (
        math.radians(row[column]) for column in (COLUMN.bank_deg, COLUMN.pitch_deg, COLUMN.heading_deg)
    )
    return product(about_z(heading), product(about_y(pitch), about_x(bank)))


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
    return product(about_y(-forward), about_z(-side * inboard))


def surface_angles(row: FloatArray) -> dict[str, float]:
    """How far each control surface is turned about its hinge [deg]: trailing edge down, or to the right."""
    droop = float(np.interp(row[COLUMN.flap_deg], *airframe.FLAPERON_OF_FLAP))
    angles = {"elevator": float(row[COLUMN.elevator_deg])}
    for name, side, _ in SIDES:
        angles[f"flap_{name}"] = float(row[COLUMN.flap_deg])
        angles[f"flaperon_{name}"] = droop - side * float(row[COLUMN.aileron_deg])
        angles[f"rudder_{name}"] = float(row[COLUMN.rudder_deg])
    return angles


def _glass(mesh: airframe.Mesh, opacity: int) -> Any:
    """A mesh to look through; the viewer heeds opacity in the albedo only, not in vertex colours."""
    red, green, blue, _ = (int(value) for value in mesh.colours[0])
    return rr.Mesh3D(
        vertex_positions=mesh.vertices.astype(np.float32),
        triangle_indices=mesh.triangles,
        vertex_normals=mesh.normals.astype(np.float32),
        albedo_factor=(red, green, blue, opacity),
    )
