"""The XV-15 as FlightGear shows it: the shape of the Rerun view, and what moves it.

The parts are those of ``telemetry.view.airframe`` and ``telemetry.view.undercarriage``; each is turned about the same
point and axis in both views. The properties are those that the packets of ``telemetry.flightgear.packet`` set.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree as ET

import numpy as np

from rtsim.arrays import FloatArray
from telemetry.flightgear.ac3d import Object, model_axes
from telemetry.flightgear.fields import FLAP_TRAVEL_DEG, NACELLE_FULL_DEG, SURFACE_TRAVEL_DEG
from telemetry.view import airframe
from telemetry.view.airframe import Mesh
from telemetry.view.undercarriage import Leg, fairing, legs

SIDES = (("left", -1.0, 0), ("right", 1.0, 1))
"""Name, sign of y and number of the engine of each side."""
DISC_OPACITY = 0.16
"""Opacity of the rotor discs."""
_DISC_COLOUR = (205, 210, 216)
_SURFACE, _HIDDEN_BELOW = "surface-positions", 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Movement:
    """What a property does to parts of the model."""

    kind: str
    """``rotate``, ``spin``, ``translate`` or ``select``."""
    objects: tuple[str, ...]
    """The parts."""
    property: str
    """Path of the property that moves them."""
    factor: float = 1.0
    """Degrees, turns a minute or metres for one of the property."""
    offset_deg: float = 0.0
    """Angle where the property is 0 [deg]."""
    table: Sequence[tuple[float, float]] = ()
    """In place of ``factor``: values of the property and what belongs to them."""
    centre: FloatArray | None = None
    """A point of the axis in the body frame [m]."""
    axis: FloatArray | None = None
    """Direction in the body frame; angles are right-handed about it."""


def objects() -> list[Object]:
    """Every part of the aircraft, nacelles forward, surfaces neutral, wheels down."""
    body = [
        Object("fuselage", airframe.fuselage()),
        Object("wing", airframe.wing()),
        Object("tail", airframe.tail()),
        Object("fairings", airframe.merge([fairing(side) for _, side, _ in SIDES])),
    ]
    surfaces = [Object(name, _at(surface.mesh, surface.place)) for name, surface in _surfaces().items()]
    gear = [
        Object(
            f"gear_{name}",
            parts=(
                Object(f"strut_{name}", _at(leg.strut, leg.place)),
                Object(f"wheels_{name}", _at(leg.wheels, leg.place)),
            ),
        )
        for name, leg in legs().items()
    ]
    return [*body, *surfaces, *gear, *(_nacelle(name, side) for name, side, _ in SIDES)]


def movements() -> list[Movement]:
    """What moves on it."""
    moves = [_hinge("elevator", f"{_SURFACE}/elevator-pos-norm", SURFACE_TRAVEL_DEG)]
    droop = [(flap / FLAP_TRAVEL_DEG, angle) for flap, angle in zip(*airframe.FLAPERON_OF_FLAP, strict=True)]
    for number, (name, leg) in enumerate(legs().items()):
        moves += _leg_moves(name, leg, f"gear/gear[{number}]")
    for name, side, engine in SIDES:
        moves += [
            _hinge(f"flap_{name}", f"{_SURFACE}/flap-pos-norm", FLAP_TRAVEL_DEG),
            _hinge(f"flaperon_{name}", f"{_SURFACE}/flap-pos-norm", 1.0, table=droop),
            _hinge(f"flaperon_{name}", f"{_SURFACE}/{name}-aileron-pos-norm", SURFACE_TRAVEL_DEG),
            _hinge(f"rudder_{name}", f"{_SURFACE}/rudder-pos-norm", SURFACE_TRAVEL_DEG),
            Movement(
                "rotate",
                (f"nacelle_{name}",),
                f"{_SURFACE}/speedbrake-pos-norm",
                NACELLE_FULL_DEG,
                centre=_pivot(side),
                axis=np.array([0.0, 1.0, 0.0]),
            ),
            Movement(
                "spin",
                (f"blades_{name}",),
                f"engines/engine[{engine}]/rpm",
                centre=_hub(side),
                axis=np.array([side, 0.0, 0.0]),
            ),
        ]
    return moves


def animation_xml(model_file: str) -> str:
    """The file that joins the model and its movements.

    Args:
        model_file: Name of the model's file beside it.
    """
    root = ET.Element("PropertyList")
    ET.SubElement(root, "path").text = model_file
    for move in movements():
        root.append(_animation(move))
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _animation(move: Movement) -> ET.Element:
    node = ET.Element("animation")
    _add(node, type=move.kind)
    for name in move.objects:
        _add(node, **{"object-name": name})
    if move.kind == "select":
        above = ET.SubElement(ET.SubElement(node, "condition"), "greater-than")
        _add(above, property=move.property, value=_HIDDEN_BELOW)
        return node
    _add(node, property=move.property)
    if move.table:
        table = ET.SubElement(node, "interpolation")
        for value, result in move.table:
            _add(ET.SubElement(table, "entry"), ind=value, dep=result)
    else:
        _add(node, factor=move.factor)
    if move.offset_deg:
        _add(node, **{"offset-deg": move.offset_deg})
    if move.centre is not None:
        place = dict(zip(("x-m", "y-m", "z-m"), model_axes(move.centre), strict=True))
        _add(ET.SubElement(node, "center"), **place)
    if move.axis is not None:
        _add(ET.SubElement(node, "axis"), **dict(zip("xyz", model_axes(move.axis), strict=True)))
    return node


def _add(node: ET.Element, **values: str | float) -> None:
    """Add elements with one value each."""
    for name, value in values.items():
        ET.SubElement(node, name).text = value if isinstance(value, str) else f"{value + 0.0:.6g}"


def _surfaces() -> dict[str, airframe.Surface]:
    surfaces = {"elevator": airframe.elevator()}
    for name, side, _ in SIDES:
        surfaces |= {
            f"flap_{name}": airframe.flap(side),
            f"flaperon_{name}": airframe.flaperon(side),
            f"rudder_{name}": airframe.rudder(side),
        }
    return surfaces


def _leg_moves(name: str, leg: Leg, wheel: str) -> list[Movement]:
    """Hide a leg that is up, fold it, press its wheels."""
    across, up = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, -1.0])
    group = (f"gear_{name}",)
    folded = leg.folded_deg
    return [
        Movement("select", group, f"{wheel}/position-norm"),
        Movement("rotate", group, f"{wheel}/position-norm", -folded, offset_deg=folded, centre=leg.place, axis=across),
        Movement("translate", (f"wheels_{name}",), f"{wheel}/compression-norm", leg.stroke, axis=up),
    ]


def _hinge(name: str, path: str, travel_deg: float, *, table: Sequence[tuple[float, float]] = ()) -> Movement:
    surface = _surfaces()[name]
    return Movement("rotate", (name,), path, travel_deg, table=table, centre=surface.place, axis=surface.axis)


def _nacelle(name: str, side: float) -> Object:
    hub = _hub(side)
    return Object(
        f"nacelle_{name}",
        parts=(
            Object(f"pod_{name}", _at(airframe.nacelle(), _pivot(side))),
            Object(f"blades_{name}", _at(airframe.blades(side), hub)),
            Object(f"disc_{name}", _at(airframe.disc(_DISC_COLOUR), hub), opacity=DISC_OPACITY),
        ),
    )


def _pivot(side: float) -> FloatArray:
    pivot: FloatArray = airframe.PIVOT * np.array([1.0, side, 1.0])
    return pivot


def _hub(side: float) -> FloatArray:
    hub: FloatArray = _pivot(side) + np.array([airframe.MAST_LENGTH, 0.0, 0.0])
    return hub


def _at(mesh: Mesh, place: FloatArray) -> Mesh:
    return dataclasses.replace(mesh, vertices=mesh.vertices + place)
