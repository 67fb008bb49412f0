"""AC3D, the format of models that FlightGear reads: materials, then objects in groups, all as text.

Meshes come in body axes (x forward, y right, z down); FlightGear's models have x aft, y right, z up, and the file has
x aft, y up, z left. Turning from one to the other mirrors nothing, so angles keep their signs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from rtsim.arrays import FloatArray
from telemetry.view.airframe import Mesh

CREASE_DEG = 40.0
"""Edges sharper than this are shown as edges [deg]."""
_SHADED, _TWO_SIDED = 0x10, 0x20
_AMBIENT = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class Object:
    """A named part of a model: triangles, or a group of parts."""

    name: str
    """What animations call it."""
    mesh: Mesh | None = None
    """Its triangles, in the body frame."""
    opacity: float = 1.0
    """1 solid, 0 invisible; what is not solid is seen from both sides."""
    parts: Sequence[Object] = field(default=())
    """What belongs to it."""


def model_axes(body: FloatArray) -> FloatArray:
    """Body axes as FlightGear's axes of a model: x aft, y right, z up.

    Args:
        body: Points or directions, the last axis x forward, y right, z down.
    """
    turned: FloatArray = body * np.array([-1.0, 1.0, -1.0])
    return turned


def names(objects: Sequence[Object]) -> list[str]:
    """Every name in a model.

    Args:
        objects: The model.
    """
    return [name for one in objects for name in (one.name, *names(one.parts))]


def write_ac3d(objects: Sequence[Object]) -> str:
    """The text of a model.

    Args:
        objects: What it is made of.
    """
    materials: dict[tuple[int, int, int, float], int] = {}
    body = [line for one in objects for line in _object(one, materials)]
    head = ["AC3Db", *(_material(number, paint) for paint, number in materials.items())]
    return "\n".join([*head, "OBJECT world", f"kids {len(objects)}", *body]) + "\n"


def _material(number: int, paint: tuple[int, int, int, float]) -> str:
    colour, shade = (" ".join(f"{share * channel / 255:.3f}" for channel in paint[:3]) for share in (1.0, _AMBIENT))
    glow = shade if paint[3] < 1.0 else "0 0 0"
    shine = f"emis {glow} spec 0.25 0.25 0.25 shi 32"
    return f'MATERIAL "paint{number}" rgb {colour} amb {shade} {shine} trans {1.0 - paint[3]:.2f}'


def _object(one: Object, materials: dict[tuple[int, int, int, float], int]) -> Iterator[str]:
    yield f"OBJECT {'group' if one.mesh is None else 'poly'}"
    yield f'name "{one.name}"'
    if one.mesh is not None:
        yield f"crease {CREASE_DEG}"
        yield from _triangles(one.mesh, one.opacity, materials)
    yield f"kids {len(one.parts)}"
    for part in one.parts:
        yield from _object(part, materials)


def _triangles(mesh: Mesh, opacity: float, materials: dict[tuple[int, int, int, float], int]) -> Iterator[str]:
    x, y, z = model_axes(mesh.vertices).T
    yield f"numvert {len(x)}"
    yield from (f"{a:.4f} {b:.4f} {c:.4f}" for a, b, c in zip(x, z, -y, strict=True))
    yield f"numsurf {len(mesh.triangles)}"
    kind = f"SURF 0x{_SHADED | (_TWO_SIDED if opacity < 1.0 else 0):x}"
    painted = mesh.colours[mesh.triangles][:, :, :3]
    for corners, colours in zip(mesh.triangles.tolist(), painted.tolist(), strict=True):
        paint = colours[1] if colours[1] == colours[2] else colours[0]
        number = materials.setdefault((*paint, opacity), len(materials))
        yield f"{kind}\nmat {number}\nrefs 3\n" + "\n".join(f"{corner} 0 0" for corner in corners)
