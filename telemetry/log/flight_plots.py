"""Pictures of a recorded flight: path through the corridor and over the ground, time histories, margins, timing."""

from __future__ import annotations

import functools
import os
import tomllib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.drawing import drawing
from rtsim.errors import InputError, OutputError
from rtsim.whole_file import whole_file
from telemetry.log.reader import FlightLog
from telemetry.log.signal_groups import label, plot_groups
from telemetry.log.track_plot import draw_track, marked

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from telemetry.log.corridor_outline import CorridorOutline

_Picture = tuple[str, "Callable[[FlightLog, Figure], None]", tuple[float, float]]

FORMATS = ("svg", "png")
"""Every picture is written in each of these."""

_POINTS = 2500
_NEAR_KT, _NEAR_DEG = 14.0, 3.0
_COLOURS = ("#1f6fb4", "#e07b00", "#2a9d54", "#b0309a", "#6a51c4", "#0f9b9b", "#a05a2c", "#444444", "#c23b3b")
_LOW, _HIGH, _INSIDE = "#d98a00", "#d03c3c", "#2a9d54"
_ACTING = "#b030c0"
_WORTH_SHOWING = 1.02
"""Load factor of a turn from which it is drawn: 11 deg of bank."""
_LEVELS = ((-np.inf, 0.0, "#d03c3c"), (0.0, 4.0, "#f08030"), (4.0, 10.0, "#f5c842"))


@dataclass(frozen=True, slots=True)
class _Panel:
    """One pair of axes: signals of one unit; references are dashed."""

    title: str
    signals: tuple[str, ...]
    dashed: tuple[str, ...] = ()
    reason: str = ""
    """Signal that says why protection changes this; the panel is shaded while it does."""


@dataclass(frozen=True, slots=True, eq=False)
class PropertyCurve:
    """How a flight stands to what was asked of it, over time."""

    formula: str
    """What was asked."""
    unit: str
    """Unit of its robustness."""
    robustness: FloatArray
    """Robustness in every frame, shape (frames,); negative: broken."""
    verdict: str
    """The whole flight's robustness, in words."""


_FLIGHT = (
    _Panel("Airspeed", ("airspeed_kt",), ("airspeed_reference_kt",)),
    _Panel("Nacelle angle, 90 helicopter", ("nacelle_deg",), ("nacelle_reference_deg",), "protection_nacelle_reason"),
    _Panel("Altitude", ("altitude_m",), ("altitude_reference_m",)),
    _Panel("Attitude", ("pitch_deg", "angle_of_attack_deg", "flight_path_deg")),
)
_CONTROLS = (
    _Panel("Stick, 1 is full forward", ("stick",), ("pilot_stick",), "protection_stick_reason"),
    _Panel("Power lever, 1 is full power", ("lever",), ("pilot_lever",), "protection_lever_reason"),
    _Panel("Collective at 75 % radius", ("collective_75_deg",)),
    _Panel("Cyclic and elevator", ("cyclic_deg", "elevator_deg")),
)
_LATERAL_CONTROLS = (
    _Panel(
        "Lateral stick, 1 is full right",
        ("lateral_stick",),
        ("pilot_lateral_stick",),
        "protection_lateral_stick_reason",
    ),
    _Panel("Pedals, 1 is full right", ("pedal",), ("pilot_pedal",), "protection_pedal_reason"),
)
_TRAVELS = ("stick", "lever", "lateral_stick", "pedal")
_COURSE = (
    _Panel("Bank, right positive", ("bank_deg",)),
    _Panel("Heading and course over the ground", ("heading_deg", "track_deg")),
    _Panel("Sideslip, wind from the right positive", ("sideslip_deg",)),
    _Panel("Sideward airspeed, right positive", ("lateral_kt",)),
    _Panel("Turn rate and rate of roll", ("turn_rate_deg_s", "roll_rate_deg_s")),
)
_COMPASS = ("heading_deg", "track_deg")
_ROTOR = (
    _Panel("Flapping", ("flapping_deg", "longitudinal_flapping_deg", "lateral_flapping_deg")),
    _Panel("Torque of one mast", ("mast_torque_inlb",)),
    _Panel("Power", ("power_shp", "engine_power_shp")),
    _Panel("Load factor", ("load_factor",)),
)
_BOTH_ROTORS = (
    _Panel("Flapping of each rotor", ("flapping_right_deg", "flapping_left_deg"), ("flapping_deg",)),
    _Panel("Torque of each mast", ("mast_torque_right_inlb", "mast_torque_left_inlb")),
)
_SIDEWAYS = ("bank_deg", "sideslip_deg", "turn_rate_deg_s")
_TOLD_OPTIONS = (("pilot", "pilot"), ("protection", "protection"), ("nacelle", "nacelles"))
"""Options of a flight that stand in the titles, and what they are called there."""
_NOTICED = 0.05
"""Bank, sideslip and turn rate from which on a flight is drawn as one that moved sideways [deg, deg/s]."""


def plot_flight(
    log: FlightLog,
    directory: str | os.PathLike[str],
    on_progress: Callable[[float, str], None] | None = None,
    *,
    properties: Sequence[PropertyCurve] = (),
) -> list[Path]:
    """Draw a flight.

    Args:
        log: The flight; what it does not hold (boundaries, timing) is left out.
        properties: What was asked of it; drawn where there is any.
        directory: Where the pictures go; it is made if needed, pictures of the same name are replaced.
        on_progress: Called with the share of the work that was done, and what comes next, in words.

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
    pictures = _pictures(log)
    if properties:
        asked = functools.partial(_draw_properties, properties=properties)
        pictures.append(("properties", asked, (9.0, 1.5 + 2.0 * len(properties))))
    whole, done = sum(_work(size) for _, _, size in pictures), 0.0
    for name, draw, size in pictures:
        if on_progress is not None:
            on_progress(done, f"Drawing {name}")
        files += _write(log, out / name, draw=draw, size=size)
        done = _work(size) / whole
    if on_progress is not None:
        on_progress(done, "Drawn")
    return files


def _work(size: tuple[float, float]) -> float:
    """What a picture of a size takes, about: its axes are as many as there is room for."""
    return size[0] * size[1]


def flight_title(log: FlightLog) -> tuple[str, str]:
    """What was flown, and by whom with what: a line to be read, and one to tell flights apart.

    Args:
        log: The flight.
    """
    metadata = log.metadata
    try:
        told = tomllib.loads(metadata.scenario_toml).get("title")
    except tomllib.TOMLDecodeError:
        told = None
    flown = metadata.setup.get("flight")
    options = flown.get("options") if isinstance(flown, dict) else None
    chosen = options if isinstance(options, dict) else {}
    words = [f"{word} {chosen[key]}" for key, word in _TOLD_OPTIONS if isinstance(chosen.get(key), str)]
    below = [metadata.scenario_name, *words, f"seed {metadata.seed}", log.path.name]
    return (told if isinstance(told, str) and told else metadata.scenario_name), "   ".join(below)


def _pictures(log: FlightLog) -> list[_Picture]:
    """Name, drawing function and size [in] of every picture that this flight gives."""
    pictures: list[_Picture] = [
        ("corridor", _draw_corridor, (7.5, 6.5)),
        ("flight", lambda flight, figure: _draw_panels(flight, figure, _FLIGHT), (9.0, 9.0)),
        ("controls", _draw_controls, (9.0, 9.0)),
        ("flapping", _draw_rotors, (9.0, 9.0)),
        ("margins", _draw_margins, (9.0, 6.0)),
        ("signals", _draw_all_signals, (15.0, 22.0)),
    ]
    if _moved_sideways(log):
        pictures.append(("track", draw_track, (7.5, 7.5)))
        pictures.append(("course", lambda flight, figure: _draw_panels(flight, figure, _COURSE), (9.0, 9.0)))
    if np.isfinite(log["lateness_us"]).any():
        pictures.append(("timing", _draw_timing, (9.0, 7.0)))
    return pictures


def _moved_sideways(log: FlightLog) -> bool:
    """Whether there is something to see out of the plane of symmetry."""
    return any(float(np.nanmax(np.abs(log[name]))) > _NOTICED for name in _SIDEWAYS)


def _write(
    log: FlightLog, target: Path, *, draw: Callable[[FlightLog, Figure], None], size: tuple[float, float]
) -> Iterable[Path]:
    """Draw one picture into its files, with a figure of its own: no global state, no window."""
    style: dict[Any, Any] = {
        "axes.grid": True,
        "grid.alpha": 0.35,
        "font.size": 9.0,
        "axes.titlesize": 10.0,
        "svg.hashsalt": "rtsim",
    }
    with drawing(**style):
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=size, layout="constrained")
        FigureCanvasAgg(figure)
        draw(log, figure)
        title, below = flight_title(log)
        figure.suptitle(_shortened(title, round(10 * size[0])), fontsize=11)
        figure.supxlabel(_shortened(below, round(14 * size[0])), fontsize=7.5, color="#555555")
        if (engine := figure.get_layout_engine()) is not None:
            engine.execute(figure)
            figure.set_layout_engine(None)  # laid out once: with an engine every file is drawn twice
        for ending in FORMATS:
            path = target.with_suffix(f".{ending}")
            # Without its date the same flight gives the same file.
            options: dict[str, Any] = {"metadata": {"Date": None}} if ending == "svg" else {"dpi": 130}
            with whole_file(path) as temporary:
                figure.savefig(temporary, **options)
            yield path


def _shortened(line: str, letters: int) -> str:
    return line if len(line) <= letters else f"{line[: letters - 3].rstrip()}..."


def _thin(values: FloatArray) -> FloatArray:
    """Every so manieth value, so that a picture of a long flight stays small."""
    return values[:: max(1, len(values) // _POINTS)]


def _curve(axes: Axes, log: FlightLog, name: str, *, colour: str, dashed: bool = False) -> None:
    values = _thin(log[name])
    if name in _COMPASS:  # no line across the plot where north is passed
        values = np.where(np.abs(np.diff(values, prepend=values[0])) > 180.0, np.nan, values)
    axes.plot(
        _thin(log["time_s"]),
        values,
        color=colour,
        linewidth=1.0 if dashed else 1.4,
        linestyle="--" if dashed else "-",
        label=label(name, unit=False),
    )


def _legend(axes: Axes, *, size: float = 8.0, rows: int = 1) -> None:
    """Names above the axes on the right, where they cover no curve."""
    count = len(axes.get_legend_handles_labels()[0])
    axes.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=-(-count // rows),
        frameon=False,
        fontsize=size,
        borderpad=0.0,
        borderaxespad=0.2,
        columnspacing=1.0,
        handlelength=1.4,
    )


def _draw_controls(log: FlightLog, figure: Figure) -> None:
    sideways = any(log[panel.signals[0]].any() or log[panel.dashed[0]].any() for panel in _LATERAL_CONTROLS)
    _draw_panels(log, figure, _CONTROLS + _LATERAL_CONTROLS if sideways else _CONTROLS)


def _draw_rotors(log: FlightLog, figure: Figure) -> None:
    _draw_panels(log, figure, _ROTOR[:1] + _BOTH_ROTORS + _ROTOR[2:] if _moved_sideways(log) else _ROTOR)


def _draw_panels(log: FlightLog, figure: Figure, panels: tuple[_Panel, ...]) -> None:
    rows = figure.subplots(len(panels), 1, sharex=True)
    for axes, panel in zip(rows, panels, strict=True):
        for colour, name in zip(_COLOURS, panel.signals, strict=False):
            _curve(axes, log, name, colour=colour)
        for name in panel.dashed:
            _curve(axes, log, name, colour="#444444", dashed=True)
        if panel.reason:
            _shade_protection(axes, log, panel.reason)
        unit = log.unit(panel.signals[0])
        axes.set_title(panel.title, loc="left")
        axes.set_ylabel(f"[{unit}]" if unit else "share of travel" if panel.signals[0] in _TRAVELS else "[-]")
        _legend(axes)
    rows[-1].set_xlabel("time [s]")


def _shade_protection(axes: Axes, log: FlightLog, reason: str) -> None:
    """Shade the time in which a protection law changes what the hands ask for."""
    acting = np.concatenate(([False], log[reason] != 0.0, [False]))
    time = log["time_s"]
    edges = np.flatnonzero(np.diff(acting))
    for number, (first, last) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
        axes.axvspan(
            time[first], time[min(last, len(time) - 1)], color=_ACTING, alpha=0.15, linewidth=0,
            label="protection acts" if not number else None,
        )  # fmt: skip


def _draw_corridor(log: FlightLog, figure: Figure) -> None:
    axes = figure.subplots()
    outline = log.metadata.corridor
    if outline is not None:
        axes.plot(outline.low_kt, outline.low_nacelle_deg, color=_LOW, linewidth=2.0, label="low-speed boundary")
        axes.plot(outline.high_kt, outline.high_nacelle_deg, color=_HIGH, linewidth=2.0, label="high-speed boundary")
        if outline.centre_kt:
            axes.plot(outline.centre_kt, outline.centre_nacelle_deg, "--", color="#777777", label="centre line")
        _fill_inside(axes, outline)
        _draw_turn(axes, log, outline)
        axes.set_title(f"Conversion corridor '{outline.name}'")
        _tell_downstop(axes, log, outline)
    axes.plot(
        _thin(log["airspeed_reference_kt"]), _thin(log["nacelle_reference_deg"]), color="#444444", linewidth=0.9,
        linestyle=":", label="reference",
    )  # fmt: skip
    axes.plot(_thin(log["airspeed_kt"]), _thin(log["nacelle_deg"]), color=_COLOURS[0], linewidth=1.8, label="flown")
    _mark_times(axes, log)
    axes.set_xlabel("airspeed [kn]")
    axes.set_ylabel("nacelle angle [deg], 90 helicopter")
    axes.set_ylim(-5.0, 100.0)
    axes.legend(loc="lower left", fontsize=8)


def _fill_inside(axes: Axes, outline: CorridorOutline) -> None:
    """Tint what the corridor allows."""
    angles = np.linspace(0.0, min(max(outline.low_nacelle_deg), max(outline.high_nacelle_deg)), 200)
    sides = []
    for nacelles, speeds in ((outline.low_nacelle_deg, outline.low_kt), (outline.high_nacelle_deg, outline.high_kt)):
        order = np.argsort(nacelles)
        sides.append(np.interp(angles, np.array(nacelles)[order], np.array(speeds)[order]))
    axes.fill_betweenx(angles, *sides, color=_INSIDE, alpha=0.08, linewidth=0)


def _draw_turn(axes: Axes, log: FlightLog, outline: CorridorOutline) -> None:
    """Where the steepest turn of the flight has moved the sides."""
    bank = min(float(np.abs(log["bank_deg"]).max()), 60.0)
    load = 1.0 / np.cos(np.radians(bank))
    if load < _WORTH_SHOWING:
        return
    for side, colour in (("low", _LOW), ("high", _HIGH)):
        nacelles, speeds = outline.turned(side, load)
        words = f"in a turn of {bank:.0f} deg of bank" if side == "low" else None
        axes.plot(speeds, nacelles, "--", color=colour, linewidth=1.2, label=words)


def _tell_downstop(axes: Axes, log: FlightLog, outline: CorridorOutline) -> None:
    """On the downstop the high side lies elsewhere: say where, if the flight was there."""
    there = np.flatnonzero(log["on_downstop"])
    if len(there):
        fastest = float(log["airspeed_kt"][there[-1]] + log["margin_high_kt"][there[-1]])
        corner = outline.high_kt[int(np.argmin(outline.high_nacelle_deg))]
        axes.annotate(
            f"on the downstop to {fastest:.0f} kn", (corner, 0.0), xytext=(0, -8), textcoords="offset points",
            ha="right", va="top", fontsize=7, color=_HIGH,
        )  # fmt: skip


def _mark_times(axes: Axes, log: FlightLog) -> None:
    """Marks along the path through the corridor."""
    speed, nacelle = log["airspeed_kt"], log["nacelle_deg"]
    for index, words in marked(log["time_s"], (speed, nacelle), (_NEAR_KT, _NEAR_DEG)):
        axes.plot(speed[index], nacelle[index], "o", color=_COLOURS[0], markersize=3.5)
        axes.annotate(words, (speed[index], nacelle[index]), textcoords="offset points", xytext=(5, 5), fontsize=7)


def _draw_margins(log: FlightLog, figure: Figure) -> None:
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[2.0, 1.0])
    upper.plot(
        _thin(log["time_s"]), _thin(log["margin_kt"]), color="#8a94a3", linewidth=6.0, alpha=0.35,
        solid_capstyle="butt", label="margin, the smaller of both",
    )  # fmt: skip
    _curve(upper, log, "margin_low_kt", colour=_LOW)
    _curve(upper, log, "margin_high_kt", colour=_HIGH)
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


def _draw_properties(log: FlightLog, figure: Figure, properties: Sequence[PropertyCurve]) -> None:
    """Robustness over time, one panel for each property; below 0 the flight breaks it."""
    panels = figure.subplots(len(properties), 1, sharex=True, squeeze=False)[:, 0]
    for axes, one in zip(panels, properties, strict=True):
        time, shown = _thin(log["time_s"][: len(one.robustness)]), _thin(one.robustness)
        axes.plot(time, shown, color=_COLOURS[0], linewidth=1.4)
        axes.fill_between(time, shown, 0.0, where=shown < 0.0, color=_HIGH, alpha=0.35, linewidth=0.0)
        axes.axhline(0.0, color=_HIGH, linewidth=1.0)
        axes.set_title(_shortened(f"{one.formula}   {one.verdict}", 120), loc="left", fontsize=8.5)
        axes.set_ylabel(f"robustness [{one.unit}]" if one.unit else "robustness")
    panels[-1].set_xlabel("time [s]")


def _draw_all_signals(log: FlightLog, figure: Figure) -> None:
    """One plot for every group and unit, so that nothing recorded goes unseen."""
    figure.set_layout_engine(None)  # laying out so many axes takes longer than drawing them
    figure.subplots_adjust(left=0.06, right=0.985, top=0.955, bottom=0.045, hspace=0.45, wspace=0.2)
    groups = [group for group in plot_groups() if not group.path.startswith("plots/loop")]
    grid = figure.subplots(-(-len(groups) // 3), 3, sharex=True).ravel()
    for axes, group in zip(grid, groups, strict=False):
        for index, column in enumerate(group.columns):
            _curve(axes, log, log.names[column], colour=_COLOURS[index % len(_COLOURS)])
        letters = sum(len(label(log.names[column], unit=False)) + 6 for column in group.columns)
        long = letters > 56
        rows = -(-letters // 90) if long else 1
        axes.set_title(
            group.title if not long else group.title.partition(" [")[0], loc="left", fontsize=8.5,
            pad=7.0 * rows + 3.0 if long else None,
        )  # fmt: skip
        if long:
            axes.set_ylabel(f"[{group.title.partition(' [')[2]}", fontsize=8)
        low, high = axes.get_ylim()
        if high - low < 0.2 and len({float(log[log.names[column]].max()) for column in group.columns}) == 1:
            axes.set_ylim(0.5 * (low + high) - 1.0, 0.5 * (low + high) + 1.0)  # nothing moves: no zoom into nothing
        if len(group.columns) > 1:
            _legend(axes, size=5.5 if long else 6.5, rows=rows)
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
        upper.plot(time, values, ".", markersize=1.5, color=colour, label=label(name, unit=False), rasterized=True)
        good = values[np.isfinite(values) & (values > 0.0)]
        if len(good):
            lower.hist(
                good,
                bins=np.geomspace(max(0.5, good.min()), good.max() + 1.0, 80),
                histtype="step",
                color=colour,
                label=f"{label(name, unit=False)}: p50 {np.median(good):.0f} us, p99 {np.percentile(good, 99):.0f} us",
            )
    upper.set_yscale("symlog", linthresh=10.0)
    upper.set_ylabel("[us]")
    upper.set_xlabel("time [s]")
    upper.set_title(f"Loop timing; overruns: {np.nanmax(log['overruns']):.0f}", loc="left")
    upper.legend(loc="upper right", fontsize=8, markerscale=6)
    lower.set_xscale("log")
    lower.set_yscale("log")
    lower.set_xlabel("time [us]")
    lower.set_ylabel("frames")
    lower.legend(loc="upper right", fontsize=8)
