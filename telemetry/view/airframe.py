"""The XV-15 as triangles: lofted fuselage, wing, tail and nacelles, rotor discs and blades, control surfaces.

Dimensions follow NASA CR-166536 (stations in inches: SL aft, BL right, WL up) and the XV-15 familiarization
document, TM X-62407; shapes between them are drawn by eye. Meshes are in metres, x forward, y right, z down; body
parts about the centre of gravity in hover, control surfaces about a point of their hinge, nacelle parts about the
conversion axis with the mast along +x, rotor parts about the hub. No viewer is needed here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rtsim.arrays import FloatArray
from rtsim.units import INCH

ROTOR_RADIUS = 3.81
"""Rotor radius [m], CR-166536."""
MAST_LENGTH = 1.4225
"""Conversion axis to hub [m], CR-166536."""
PIVOT = np.array([(301.2 - 300.0) * INCH, 193.0 * INCH, (81.65 - 100.0) * INCH])
"""Right conversion axis in the body frame [m]: SL 300, BL 193, WL 100."""
BLADE_COUNT = 3
"""Blades of one rotor."""
FLAPERON_OF_FLAP = ((0.0, 20.0, 40.0, 75.0), (0.0, 12.5, 25.0, 47.0))
"""Flap settings and the flaperons' droop there [deg], CR-166536."""

WHITE, BLUE, GLASS, GREY, DARK = (232, 235, 238), (38, 84, 160), (30, 42, 58), (176, 182, 190), (70, 76, 84)
Colour = tuple[int, int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Triangles with smooth shading."""

    vertices: FloatArray
    """Corners, shape (n, 3) [m]."""
    triangles: npt.NDArray[np.uint32]
    """Corner numbers, shape (m, 3)."""
    normals: FloatArray
    """Outward normals at the corners, shape (n, 3)."""
    colours: npt.NDArray[np.uint8]
    """Red, green, blue, opacity at the corners, shape (n, 4)."""


def loft(sections: FloatArray, colour: Colour) -> Mesh:
    """Skin a row of closed sections, with flat ends.

    Args:
        sections: Shape (sections, points, 3) [m]; all sections run the same way round.
        colour: Colour of the skin.
    """
    count, points, _ = sections.shape
    around = np.arange(points)
    following = (around + 1) % points
    quads = []
    for section in range(count - 1):
        a, b = section * points + around, section * points + following
        quads += [np.stack([a, b, a + points], 1), np.stack([b, b + points, a + points], 1)]
    vertices = sections.reshape(-1, 3)
    triangles = np.concatenate(quads)
    for end, first in ((0, False), (count - 1, True)):
        centre = len(vertices)
        ring = sections[end]
        vertices = np.concatenate([vertices, ring.mean(0)[None], ring])
        a, b = centre + 1 + around, centre + 1 + following
        fan = np.stack([np.full(points, centre), a, b] if first else [np.full(points, centre), b, a], 1)
        triangles = np.concatenate([triangles, fan])
    return _finish(vertices, triangles, colour)


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes as one.

    Args:
        meshes: What to join.
    """
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.triangles + offset for mesh, offset in zip(meshes, offsets, strict=True)]).astype(
            np.uint32
        ),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([mesh.colours for mesh in meshes]),
    )


def fuselage() -> Mesh:
    """Fuselage with windows and a blue line."""
    stations = np.array([56.0, 60, 68, 80, 100, 125, 150, 185, 230, 330, 370, 420, 470, 520, 560, 574, 576])
    widths = np.array([0.5, 4.0, 9.0, 15.0, 22.0, 28.0, 31.5, 33.0, 33.0, 33.0, 31.0, 25.0, 17.0, 10.0, 6.0, 3.0, 0.5])
    heights = np.array([0.5, 4.0, 8.0, 13.0, 19.0, 26.0, 31.5, 35.0, 36.0, 36.0, 34.0, 28.0, 20.0, 12.0, 7.0, 3.0, 0.5])
    centres = np.array([66.0, 66, 66.5, 68, 71, 76, 81, 85, 86, 86, 88, 92, 97, 101, 103, 103, 103])
    dense = np.unique(np.concatenate([np.linspace(56, 576, 131), stations]))
    angles = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
    rounded = np.stack([_power(np.cos(angles), 0.8), _power(np.sin(angles), 0.8)], 1)
    sections = np.empty((len(dense), len(angles), 3))
    for index, station in enumerate(dense):
        width, height, centre = (np.interp(station, stations, table) for table in (widths, heights, centres))
        sections[index, :, 0] = station
        sections[index, :, 1] = width * rounded[:, 0]
        sections[index, :, 2] = centre + height * rounded[:, 1]
    mesh = loft(body_point(sections), WHITE)
    level = np.tile(np.sin(angles), len(dense))
    along = np.repeat(dense, len(angles))
    colours = mesh.colours
    skin = colours[: len(level)]
    skin[(level > -0.42) & (level < -0.12), :3] = BLUE
    windscreen = (along > 108) & (along < 142) & (level > 0.30) & (level < 0.97)
    cabin = (along > 150) & (along < 178) & (level > 0.32) & (level < 0.75)
    skin[windscreen | cabin, :3] = GLASS
    return mesh


def wing() -> Mesh:
    """Wing from tip to tip: constant chord, 23 % thick, swept forward, with dihedral, cut out for its flaps."""
    whole = _airfoil(_WING_CHORD, 0.23, 28)
    half = [(_ROOT, whole), *((span, _front(whole)) for span in _CUTS), (193.0, whole)]
    sections = [_wing_section(-span, outline) for span, outline in half[::-1]]
    sections += [_wing_section(span, outline) for span, outline in half]
    return loft(body_point(np.stack(sections)), WHITE)


def tail() -> Mesh:
    """Horizontal tail with its two fins, cut out for elevator and rudders."""
    front = _front(_airfoil(_TAIL_CHORD, 0.15, 20), _TAIL_CUT)
    parts = [loft(body_point(np.stack([_tail_section(span, front) for span in (-77.0, 0.0, 77.0)])), WHITE)]
    for side in (-1.0, 1.0):
        fin = [_fin_section(side, level) for level in _FIN_LEVELS[:2]]
        fin += [_fin_section(side, level, part=_front) for level in _FIN_LEVELS[1:]]
        parts.append(loft(body_point(np.stack(fin)), BLUE))
    return merge(parts)


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """A part that turns about a hinge; at 0 it fills its cut-out."""

    mesh: Mesh
    """The part, about ``place``."""
    place: FloatArray
    """A point of the hinge in the body frame [m]."""
    axis: FloatArray
    """Direction of the hinge; a positive angle takes the trailing edge down, or to the right."""


def flap(side: float) -> Surface:
    """The inboard flap of one side.

    Args:
        side: 1 right, -1 left.
    """
    return _wing_surface(side, _CUTS[0], _CUTS[1])


def flaperon(side: float) -> Surface:
    """The flaperon of one side.

    Args:
        side: 1 right, -1 left.
    """
    return _wing_surface(side, _CUTS[2], _CUTS[3])


def elevator() -> Surface:
    """The elevator."""
    back = _back(_airfoil(_TAIL_CHORD, 0.15, 20), _TAIL_CUT)
    sections = np.stack([_tail_section(span, back) for span in (-75.0, 75.0)])
    hinge = [np.array([548.0 + _TAIL_CUT * _TAIL_CHORD, span, 103.0]) for span in (-75.0, 75.0)]
    return _surface(sections, hinge, GREY)


def rudder(side: float) -> Surface:
    """The rudder of one fin, on its upper half.

    Args:
        side: 1 right, -1 left.
    """
    lower, upper = _FIN_LEVELS[1:]
    sections = np.stack([_fin_section(side, level, part=_back) for level in (lower, upper)])
    hinge = [np.array([546.0 + edge + _CUT * chord, 77.0 * side, level]) for level, edge, chord in (lower, upper)]
    return _surface(sections, hinge, WHITE)


def nacelle() -> Mesh:
    """One nacelle with spinner, in the nacelle frame."""
    along = np.array([-2.15, -2.1, -1.8, -1.3, -0.6, 0.1, 0.6, 0.95, 1.12])
    radii = np.array([0.10, 0.22, 0.33, 0.41, 0.46, 0.46, 0.42, 0.34, 0.29])
    spinner_along = np.array([1.12, 1.25, 1.42, 1.58, 1.70, 1.76])
    spinner_radii = np.array([0.28, 0.27, 0.23, 0.16, 0.08, 0.01])
    exhaust = _turned(np.array([-2.3, -2.1]), np.array([0.17, 0.2]), (1.0, 1.0))
    return merge(
        [
            loft(_turned(along, radii, (0.92, 1.12)), GREY),
            loft(_turned(spinner_along, spinner_radii, (1.0, 1.0)), BLUE),
            loft(exhaust, DARK),
        ]
    )


def blades(direction: float) -> Mesh:
    """The blades of one rotor in the hub frame, twisted, tips yellow.

    Args:
        direction: 1 where the rotor turns right-handed about the mast, -1 where left-handed.
    """
    stations = np.linspace(0.09, 1.0, 12)
    parts = []
    for number in range(BLADE_COUNT):
        azimuth = 2.0 * np.pi * number / BLADE_COUNT
        radial = np.array([0.0, np.cos(azimuth), np.sin(azimuth)])
        sections = np.empty((len(stations), 16, 3))
        for section, station in zip(sections, stations, strict=True):
            twist = np.radians(40.0 * (0.75 - station))
            ahead = direction * np.array([0.0, -radial[2], radial[1]])
            chordwise = -np.cos(twist) * ahead - np.sin(twist) * np.array([1.0, 0, 0])  # leading edge up
            normal = np.cross(radial, chordwise)
            outline = _airfoil(0.42, 0.14, 16)
            section[:] = (
                station * ROTOR_RADIUS * radial
                + np.outer(outline[:, 0] - 0.12, chordwise)
                + np.outer(outline[:, 2], normal)
            )
        mesh = loft(sections, (225, 228, 232))
        tip = np.linalg.norm(mesh.vertices, axis=1) > 0.93 * ROTOR_RADIUS
        mesh.colours[tip, :3] = (250, 205, 60)
        parts.append(mesh)
    return merge(parts)


def disc(colour: Colour) -> Mesh:
    """A rotor disc in the hub frame.

    Args:
        colour: Its colour.
    """
    rim = circle(96)[:-1]
    vertices = np.concatenate([np.zeros((1, 3)), rim])
    around = np.arange(1, len(rim) + 1)
    triangles = np.stack([np.zeros(len(rim), dtype=int), around, np.roll(around, -1)], 1)
    colours = np.tile(np.array([*colour, 255], dtype=np.uint8), (len(vertices), 1))
    normals = np.tile([1.0, 0.0, 0.0], (len(vertices), 1))
    return Mesh(vertices, triangles.astype(np.uint32), normals, colours)


def body_point(stations: FloatArray) -> FloatArray:
    """Body axes about the centre of gravity SL 301.2, WL 81.65 [m].

    Args:
        stations: SL, BL, WL in the last axis [in].
    """
    sl, bl, wl = stations[..., 0], stations[..., 1], stations[..., 2]
    return np.stack([(301.2 - sl) * INCH, bl * INCH, (81.65 - wl) * INCH], -1)


def circle(points: int) -> FloatArray:
    """The rim of a rotor disc in the hub frame, closed, shape (points + 1, 3) [m].

    Args:
        points: Number of different points.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, points + 1)
    return ROTOR_RADIUS * np.stack([np.zeros_like(angle), np.cos(angle), np.sin(angle)], 1)


_WING_CHORD, _TAIL_CHORD = 63.0, 47.0
_CUT, _TAIL_CUT = 0.75, 0.7
"""Where along the chord flaps, flaperons and rudders, and where the elevator, begin."""
_ROOT = 35.0
_CUTS = (36.0, 96.0, 98.0, 192.0)
"""BL of the ends of flap and flaperon [in]."""
_FIN_LEVELS = ((66.0, 20.0, 34.0), (103.0, 0.0, 50.0), (160.0, 24.0, 32.0))
"""WL, leading edge behind SL 546, chord [in]."""


def _front(outline: FloatArray, cut: float = _CUT) -> FloatArray:
    """A section without what is behind a share of its chord."""
    return np.stack([np.minimum(outline[:, 0], cut * outline[:, 0].max()), outline[:, 1], outline[:, 2]], 1)


def _back(outline: FloatArray, cut: float = _CUT) -> FloatArray:
    """What is behind a share of a section's chord."""
    edge = cut * outline[:, 0].max()
    inside = np.sort(outline[outline[:, 0] >= edge, 2])
    return np.stack([np.maximum(outline[:, 0], edge), outline[:, 1], np.clip(outline[:, 2], inside[0], inside[-1])], 1)


def _wing_section(span: float, outline: FloatArray) -> FloatArray:
    """A section at a BL [in]: leading edge swept 6.5 deg forward, 1.2 deg dihedral to WL 100 at the tip."""
    edge: FloatArray = np.array([297.4 - 0.114 * abs(span), span, 96.0 + 0.0209 * abs(span)])
    return outline + edge


def _tail_section(span: float, outline: FloatArray) -> FloatArray:
    edge: FloatArray = np.array([548.0, span, 103.0])
    return outline + edge


def _fin_section(
    side: float, level: tuple[float, float, float], *, part: Callable[[FloatArray], FloatArray] | None = None
) -> FloatArray:
    height, edge, chord = level
    outline = _airfoil(chord, 0.09, 20)
    if part is not None:
        outline = part(outline)
    return np.stack([outline[:, 0] + 546.0 + edge, 77.0 * side + outline[:, 2], np.full(len(outline), height)], 1)


def _wing_surface(side: float, inner: float, outer: float) -> Surface:
    """Flap or flaperon between two BL; its hinge runs to the right on both sides."""
    spans = sorted((side * inner, side * outer))
    back = _back(_airfoil(_WING_CHORD, 0.23, 28))
    hinge = [_wing_section(span, np.array([[_CUT * _WING_CHORD, 0.0, 0.0]]))[0] for span in spans]
    return _surface(np.stack([_wing_section(span, back) for span in spans]), hinge, GREY)


def _surface(sections: FloatArray, hinge: list[FloatArray], colour: Colour) -> Surface:
    """What is lofted through sections [in], turning about the line from the first point of the hinge to the second."""
    first, second = (body_point(point) for point in hinge)
    axis = (second - first) / np.linalg.norm(second - first)
    return Surface(loft(body_point(sections) - first, colour), first, axis)


def _power(value: FloatArray, exponent: float) -> FloatArray:
    return np.sign(value) * np.abs(value) ** exponent


def _airfoil(chord: float, thickness: float, points: int) -> FloatArray:
    """A symmetric four-digit section in the x-z plane, leading edge at the origin, shape (points, 3)."""
    angle = np.linspace(0.0, 2.0 * np.pi, points + 1)[:-1]
    x = 0.5 * (1.0 + np.cos(angle))
    half = 5.0 * thickness * (0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)
    return chord * np.stack([x, np.zeros_like(x), np.sign(np.sin(angle)) * half], 1)


def _turned(along: FloatArray, radii: FloatArray, axes: tuple[float, float]) -> FloatArray:
    """Elliptic sections about the x axis; ``axes`` scales the radius in y and z."""
    angle = np.linspace(0.0, 2.0 * np.pi, 33)[:-1]
    ring = np.stack([np.zeros_like(angle), axes[0] * np.cos(angle), axes[1] * np.sin(angle)], 1)
    return np.stack([radius * ring + np.array([x, 0.0, 0.0]) for x, radius in zip(along, radii, strict=True)])


def _finish(vertices: FloatArray, triangles: npt.NDArray[np.int64], colour: Colour) -> Mesh:
    """Normals as the mean of the adjoining faces, turned outwards as a whole."""
    corners = vertices[triangles]
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    volume = float((faces * corners[:, 0]).sum())
    if volume < 0.0:
        triangles, faces = triangles[:, ::-1], -faces
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, triangles[:, corner], faces)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    colours = np.tile(np.array([*colour, 255], dtype=np.uint8), (len(vertices), 1))
    return Mesh(vertices, triangles.astype(np.uint32), normals, colours)
