"""The flight from above, and the marks along a path."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.units import KNOT
from telemetry.log.reader import FlightLog

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TRACK = "#1f6fb4"
"""Colour of the track."""
_POINTS = 2500
_WIND_M_S = 0.5
"""Wind that is drawn from here on [m/s]."""


def draw_track(log: FlightLog, figure: Figure) -> None:
    """The flight from above: north up, one scale, with the aircraft's heading at marked times, and the wind.

    Args:
        log: The flight.
        figure: Where it is drawn.
    """
    axes = figure.subplots()
    north, east = log["north_m"], log["east_m"]
    every = max(1, len(north) // _POINTS)
    axes.plot(east[::every], north[::every], color=TRACK, linewidth=1.8, label="track over the ground")
    reach = max(float(np.ptp(east)), float(np.ptp(north)), 10.0)
    for index, words in marked(log["time_s"], (east, north), (0.06 * reach, 0.03 * reach)):
        place = np.array([east[index], north[index]])
        for line in _plan(place, float(log["heading_deg"][index]), 0.02 * reach):
            axes.plot(*line, color="#222222", linewidth=1.5)
        axes.annotate(
            words, tuple(place), xytext=(9, 9), textcoords="offset points", fontsize=7,
            bbox={"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 0.5},
        )  # fmt: skip
    half = 0.58 * reach
    for middle, limits in ((east, axes.set_xlim), (north, axes.set_ylim)):
        centre = 0.5 * (float(middle.min()) + float(middle.max()))
        limits(centre - half, centre + half)
    axes.set_aspect("equal")
    axes.set_xlabel("east of the start [m]")
    axes.set_ylabel("north of the start [m]")
    axes.set_title("Track over the ground, and the aircraft with its heading", loc="left")
    _draw_wind(axes, log)


def _plan(place: FloatArray, heading_deg: float, size: float) -> Iterable[FloatArray]:
    """The aircraft from above, as lines of shape (2, points), east and north: body, wing, tail.

    Args:
        place: East and north of it [m].
        heading_deg: Heading [deg].
        size: About half its length [m].
    """
    heading = np.radians(heading_deg)
    ahead, right = np.array([np.sin(heading), np.cos(heading)]), np.array([np.cos(heading), -np.sin(heading)])
    for (start, left), (end, across) in (((-1.2, 0), (1.2, 0)), ((0.3, -1.2), (0.3, 1.2)), ((-1.1, -0.5), (-1.1, 0.5))):
        corners = [place + size * (along * ahead + aside * right) for along, aside in ((start, left), (end, across))]
        yield np.stack(corners, 1)


def _draw_wind(axes: Axes, log: FlightLog) -> None:
    """The mean wind as an arrow in the corner, and where it comes from."""
    north, east = float(np.mean(log["wind_north_m_s"])), float(np.mean(log["wind_east_m_s"]))
    speed = float(np.hypot(north, east))
    if speed < _WIND_M_S:
        return
    origin = round(np.degrees(np.arctan2(-east, -north))) % 360
    right, up = 0.035 * east / speed, 0.035 * north / speed
    axes.annotate(
        "", (0.93 + right, 0.93 + up), xytext=(0.93 - right, 0.93 - up), xycoords="axes fraction",
        textcoords="axes fraction", arrowprops={"arrowstyle": "->", "color": "#2a7f9d", "linewidth": 1.6},
    )  # fmt: skip
    axes.text(
        0.975, 0.86, f"wind {origin:03d}/{speed / KNOT:.0f} kn", transform=axes.transAxes, ha="right", fontsize=8,
        color="#2a7f9d",
    )  # fmt: skip


def marked(
    time: FloatArray, path: tuple[FloatArray, FloatArray], near: tuple[float, float]
) -> Iterable[tuple[int, str]]:
    """Points of a path to mark, and their times in words; points that would cover one another become one.

    Args:
        time: Times [s].
        path: Both coordinates of the path.
        near: Distance in each coordinate within which marks cover one another.
    """
    step = mark_step(float(time[-1] - time[0]))
    places: list[tuple[int, list[float]]] = []
    for mark in np.arange(time[0], time[-1] + 1e-9, step):
        index = min(int(np.searchsorted(time, mark)), len(time) - 1)
        covered = [
            marks
            for place, marks in places
            if all(abs(values[place] - values[index]) < least for values, least in zip(path, near, strict=True))
        ]
        if covered:
            covered[0].append(float(mark))
        else:
            places.append((index, [float(mark)]))
    for index, marks in places:
        yield index, _in_words(marks, step)


def _in_words(marks: list[float], step: float) -> str:
    """Times at one place: "5 s", "5 to 20 s" where it was kept, "5, 40 to 60 s" where the path came back to it."""
    ends = np.flatnonzero(np.diff(marks) > 1.5 * step) + 1
    stays = [f"{stay[0]:.0f}" + (f" to {stay[-1]:.0f}" if len(stay) > 1 else "") for stay in np.split(marks, ends)]
    return f"{', '.join(stays)} s"


def mark_step(duration_s: float) -> float:
    """Seconds between the marks on the path: about eight of them.

    Args:
        duration_s: Length of the flight [s].
    """
    return next((step for step in (1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0) if duration_s / step <= 8.0), 300.0)
