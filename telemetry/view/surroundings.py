"""What is around the aircraft and never changes: sky, sun, hills, ground, trees, runway, compass rose; logged once.

Three frames carry it: ``world/horizon`` goes along with the aircraft without turning, so that what is far stays far;
``world/ground`` moves in steps of its own pattern, which nobody sees; ``world/runway`` stands where the flight began.
The ground that is flown over is flat, as in the simulation; hills stand at the horizon. No random numbers but seeded.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import rerun as rr

from rtsim.arrays import FloatArray
from telemetry.view.colours import AMBER, TEXT
from telemetry.view.strokes import LineArt

PATTERN = 1000.0
"""The ground repeats itself after this [m]."""
SUN = (math.radians(38.0), math.radians(8.5))
"""Where the sun stands: azimuth from north, elevation [rad]."""
RUNWAY_LENGTH = 3000.0
"""Length of the runway [m]; a road goes on along it."""

_ROAD_LENGTH = 20_000.0
_SKY_RADIUS, _SUN_DISTANCE = 60_000.0, 50_000.0
_SKY = ((-4.0, (206, 216, 222)), (0.0, (206, 216, 222)), (4.0, (176, 202, 226)), (15.0, (118, 166, 214)),
        (40.0, (72, 126, 190)), (90.0, (44, 92, 158)))  # fmt: skip
"""Elevation [deg] and colour."""
_FIELD = (92, 108, 68)
_PLAIN = ((0.0, _FIELD), (2500.0, _FIELD), (5000.0, (104, 120, 88)), (10_000.0, (134, 148, 130)),
          (20_000.0, (172, 184, 184)), (45_000.0, (206, 216, 222)))  # fmt: skip
"""Distance [m] and colour."""
_HILLS = ((26_000.0, 1100.0, (152, 172, 196), 5), (15_000.0, 380.0, (120, 142, 138), 9))
"""Distance and height [m], colour and coarseness of each range."""
_TREES = 70
_TILES = 5


def sky() -> Any:
    """A dome, pale at the horizon and blue above."""
    levels = np.array([-4.0, 0.0, 1.5, 4.0, 8.0, 15.0, 25.0, 40.0, 60.0, 90.0])
    return _rings([(_SKY_RADIUS, math.radians(level), _mixed(_SKY, level)) for level in levels])


def plain() -> Any:
    """The ground as far as it can be seen, paler with distance."""
    reaches = [0.0, 2500.0, 3500.0, 5000.0, 7000.0, 10_000.0, 14_000.0, 20_000.0, 30_000.0, 45_000.0]
    points, colours = [], []
    angle = np.linspace(0.0, 2.0 * np.pi, 65)[:-1]
    for reach in reaches:
        points.append(np.stack([reach * np.cos(angle), reach * np.sin(angle), np.full_like(angle, 0.9)], 1))
        colours.append(np.tile(_mixed(_PLAIN, reach), (len(angle), 1)))
    return _skin(np.array(points), np.array(colours))


def hills(number: int) -> Any:
    """A range of hills around the horizon.

    Args:
        number: 0 the far one, 1 the near one.
    """
    distance, height, colour, coarse = _HILLS[number]
    angle = np.linspace(0.0, 2.0 * np.pi, 241)[:-1]
    random = np.random.default_rng(number + 1)
    shape = np.zeros_like(angle)
    for wave in range(1, 8):
        count = coarse * wave + int(random.integers(0, 4))
        shape += np.sin(count * angle + random.uniform(0.0, 6.3)) / wave**1.1
    shape = np.clip(0.35 + 0.4 * shape, 0.02, 1.2)
    ring = np.stack([distance * np.cos(angle), distance * np.sin(angle)], 1)
    points = np.array([np.column_stack([ring, down]) for down in (np.full_like(angle, 1.5), -height * shape)])
    haze = np.array(_mixed(_PLAIN, distance))
    colours = np.array([np.tile(shade, (len(angle), 1)) for shade in (0.5 * haze + 0.5 * np.array(colour), colour)])
    return _skin(points, colours)


def sun() -> dict[str, Any]:
    """The sun and the light around it, by name; what is larger can be looked through."""
    azimuth, elevation = SUN
    towards = np.array(
        [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), -math.sin(elevation)]
    )
    right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    above = np.cross(towards, right)
    angle = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
    discs = {}
    for name, radius_deg, shade in (
        ("glow_5", 13.0, (255, 236, 190, 9)),
        ("glow_4", 9.0, (255, 238, 196, 11)),
        ("glow_3", 6.0, (255, 240, 200, 14)),
        ("glow_2", 3.8, (255, 244, 210, 24)),
        ("glow_1", 2.2, (255, 248, 226, 60)),
        ("disc", 1.1, (255, 252, 240, 255)),
    ):
        radius = _SUN_DISTANCE * math.tan(math.radians(radius_deg))
        rim = np.outer(np.cos(angle), right) + np.outer(np.sin(angle), above)
        points = np.vstack([np.zeros(3), radius * rim]) + (_SUN_DISTANCE - radius_deg * 100.0) * towards
        around = np.arange(1, len(angle) + 1)
        fan = np.stack([np.zeros_like(around), around, np.roll(around, -1)], 1)
        discs[name] = rr.Mesh3D(
            vertex_positions=points.astype(np.float32), triangle_indices=fan.astype(np.uint32), albedo_factor=shade
        )
    return discs


def fields() -> Any:
    """The fields around the aircraft: one square of the pattern, many times."""
    reach = 2.5 * PATTERN
    corners = np.array([[-reach, -reach, 0.5], [reach, -reach, 0.5], [reach, reach, 0.5], [-reach, reach, 0.5]])
    return rr.Mesh3D(
        vertex_positions=corners.astype(np.float32),
        triangle_indices=[[0, 1, 2], [0, 2, 3]],
        vertex_texcoords=(corners[:, :2] / PATTERN).astype(np.float32),
        albedo_texture=field_pattern(),
    )


def field_pattern(size: int = 384) -> np.ndarray:
    """One square of fields with hedges between them, shape (size, size, 3); it fits itself on all sides.

    Args:
        size: Points along a side.
    """
    random = np.random.default_rng(7)
    picture = np.empty((size, size, 3))
    shades = np.array([(92, 112, 66), (104, 116, 70), (82, 102, 62), (120, 118, 78), (86, 108, 76), (110, 104, 72)])

    def part(top: int, left: int, bottom: int, right: int, depth: int) -> None:
        tall, wide = bottom - top, right - left
        if depth == 0 or min(tall, wide) < 0.09 * size:
            shade = shades[random.integers(len(shades))] + random.uniform(-5.0, 5.0)
            stripes = 2.0 * np.sin(np.arange(max(wide, tall)) * 0.9)
            grain = random.normal(0.0, 2.2, (tall, wide)) + (stripes[:, None] if tall > wide else stripes[None, :])
            picture[top:bottom, left:right] = shade + grain[..., None]
            hedge = np.array((58, 76, 48))
            picture[top, left:right], picture[top:bottom, left] = hedge, hedge
            return
        cut = random.uniform(0.35, 0.65)
        if tall >= wide:
            middle = top + round(cut * tall)
            part(top, left, middle, right, depth - 1)
            part(middle, left, bottom, right, depth - 1)
        else:
            middle = left + round(cut * wide)
            part(top, left, bottom, middle, depth - 1)
            part(top, middle, bottom, right, depth - 1)

    part(0, 0, size, size, 6)
    return np.clip(picture, 0, 255).astype(np.uint8)


def trees() -> tuple[Any, Any]:
    """A tree, and where it stands how large: in clumps and hedges, none near the runway and what continues it."""
    random = np.random.default_rng(11)
    middles = random.uniform(0.0, PATTERN, (9, 2))
    places = (middles[random.integers(len(middles), size=_TREES)] + random.normal(0.0, 38.0, (_TREES, 2))) % PATTERN
    away = np.minimum(places[:, 1], PATTERN - places[:, 1])
    places = places[away > 90.0]
    steps = PATTERN * (np.arange(_TILES) - 0.5 * (_TILES - 1)) - 0.5 * PATTERN
    tiles = np.array([(x, y) for x in steps for y in np.round(steps / PATTERN) * PATTERN])
    where = (tiles[:, None, :] + places[None, :, :]).reshape(-1, 2)
    size = np.tile(random.uniform(0.7, 1.4, len(places)), len(tiles))
    angle = np.linspace(0.0, 2.0 * np.pi, 8)[:-1]
    rings = [(0.0, 1.6, 1.0), (-3.0, 3.6, 0.8), (-7.0, 3.0, 1.05), (-10.5, 0.2, 1.25)]  # down, radius, brightness
    points = np.array(
        [np.stack([r * np.cos(angle), r * np.sin(angle), np.full_like(angle, z)], 1) for z, r, _ in rings]
    )
    colours = np.array([np.tile(b * np.array((56.0, 78.0, 46.0)), (len(angle), 1)) for *_, b in rings])
    instances = rr.InstancePoses3D(
        translations=np.column_stack([where, np.full(len(where), 0.5)]).astype(np.float32),
        scales=np.repeat(size[:, None], 3, axis=1).astype(np.float32),
    )
    return _skin(points, colours), instances


def runway() -> dict[str, Any]:
    """The runway, its markings and the road that goes on from it, by name; north is along it."""
    start, half = -150.0, 15.0
    dashes = [[[x, 0.0, -0.1], [x + 30.0, 0.0, -0.1]] for x in np.arange(90.0, RUNWAY_LENGTH - 90.0, 60.0)]
    edges = [[[start, y, -0.1], [RUNWAY_LENGTH, y, -0.1]] for y in (0.9 * half, -0.9 * half)]
    keys = [
        [[x, y, -0.1], [x + 30.0, y, -0.1]]
        for x in (start + 6.0, RUNWAY_LENGTH - 36.0)
        for y in np.linspace(-0.75 * half, 0.75 * half, 8)
    ]
    aims = [[[x, y, -0.1], [x + 45.0, y, -0.1]] for x in (300.0, RUNWAY_LENGTH - 345.0) for y in (-6.0, 6.0)]
    circle = np.linspace(0.0, 2.0 * np.pi, 41)
    pad = [np.stack([11.0 * np.cos(circle), 11.0 * np.sin(circle), np.full_like(circle, -0.12)], 1)]
    pad += [np.array([[-4.5, y, -0.12], [4.5, y, -0.12]]) for y in (-3.0, 3.0)]
    pad += [np.array([[0.0, -3.0, -0.12], [0.0, 3.0, -0.12]])]
    lines: Any = [*dashes, *edges, *keys, *aims, *pad]
    radii = [0.45] * len(dashes) + [0.25] * 2 + [0.8] * len(keys) + [1.6] * len(aims) + [0.4] * len(pad)
    posts = np.arange(1000.0, _ROAD_LENGTH, 1000.0)
    return {
        "surface": rr.Mesh3D(**_rectangle(start, RUNWAY_LENGTH, half + 2.0, 0.1), albedo_factor=(74, 77, 82, 255)),
        "road": rr.Mesh3D(**_rectangle(RUNWAY_LENGTH, _ROAD_LENGTH, 4.0, 0.1), albedo_factor=(104, 102, 98, 255)),
        "marks": rr.LineStrips3D(lines, colors=[(228, 230, 232)], radii=radii),
        "posts": rr.LineStrips3D(
            [[[x, y, 0.0], [x, y, -12.0]] for x in posts for y in (-24.0, 24.0)], colors=[(255, 196, 60)], radii=[0.4]
        ),
    }


def compass_rose() -> Any:
    """A ring of radius 1 on the ground with marks every 30 degrees and the letters of the four quarters."""
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    strips = [np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], 1)]
    faint = (*TEXT, 150)
    colours: list[Any] = [faint]
    for degrees in range(0, 360, 30):
        outward = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees)), 0.0])
        strips.append(np.array([outward, 1.07 * outward]))
        colours.append(faint)
    for letter, degrees in (("N", 0), ("E", 90), ("S", 180), ("W", 270)):
        art = LineArt()
        art.text(letter, 0.0, 0.0, height=0.16, colour=TEXT, align="centre")
        outward = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees)), 0.0])
        right = np.array([-outward[1], outward[0], 0.0])
        for strip in art.strips:  # x right, y down the page: read with its quarter ahead
            strips.append(1.2 * outward + np.outer(strip[:, 0], right) - np.outer(strip[:, 1], outward))
            colours.append(AMBER if letter == "N" else faint)
    return rr.LineStrips3D(strips, colors=colours, radii=[-1.0])


def _mixed(stops: tuple[tuple[float, tuple[int, int, int]], ...], at: float) -> list[float]:
    """A colour between those that are given at some places."""
    places, colours = zip(*stops, strict=True)
    return [float(np.interp(at, places, channel)) for channel in zip(*colours, strict=True)]


def _rings(levels: list[tuple[float, float, list[float]]]) -> Any:
    """Circles of a sphere, each of radius, elevation and colour, skinned."""
    azimuth = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
    points = [
        radius
        * np.stack(
            [
                math.cos(level) * np.cos(azimuth),
                math.cos(level) * np.sin(azimuth),
                np.full_like(azimuth, -math.sin(level)),
            ],
            1,
        )
        for radius, level, _ in levels
    ]
    return _skin(np.array(points), np.array([np.tile(colour, (len(azimuth), 1)) for *_, colour in levels]))


def _skin(points: FloatArray, colours: FloatArray) -> Any:
    """A skin over closed rings of equally many points, with the light that its colours say: no normals, no shading."""
    rings, count, _ = points.shape
    around, following = np.arange(count), (np.arange(count) + 1) % count
    quads = [
        np.stack([start + around, start + following, start + count + around], 1)
        for start in count * np.arange(rings - 1)
    ] + [
        np.stack([start + following, start + count + following, start + count + around], 1)
        for start in count * np.arange(rings - 1)
    ]
    shades = np.full((rings * count, 4), 255, dtype=np.uint8)
    shades[:, :3] = np.clip(colours.reshape(-1, 3), 0, 255)
    return rr.Mesh3D(
        vertex_positions=points.reshape(-1, 3).astype(np.float32),
        triangle_indices=np.concatenate(quads).astype(np.uint32),
        vertex_colors=shades,
    )


def _rectangle(start: float, end: float, half_width: float, depth: float) -> dict[str, Any]:
    """A level rectangle, ``depth`` metres below the ground's zero so that lines lie on it."""
    corners = [
        [start, -half_width, depth],
        [end, -half_width, depth],
        [end, half_width, depth],
        [start, half_width, depth],
    ]
    return {"vertex_positions": corners, "triangle_indices": [[0, 1, 2], [0, 2, 3]]}
