"""The XV-15's wheels as triangles: three legs that fold, and the fairings of the main ones.

Axles, tyres, strokes and track are those of the aircraft's data (``[gear]`` of systems.toml, a test compares); legs,
fairings and the way they fold are drawn by eye. Axes and stations as in ``telemetry.view.airframe``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.units import INCH
from telemetry.view.airframe import DARK, GREY, WHITE, Colour, Mesh, body_point, loft, merge

NOSE_AXLE, MAIN_AXLE = (139.0, 0.0, 5.0), (326.0, 55.0, 8.5)
"""SL, BL, WL of the axles, legs extended [in]."""
NOSE_TYRE, MAIN_TYRE = 13.0, 20.5
"""Diameters of the tyres [in]."""
NOSE_STROKE, MAIN_STROKE = 14.5 * INCH, 13.5 * INCH
"""Strokes of the legs [m]."""
STANDING_HEIGHT = 1.944
"""Centre of gravity above the ground where the aircraft stands, half of the strokes used [m]."""
GEAR_NACELLE_DEG = (60.0, 75.0)
"""The legs are shown up below the first nacelle angle, down above the second [deg]."""
_FOLDED_DEG = 95.0


def extended(nacelle_deg: float) -> float:
    """How far the legs are shown down, 0 to 1: no flight knows of it, and landings need upright nacelles.

    Args:
        nacelle_deg: Nacelle angle [deg].
    """
    up, down = GEAR_NACELLE_DEG
    return min(max((nacelle_deg - up) / (down - up), 0.0), 1.0)


def stroke_used(weight_on_wheels: float) -> float:
    """How much of the strokes is used, 0 to 1: half of them where the aircraft stands.

    Args:
        weight_on_wheels: Force of the ground over the weight.
    """
    return min(0.5 * weight_on_wheels, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """A leg with its wheels, extended; it folds about a line across the aircraft."""

    strut: Mesh
    """What is fixed to the hinge, about ``place``."""
    wheels: Mesh
    """What goes up when the leg is pressed, about ``place``."""
    place: FloatArray
    """The hinge in the body frame [m]."""
    folded_deg: float
    """How far it turns about +y to be up [deg]."""
    stroke: float
    """How far the wheels go up [m]."""


def legs() -> dict[str, Leg]:
    """Every leg by its name, in FlightGear's order of wheels."""
    return {"nose": nose_leg(), "left": main_leg(-1.0), "right": main_leg(1.0)}


def nose_leg() -> Leg:
    """The nose leg, which folds back."""
    return _leg(NOSE_AXLE, NOSE_TYRE, (139.0, 0.0, 56.0), folded_deg=-_FOLDED_DEG, stroke=NOSE_STROKE)


def main_leg(side: float) -> Leg:
    """One main leg, which folds forward into its fairing.

    Args:
        side: 1 right, -1 left.
    """
    station, track, level = MAIN_AXLE
    hinge = (station, side * 40.0, 54.0)
    return _leg((station, side * track, level), MAIN_TYRE, hinge, folded_deg=_FOLDED_DEG, stroke=MAIN_STROKE)


def fairing(side: float) -> Mesh:
    """The fairing of one main leg, on the fuselage's side.

    Args:
        side: 1 right, -1 left.
    """
    along = np.linspace(-1.0, 1.0, 25)
    radius = np.sqrt(np.maximum(1.0 - np.abs(along) ** 2.4, 1e-4))
    angle = np.linspace(0.0, 2.0 * np.pi, 25)[:-1]
    sections = np.empty((len(along), len(angle), 3))
    sections[:, :, 0] = (318.0 + 62.0 * along)[:, None]
    sections[:, :, 1] = side * 35.0 + np.outer(radius, 14.0 * np.cos(angle))
    sections[:, :, 2] = 60.0 + np.outer(radius, 14.0 * np.sin(angle))
    return loft(body_point(sections), WHITE)


def _leg(
    axle: tuple[float, float, float],
    tyre: float,
    hinge: tuple[float, float, float],
    *,
    folded_deg: float,
    stroke: float,
) -> Leg:
    place, centre = body_point(np.array(hinge)), body_point(np.array(axle))
    way = centre - place
    radius, width = 0.5 * tyre * INCH, 0.36 * tyre * INCH
    rim, flat = np.array([0.55, 0.95, 1.0, 1.0, 0.95, 0.55]), np.array([-0.5, -0.45, -0.2, 0.2, 0.45, 0.5])
    across = np.array([0.0, 1.0, 0.0])
    parts = [_rod(np.array([0.35 * way, way]), 0.035, GREY)]
    for side in (-0.65, 0.65):
        middle = way + side * width * across
        ring = _rings(middle, width * flat, radius * rim)
        parts += [loft(ring, DARK), loft(_rings(middle, 1.1 * width * flat[[0, -1]], 0.5 * radius * np.ones(2)), WHITE)]
    parts.append(_rod(np.array([way - 0.65 * width * across, way + 0.65 * width * across]), 0.03, GREY))
    return Leg(_rod(np.array([0.0 * way, 0.75 * way]), 0.06, WHITE), merge(parts), place, folded_deg, stroke)


def _rings(middle: FloatArray, offsets: FloatArray, radii: FloatArray) -> FloatArray:
    """Circles about the y axis through a point, at offsets along it."""
    angle = np.linspace(0.0, 2.0 * np.pi, 33)[:-1]
    circle = np.stack([np.cos(angle), np.zeros_like(angle), np.sin(angle)], 1)
    along = np.array([0.0, 1.0, 0.0])
    return np.stack([middle + offset * along + radius * circle for offset, radius in zip(offsets, radii, strict=True)])


def _rod(ends: FloatArray, radius: float, colour: Colour) -> Mesh:
    """A round bar from one point to another."""
    way = ends[1] - ends[0]
    first = np.cross(way, [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    second = np.cross(way, first) / np.linalg.norm(way)
    angle = np.linspace(0.0, 2.0 * np.pi, 17)[:-1]
    circle = radius * (np.outer(np.cos(angle), first) + np.outer(np.sin(angle), second))
    return loft(ends[:, None, :] + circle, colour)
