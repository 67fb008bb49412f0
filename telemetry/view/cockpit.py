"""What the pilot sees of the own aircraft: a glare shield and the posts of the windscreen, drawn by eye."""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun as rr

EYE = (4.2, 0.35, -0.62)
"""The pilot's eye in the body frame: right seat, about the centre of gravity [m]."""
LOOKS_DOWN = 0.07
"""How far the eye looks below the nose, a metre ahead [m]."""

_SHIELD, _EDGE, _POST = (26, 29, 34), (44, 48, 55), (34, 38, 44)


def frame() -> Any:
    """Glare shield and posts as one mesh in the body frame."""
    ahead, _, down = EYE
    points: list[tuple[float, float, float]] = []
    triangles: list[list[int]] = []
    colours: list[tuple[int, int, int, int]] = []

    def face(corners: list[tuple[float, float, float]], colour: tuple[int, int, int]) -> None:
        first = len(points)
        points.extend(corners)
        colours.extend([(*colour, 255)] * 4)
        triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]])

    x, low = ahead + 0.9, down + 0.36
    face([(x, -1.1, low), (x, 1.1, low), (x - 0.35, 1.25, low + 0.06), (x - 0.35, -1.25, low + 0.06)], _EDGE)
    face(
        [(x - 0.35, -1.25, low + 0.06), (x - 0.35, 1.25, low + 0.06), (x - 0.3, 1.2, 2.0), (x - 0.3, -1.2, 2.0)],
        _SHIELD,
    )
    for foot, head in (((0.95, -1.0), (0.35, -0.62)), ((1.0, -0.05), (0.45, -0.04)), ((0.95, 0.95), (0.35, 0.66))):
        wide = 0.028
        bottom, top = (ahead + foot[0], foot[1], low), (ahead + head[0], head[1], down - 0.55)
        face(
            [
                (bottom[0], bottom[1] - wide, bottom[2]),
                (bottom[0], bottom[1] + wide, bottom[2]),
                (top[0], top[1] + wide, top[2]),
                (top[0], top[1] - wide, top[2]),
            ],
            _POST,
        )
    return rr.Mesh3D(
        vertex_positions=np.array(points, dtype=np.float32), triangle_indices=triangles, vertex_colors=colours
    )
