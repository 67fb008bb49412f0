"""One look for all figures: colours, labels, the corridor, the corners of a path."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.corridor.boundaries import load_corridor
from rtsim.drawing import BLUE, GREY, REPORT_STYLE, drawing, save_both
from rtsim.optimization.path import ConversionPath
from rtsim.units import deg, to_kt
from scenarios.reproduction.study import Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FULL, HALF = (7.6, 4.6), (7.6, 3.4)
"""Sizes of figures [in]."""
_POINTS = 1500


@dataclass(frozen=True, slots=True)
class FigurePlan:
    """One figure of the paper, and how we draw ours."""

    number: int
    """Number in the paper."""
    title: str
    """Short title."""
    caption: str
    """What it shows, with what was flown."""
    draw: Callable[[Study, Figure], None]
    """Draws it on an empty figure."""
    size: tuple[float, float] = FULL
    """Width and height [in]."""

    @property
    def stem(self) -> str:
        """File name without ending."""
        return f"figure_{self.number:02d}"


def draw_corridor(axes: Axes, *, flight: bool = False) -> None:
    """Draw the boundaries of the design corridor, filled, with the axes of a path plot.

    Args:
        axes: Where.
        flight: Draw the low side flown in 1980 too.
    """
    design = load_corridor("design")
    nacelle = np.linspace(0.0, 90.0, 361)
    low = np.maximum(to_kt(1.0) * np.asarray(design.low.at(deg(1.0) * nacelle)), 0.0)
    high = to_kt(1.0) * np.asarray(design.high.at(deg(1.0) * nacelle))
    axes.fill_betweenx(nacelle, low, high, color="#eef4ee", zorder=0)
    axes.plot(low, nacelle, color="black", linewidth=1.2)
    axes.plot(high, nacelle, color="black", linewidth=1.2)
    if flight:
        line = load_corridor("flight").low
        tilted = np.linspace(0.0, 75.0, 301)
        speed = to_kt(1.0) * np.asarray(line.at(deg(1.0) * tilted))
        axes.plot(speed, tilted, color=GREY, linewidth=1.0, linestyle="--", label="power-on stall, 1980")
    axes.set(xlabel="airspeed, kn", ylabel="nacelle angle, deg", xlim=(-4, 182), ylim=(-4, 96), yticks=range(0, 91, 15))


def draw_path(
    axes: Axes, study: Study, name: str, *, colour: str = BLUE, label: str | None = None, corners: bool = True
) -> None:
    """Draw a flown path and the points it was asked to pass.

    Args:
        axes: Where, with airspeed across and nacelle angle up.
        study: What was flown.
        name: The path.
        colour: Its colour.
        label: Its entry in the legend.
        corners: Mark its points.
    """
    flight = study.flights[name]
    x, y = thin(flight["airspeed_kt"], flight["nacelle_deg"])
    axes.plot(x, y, color=colour, label=label)
    if corners:
        points = path_corners(study.paths[name])
        axes.plot(points[:, 0], points[:, 1], "o", color=colour, markersize=4.0, markerfacecolor="white")


def path_corners(path: ConversionPath) -> FloatArray:
    """The points of a path: airspeed [kn] and nacelle angle [deg], shape (points, 2).

    Args:
        path: The path.
    """
    return np.array([(point.airspeed_kt, point.nacelle_deg) for point in path.points])


def thin(*signals: FloatArray) -> tuple[FloatArray, ...]:
    """Every n-th value, so that a vector figure stays small; the extremes of each stretch are kept by the first signal.

    Args:
        *signals: Signals of one length.
    """
    step = max(1, signals[0].size // _POINTS)
    return tuple(signal[::step] for signal in signals)


def draw_signal(
    axes: Axes,
    study: Study,
    name: str,
    signal: str,
    *,
    colour: str = BLUE,
    label: str | None = None,
    scale: float = 1.0,
) -> None:
    """Draw a signal of a flight over time.

    Args:
        axes: Where.
        study: What was flown.
        name: The path.
        signal: The signal.
        colour: Its colour.
        label: Its entry in the legend.
        scale: Factor to the unit of the axis.
    """
    flight = study.flights[name]
    time, value = thin(flight.time, flight[signal])
    axes.plot(time, scale * value, color=colour, label=label)


def time_axis(axes: Axes, label: str, *, last: bool = True) -> None:
    """Label a time history.

    Args:
        axes: The axes.
        label: Quantity and unit.
        last: Whether it carries the label of the time axis.
    """
    axes.set_ylabel(label)
    axes.margins(x=0.0)  # limits set by hand would clip a longer flight drawn later
    if last:
        axes.set_xlabel("time, s")


def save_figures(
    study: Study, plans: Sequence[FigurePlan], directory: Path, *, drawn: Callable[[float, str], None]
) -> dict[int, list[Path]]:
    """Draw figures into files.

    Args:
        study: What was flown.
        plans: The figures.
        directory: Where they go; pictures of the same name are replaced.
        drawn: Called with 1 and words after each figure.

    Returns:
        The files of each figure by number, SVG first.

    Raises:
        OutputError: A picture cannot be written.
    """
    files: dict[int, list[Path]] = {}
    with drawing(**REPORT_STYLE):
        from matplotlib.figure import Figure

        for plan in plans:
            figure = Figure(figsize=plan.size, layout="constrained")
            figure.suptitle(f"Figure {plan.number}. {plan.title}", x=0.01, ha="left", fontsize=10.5)
            plan.draw(study, figure)
            files[plan.number] = list(save_both(figure, directory, plan.stem).values())
            drawn(1.0, "Drawing the figures")
    return files
