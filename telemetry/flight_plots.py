"""Pictures of a recorded flight: path through the corridor, time histories with units, controls, margins, timing."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rtsim.errors import InputError, OutputError
from rtsim.frame import FloatArray
from telemetry.log_export import write_and_rename
from telemetry.log_reader import FlightLog
from telemetry.signal_groups import label, plot_groups

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_Picture = tuple[str, "Callable[[FlightLog, Figure], None]", tuple[float, float]]

FORMATS = ("svg", "png")
"""Every picture is written in each of these."""

_POINTS = 2500
_COLOURS = ("#1f6fb4", "#e07b00", "#2a9d54", "#b0309a", "#6a51c4", "#0f9b9b", "#a05a2c", "#444444", "#c23b3b")
_LOW, _HIGH, _INSIDE = "#d98a00", "#d03c3c", "#2a9d54"
_LEVELS = ((-np.inf, 0.0, "#d03c3c"), (0.0, 4.0, "#f08030"), (4.0, 10.0, "#f5c842"))


@dataclass(frozen=True, slots=True)
class _Panel:
    """One pair of axes: signals of one unit; references are dashed."""

    title: str
    signals: tuple[str, ...]
    dashed: tuple[str, ...] = ()


_FLIGHT = (
    _Panel("Airspeed", ("airspeed_kt",), ("airspeed_reference_kt",)),
    _Panel("Nacelle angle", ("nacelle_deg",), ("nacelle_reference_deg",)),
    _Panel("Altitude", ("altitude_m",), ("altitude_reference_m",)),
    _Panel("Attitude", ("pitch_deg", "angle_of_attack_deg", "flight_path_deg")),
)
_CONTROLS = (
    _Panel("Stick, forward positive", ("stick",), ("pilot_stick",)),
    _Panel("Power lever", ("lever",), ("pilot_lever",)),
    _Panel("Collective at 75 % radius", ("collective_75_deg",)),
    _Panel("Cyclic and elevator", ("cyclic_deg", "elevator_deg")),
)
_ROTOR = (
    _Panel("Flapping", ("flapping_deg", "longitudinal_flapping_deg", "lateral_flapping_deg")),
    _Panel("Torque of one mast", ("mast_torque_inlb",)),
    _Panel("Power", ("power_shp", "engine_power_shp")),
    _Panel("Load factor", ("load_factor",)),
)


def plot_flight(log: FlightLog, directory: str | os.PathLike[str]) -> list[Path]:
    """Draw a flight.

    Args:
        log: The flight; what it does not hold (boundaries, timing) is left out.
        directory: Where the pictures go; it is made if needed, pictures of the same name are replaced.

    Returns:
        The files written, SVG and PNG of each picture.

    Raises:
        InputError: The log holds no frames.
        OutputError: The pictures cannot be written.
    """
    if len(log.rows) < 2:
        raise InputError("the log holds no flight to draw", file=str(log.path), mend="record a longer flight")
    out = Path(directory)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as failure:
        raise OutputError(f"{out}: cannot be made ({failure.strerror}); choose another directory.") from failure
    files: list[Path] = []
    for name, draw, size in _pictures(log):
        files += _write(log, out / name, draw=draw, size=size)
    return files


def _pictures(log: FlightLog) -> list[_Picture]:
    """Name, drawing function and size [in] of every picture that this flight gives."""
    pictures: list[_Picture] = [
        ("corridor", _draw_corridor, (7.5, 6.5)),
        ("flight", lambda flight, figure: _draw_panels(flight, figure, _FLIGHT), (9.0, 9.0)),
        ("controls", lambda flight, figure: _draw_panels(flight, figure, _CONTROLS), (9.0, 9.0)),
        ("flapping", lambda flight, figure: _draw_panels(flight, figure, _ROTOR), (9.0, 9.0)),
        ("margins", _draw_margins, (9.0, 6.0)),
        ("signals", _draw_all_signals, (15.0, 18.0)),
    ]
    if np.isfinite(log["lateness_us"]).any():
        pictures.append(("timing", _draw_timing, (9.0, 7.0)))
    return pictures


def _write(
    log: FlightLog, target: Path, *, draw: Callable[[FlightLog, Figure], None], size: tuple[float, float]
) -> Iterable[Path]:
    """Draw one picture into its files, with a figure of its own: no global state, no window."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    style: dict[Any, Any] = {
        "axes.grid": True,
        "grid.alpha": 0.35,
        "font.size": 9.0,
        "axes.titlesize": 10.0,
        "svg.hashsalt": "rtsim",
    }
    with mpl.rc_context(style):
        figure = Figure(figsize=size, layout="constrained")
        FigureCanvasAgg(figure)
        draw(log, figure)
        figure.suptitle(f"{log.metadata.scenario_name} ({log.path.name})", fontsize=11)
        for ending in FORMATS:
            path = target.with_suffix(f".{ending}")
            # Without its date the same flight gives the same file.
            options: dict[str, Any] = {"metadata": {"Date": None}} if ending == "svg" else {"dpi": 130}
            write_and_rename(path, partial(figure.savefig, **options))
            yield path


def _thin(values: FloatArray) -> FloatArray:
    """Every so manieth value, so that a picture of a long flight stays small."""
    return values[:: max(1, len(values) // _POINTS)]


def _curve(axes: Axes, log: FlightLog, name: str, *, colour: str, dashed: bool = False) -> None:
    axes.plot(
        _thin(log["time_s"]),
        _thin(log[name]),
        color=colour,
        linewidth=1.0 if dashed else 1.4,
        linestyle="--" if dashed else "-",
        label=label(name),
    )


def _legend(axes: Axes, *, size: float = 8.0) -> None:
    """Names above the axes on the right, where they cover no curve."""
    count = len(axes.get_lines())
    axes.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=count,
        frameon=False,
        fontsize=size,
        borderpad=0.0,
        borderaxespad=0.2,
        columnspacing=1.0,
        handlelength=1.4,
    )


def _draw_panels(log: FlightLog, figure: Figure, panels: tuple[_Panel, ...]) -> None:
    rows = figure.subplots(len(panels), 1, sharex=True)
    for axes, panel in zip(rows, panels, strict=True):
        for colour, name in zip(_COLOURS, panel.signals, strict=False):
            _curve(axes, log, name, colour=colour)
        for name in panel.dashed:
            _curve(axes, log, name, colour="#444444", dashed=True)
        unit = log.unit(panel.signals[0])
        axes.set_title(panel.title, loc="left")
        axes.set_ylabel(unit or "-")
        _legend(axes)
    rows[-1].set_xlabel("time [s]")


def _draw_corridor(log: FlightLog, figure: Figure) -> None:
    axes = figure.subplots()
    outline = log.metadata.corridor
    if outline is not None:
        axes.plot(outline.low_kt, outline.low_nacelle_deg, color=_LOW, linewidth=2.0, label="low-speed boundary")
        axes.plot(outline.high_kt, outline.high_nacelle_deg, color=_HIGH, linewidth=2.0, label="high-speed boundary")
        if outline.centre_kt:
            axes.plot(outline.centre_kt, outline.centre_nacelle_deg, "--", color="#777777", label="centre line")
        axes.set_title(f"Conversion corridor '{outline.name}'")
    speed, nacelle = log["airspeed_kt"], log["nacelle_deg"]
    axes.plot(
        _thin(log["airspeed_reference_kt"]), _thin(log["nacelle_reference_deg"]), color="#444444", linewidth=0.9,
        linestyle=":", label="reference",
    )  # fmt: skip
    axes.plot(_thin(speed), _thin(nacelle), color=_COLOURS[0], linewidth=1.8, label="flown")
    time = log["time_s"]
    for mark in np.arange(time[0], time[-1] + 1e-9, _mark_step(float(time[-1] - time[0]))):
        index = min(int(np.searchsorted(time, mark)), len(time) - 1)
        axes.plot(speed[index], nacelle[index], "o", color=_COLOURS[0], markersize=3.5)
        axes.annotate(
            f"{mark:.0f} s", (speed[index], nacelle[index]), textcoords="offset points", xytext=(5, 5), fontsize=7
        )
    axes.set_xlabel("airspeed [kn]")
    axes.set_ylabel("nacelle angle [deg], 90 helicopter")
    axes.set_ylim(-5.0, 100.0)
    axes.legend(loc="lower left", fontsize=8)


def _draw_margins(log: FlightLog, figure: Figure) -> None:
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[2.0, 1.0])
    _curve(upper, log, "margin_low_kt", colour=_LOW)
    _curve(upper, log, "margin_high_kt", colour=_HIGH)
    _curve(upper, log, "margin_kt", colour="#222222", dashed=True)
    floor = min(0.0, float(log["margin_kt"].min())) - 3.0
    for low, high, colour in _LEVELS:
        upper.axhspan(max(low, floor), high, color=colour, alpha=0.18, linewidth=0)
    upper.set_ylim(bottom=floor)
    upper.set_ylabel("margin [kn]")
    upper.set_title("Margins; shaded: caution, warning, outside", loc="left")
    _legend(upper)
    lower.step(_thin(log["time_s"]), _thin(log["corridor_level"]), where="post", color="#222222")
    lower.set_yticks([0, 1, 2, 3], ["clear", "caution", "warning", "exceedance"])
    lower.set_ylim(-0.3, 3.3)
    lower.set_xlabel("time [s]")


def _draw_all_signals(log: FlightLog, figure: Figure) -> None:
    """One plot for every group and unit, so that nothing recorded goes unseen."""
    groups = [group for group in plot_groups() if not group.path.startswith("plots/loop")]
    grid = figure.subplots(-(-len(groups) // 3), 3, sharex=True).ravel()
    for axes, group in zip(grid, groups, strict=False):
        for index, column in enumerate(group.columns):
            _curve(axes, log, log.names[column], colour=_COLOURS[index % len(_COLOURS)])
        axes.set_title(group.title, loc="left", fontsize=8.5)
        if len(group.columns) > 3:
            axes.legend(loc="center right", fontsize=6.5, framealpha=0.6)
        else:
            _legend(axes, size=6.5)
    for axes in grid[len(groups) :]:
        axes.set_visible(False)
    for axes in grid[: len(groups)][-3:]:
        axes.set_xlabel("time [s]")
        axes.xaxis.set_tick_params(labelbottom=True)


def _draw_timing(log: FlightLog, figure: Figure) -> None:
    upper, lower = figure.subplots(2, 1)
    time = log["time_s"]
    for colour, name in zip(_COLOURS, ("lateness_us", "work_us", "work_cpu_us"), strict=False):
        values = log[name]
        upper.plot(time, values, ".", markersize=1.5, color=colour, label=label(name), rasterized=True)
        good = values[np.isfinite(values) & (values > 0.0)]
        if len(good):
            lower.hist(
                good,
                bins=np.geomspace(max(0.5, good.min()), good.max() + 1.0, 80),
                histtype="step",
                color=colour,
                label=f"{label(name)}: p50 {np.median(good):.0f}, p99 {np.percentile(good, 99):.0f}",
            )
    upper.set_yscale("symlog", linthresh=10.0)
    upper.set_ylabel("us")
    upper.set_xlabel("time [s]")
    upper.set_title(f"Loop timing; overruns: {np.nanmax(log['overruns']):.0f}", loc="left")
    upper.legend(loc="upper right", fontsize=8, markerscale=6)
    lower.set_xscale("log")
    lower.set_yscale("log")
    lower.set_xlabel("us")
    lower.set_ylabel("frames")
    lower.legend(loc="upper right", fontsize=8)


def _mark_step(duration_s: float) -> float:
    """Seconds between the marks on the path: about eight of them."""
    return next((step for step in (1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0) if duration_s / step <= 8.0), 300.0)
