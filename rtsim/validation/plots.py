"""The plots of the report: published numbers with their bands, and the model through the same conditions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rtsim.drawing import BLUE, GREEN, GREY, ORANGE, PURPLE, RED, REPORT_STYLE, drawing, save_both
from rtsim.validation.check import Result
from rtsim.validation.published import Table
from rtsim.validation.run import Validation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MODEL = BLUE


@dataclass(frozen=True, slots=True)
class PlannedFigure:
    """One figure of the report."""

    stem: str
    """File name without ending."""
    group: str
    """The section it stands in."""
    title: str
    """What it shows."""
    draw: Callable[[Validation, Figure], None]
    """Draws it on an empty figure."""
    size: tuple[float, float]
    """Width and height [in]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A series in a panel."""

    series: str
    """The series."""
    label: str
    """Its published numbers in the legend; empty: only the model is drawn."""
    colour: str = "black"
    """Colour of the published numbers."""
    marker: str = "s"
    """Their marker."""
    band: bool = True
    """Shade the band."""
    model: str = "model"
    """The model in the legend; empty: not drawn."""
    model_colour: str = MODEL
    """Colour of the model."""
    dashed: bool = False
    """Draw the model dashed."""


def _arrays(results: Sequence[Result]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    order = sorted(results, key=lambda one: one.check.x)
    x = np.array([one.check.x for one in order])
    published = np.array([math.nan if one.check.published is None else one.check.published for one in order])
    return x, published, np.array([one.value for one in order])


def panel(axes: Axes, validation: Validation, lines: Sequence[Line], *, x: str, y: str, title: str = "") -> None:
    """Draw series over their abscissa.

    Args:
        axes: Where.
        validation: The results.
        lines: The series.
        x: Label of the abscissa.
        y: Label of the ordinate.
        title: Above the panel.
    """
    shown: set[str] = set()
    for line in lines:
        results = validation.of_series(line.series)
        if not results:
            continue
        positions, published, model = _arrays(results)
        if line.band:
            _shade(axes, results, line.colour)
        if line.label:
            axes.plot(positions, published, line.marker, color=line.colour, label=line.label, markersize=4.5)
        if line.model:
            label = line.model if line.model not in shown else None
            shown.add(line.model)
            style = "--" if line.dashed else "-"
            axes.plot(positions, model, f"{style}o", color=line.model_colour, label=label, markersize=3.0)
    axes.set(xlabel=x, ylabel=y)
    if title:
        axes.set_title(title)
    axes.legend()


def _shade(axes: Axes, results: Sequence[Result], colour: str) -> None:
    order = sorted((one for one in results if one.check.band is not None), key=lambda one: one.check.x)
    order = [one for one in order if one.status != "outside"]
    if len(order) < 2:
        return
    bands = [one.check.band for one in order if one.check.band is not None]
    low, high = [band[0] for band in bands], [band[1] for band in bands]
    axes.fill_between([one.check.x for one in order], low, high, color=colour, alpha=0.10, linewidth=0)


def _trims(validation: Validation, figure: Figure) -> None:
    axes = figure.subplots(2, 4)
    upright = "airspeed, kn"
    rows = (
        ("pitch attitude, deg", "pitch", ("pitch_flown", "flight")),
        ("stick from aft stop, in", "stick", None),
        ("elevator, deg", "elevator", None),
        ("thrust of each rotor, lb", "thrust", None),
    )
    for place, (label, name, flown) in zip(axes[0], rows, strict=True):
        lines = [Line(series=f"trims.n90.{name}", label="GTRS")]
        if flown is not None:
            lines.append(
                Line(series=f"trims.n90.{flown[0]}", label=flown[1], colour=RED, marker="o", band=False, model="")
            )
        panel(place, validation, lines, x=upright, y=label, title="nacelle 90, flaps 40")
    lower = (
        ("n90.root_collective", "root collective, deg", "nacelle 90, flaps 40"),
        ("n30.pitch", "pitch attitude, deg", "nacelle 30, flaps 20"),
        ("n30.stick", "stick, % of travel", "nacelle 30, flaps 20"),
        ("n30.root_collective", "root collective, deg", "nacelle 30, flaps 20"),
    )
    for place, (name, label, title) in zip(axes[1], lower, strict=True):
        panel(place, validation, [Line(series=f"trims.{name}", label="GTRS")], x=upright, y=label, title=title)


def _loads(validation: Validation, figure: Figure) -> None:
    axes = figure.subplots(3, 6, sharex=True)
    columns = (
        ("rotor_total", "rotors with spinners", "XZM"),
        ("airframe", "airframe", "XZM"),
        ("wing", "wing", "XZM"),
        ("htail", "tail", "ZM"),
        ("engine_pylons", "pylon interference", "XZM"),
        ("hub_spinner", "spinners", "XZM"),
    )
    for column, (name, words, given) in enumerate(columns):
        for row, axis in enumerate("XZM"):
            place = axes[row][column]
            if axis not in given:
                jet = [Line(series="loads.jet.Z", label="GTRS")]
                panel(place, validation, jet, x="", y="Z, lb", title="jet thrust")
                continue
            panel(
                place, validation, [Line(series=f"loads.{name}.{axis}", label="GTRS")],
                x="airspeed, kn" if row == 2 else "", y=f"{axis}, {'ft lb' if axis == 'M' else 'lb'}", title=words,
            )  # fmt: skip


_TESTS = (("oarf_run15", "OARF run 15", "black", "s"), ("oarf_run14", "OARF run 14", ORANGE, "o"),
          ("wadc", "WADC, M 0.53", GREEN, "^"))  # fmt: skip


def _rotor(validation: Validation, figure: Figure) -> None:
    power, ratio, merit, limit = figure.subplots(2, 2).ravel()
    for name, words, colour, marker in _TESTS:
        x, published, model = _arrays(validation.of_series(f"rotor.{name}.power"))
        power.plot(x, published, marker, color=colour, markersize=4.5, label=words)
        ratio.plot(x, 100.0 * (model / published - 1.0), f"-{marker}", color=colour, markersize=4.0, label=words)
        ideal = 1e6 * np.maximum(x, 0.0) ** 1.5 / math.sqrt(2.0)
        merit.plot(x, ideal / published, marker, color=colour, markersize=4.5, label=words)
        if name != "oarf_run14":
            style = "-" if name == "oarf_run15" else "--"
            label = f"model, M {'0.69' if name == 'oarf_run15' else '0.53'}"
            power.plot(x, model, style, color=MODEL, label=label)
            merit.plot(x, ideal / model, style, color=MODEL, label=label)
    ratio.axhspan(-5.0, 5.0, color="black", alpha=0.08, linewidth=0)
    power.set(xlabel="CT", ylabel="CP, millionths")
    ratio.set(xlabel="CT", ylabel="CP of the model less measured, %", ylim=(-15.0, 30.0))
    merit.set(xlabel="CT", ylabel="figure of merit")
    for axes in (power, ratio, merit):
        axes.legend()
    panel(limit, validation, [Line(series="rotor.stall.gtrs", label="limit of GTRS")],
          x="advance ratio", y="largest CT / solidity")  # fmt: skip
    limit.set_ylim(bottom=0.0)


def _power(validation: Validation, figure: Figure) -> None:
    axes = figure.subplots(2, 4).ravel()
    panel(axes[0], validation,
          [Line(series="power.n90.gtrs", label="GTRS"),
           Line(series="power.n90.flown", label="flight", colour=RED, marker="o", model="")],
          x="airspeed, kn", y="rotor power, kW", title="nacelle 90, flaps 40")  # fmt: skip
    panel(axes[1], validation, [Line(series="power.n30.gtrs", label="GTRS")],
          x="airspeed, kn", y="rotor power, kW", title="nacelle 30, flaps 20")  # fmt: skip
    for place, nacelle in zip(axes[2:7], (90, 75, 60, 30, 0), strict=True):
        panel(place, validation, [Line(series=f"power.n{nacelle}.chart", label="X62407")],
              x="airspeed, kn", y="engine power / 2920 shp", title=f"nacelle {nacelle}, flaps 40")  # fmt: skip
    x, published, model = _arrays([r for r in validation.of_series("power.least") if "589" in r.check.condition])
    axes[7].fill_between(x, published - 10.0, published + 10.0, color="black", alpha=0.10, linewidth=0)
    axes[7].plot(x, published, "s", color="black", markersize=4.5, label="least fuel flow, flown")
    axes[7].plot(x, model, "-o", color=MODEL, markersize=3.0, label="model, least power")
    axes[7].set(xlabel="nacelle angle, deg", ylabel="airspeed, kn", title="speed of least power", xlim=(95, -5))
    axes[7].legend()


def _flapping(validation: Validation, figure: Figure) -> None:
    for place, nacelle in zip(figure.subplots(1, 5), (90, 75, 60, 30, 0), strict=True):
        lines = [Line(series=f"flapping.n{nacelle}", label="X62407")]
        if nacelle in {75, 60}:
            lines.append(Line(series=f"flapping.n{nacelle}.no_tail_wake", label="", band=False, dashed=True,
                              model="model, no wake at tail", model_colour=PURPLE))  # fmt: skip
        panel(place, validation, lines, x="airspeed, kn", y="trim flapping, deg", title=f"nacelle {nacelle}")
        outside = [r.check.x for r in validation.of_series(f"flapping.n{nacelle}") if r.status == "outside"]
        if outside:
            place.axvspan(min(outside), max(outside), color=RED, alpha=0.10, linewidth=0, label="chart: stalled")
            place.legend()
        place.set_ylim(bottom=0.0)


def _stall(validation: Validation, figure: Figure) -> None:
    axes = figure.subplots(1, 2)
    rows = (
        ("stall.chart", "X62407, flaps 40", "black", "s", MODEL, "model, flaps 40"),
        ("stall.wang2025", "Wang 2025 (computed), flaps as there", ORANGE, "^", GREEN, "model, the same flaps"),
    )
    for name, words, colour, marker, own, label in rows:
        x, published, model = _arrays(validation.of_series(name))
        axes[0].plot(published, x, marker, color=colour, markersize=4.5, label=words)
        axes[0].plot(model, x, "-o", color=own, markersize=3.0, label=label)
    x, published, model = _arrays(validation.of_series("stall.six_degrees"))
    axes[1].plot(published, x, "o", color=RED, markersize=5.0, label="flown (TM 81244)")
    axes[1].plot(model, x, "-o", color=MODEL, markersize=3.0, label="model, flaps 20")
    axes[0].set(title="stall of the wing", xlabel="airspeed, kn", ylabel="nacelle angle, deg")
    axes[1].set(title="level flight at 6 deg of angle of attack", xlabel="airspeed, kn", ylabel="nacelle angle, deg")
    for place in axes:
        place.legend()


def _climb(validation: Validation, figure: Figure) -> None:
    axes = figure.subplots(1, 3)
    for place, nacelle in zip(axes, (75, 0), strict=False):
        panel(place, validation, [Line(series=f"climb.n{nacelle}", label="X62407 fig 5.7.1")], x="airspeed, kn",
              y="rate of climb, ft/min", title=f"nacelle {nacelle}, flaps 40, 2331 shp")  # fmt: skip
    panel(axes[2], validation, [Line(series="climb.autorotation.chart", label="X62407 fig 5.7.1")],
          x="airspeed, kn", y="sink in autorotation, ft/min", title="nacelle 90 (assumed for the chart)")  # fmt: skip
    flown = validation.of_series("climb.autorotation.flown")[0]
    axes[2].plot([80.0], [flown.check.published], "o", color=RED, markersize=5.0, label="flown, 92 % rpm")
    axes[2].plot([80.0], [flown.value], "D", color=MODEL, markersize=4.0, label="model, 92 % rpm")
    least = validation.of_series("climb.autorotation.at_least_power")[0]
    axes[2].plot([80.0], [least.value], "D", color=MODEL, markersize=4.5, markerfacecolor="white",
                 label="model, least power, 92 % rpm")  # fmt: skip
    axes[2].margins(y=0.12)
    axes[2].set_ylim(bottom=0.0)
    axes[2].legend(loc="lower right")


def _hover(validation: Validation, figure: Figure) -> None:
    weights, ceiling = figure.subplots(1, 2)
    x, _, model = _arrays(validation.of_series("hover.weights"))
    low, high = validation.of_series("hover.weights")[0].check.band or (1.0, 1.0)
    weights.axhspan(low, high, color="black", alpha=0.10, linewidth=0)
    weights.axhline(1.0, color="black", linewidth=1.0, label="all of the take-off power")
    weights.plot(x, model, "-o", color=MODEL, markersize=4.0, label="model")
    weights.set(xlabel="height, ft", ylabel="power needed / available", title="hover at the published weights",
                ylim=(0.85, 1.2), xlim=(-300, 10500))  # fmt: skip
    weights.legend()
    _ceiling(validation, ceiling)


def _ceiling(validation: Validation, axes: Axes) -> None:
    """The three published ceilings, the band about them, the model."""
    result = validation.of_series("hover.ceiling")[0]
    table = Table("hover.ceiling").content
    names = ("X62407, text", "X62407, figure", "SP-4517", "model")
    values = [float(table[f"{word}_ft"]) for word in ("text", "figure", "history")]
    if result.check.band is not None:
        axes.axhspan(*result.check.band, color="black", alpha=0.10, linewidth=0)
    axes.bar(names, [*values, result.value], color=[GREY, GREY, GREY, MODEL], width=0.55)
    axes.set(ylabel="height, ft", title="hover ceiling out of ground effect, 13 000 lb")


def _dynamics(validation: Validation, figure: Figure) -> None:
    roots, places = figure.subplots(1, 2)
    _hover_roots(validation, roots)
    _places(places, [one for one in validation.of_group("dynamics") if one.check.band is not None])
    places.set_title("where each number lies in its band")


def _places(axes: Axes, results: Sequence[Result]) -> None:
    """Each number as a place within its band, from -1 to 1, with the published one where there is one."""
    shown = [one for one in results if one.check.band is not None and one.check.band[0] < one.check.band[1]]
    for row, one in enumerate(reversed(shown)):
        low, high = one.check.band or (0.0, 1.0)
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        axes.plot([-1.0, 1.0], [row, row], color="black", alpha=0.10, linewidth=9.0, solid_capstyle="butt")
        if one.check.published is not None:
            axes.plot((one.check.published - middle) / half, row, "s", color="black", markersize=4.5)
        colour = RED if one.status == "misses" else MODEL
        axes.plot((one.value - middle) / half, row, "o", color=colour, markersize=6.0)
    axes.set_yticks(range(len(shown)), [_named(one) for one in reversed(shown)])
    axes.set(xlabel="band from -1 to 1; square: published, dot: model", ylim=(-0.7, len(shown) - 0.3))


def _named(result: Result) -> str:
    """The quantity, and which of its series."""
    check = result.check
    return check.quantity if check.id == check.series else f"{check.quantity}, {check.id.rsplit('.', 1)[1].upper()}"


def _lateral(validation: Validation, figure: Figure) -> None:
    axes, speed = figure.subplots(3, 5), "airspeed, kn"
    for column, nacelle in enumerate((90, 75, 60, 30, 0)):
        for row, (axis, words) in enumerate((("roll", "roll"), ("yaw", "yaw"))):
            lines = [Line(series=f"lateral.{axis}_power.n{nacelle}", label="X62407")]
            panel(axes[row][column], validation, lines, x="", y=f"{words}, rad/s2 per in", title=f"nacelle {nacelle}")
            axes[row][column].set_ylim(bottom=0.0)
        if nacelle:
            lines = [Line(series=f"lateral.bank_after_1s.n{nacelle}", label="X62407")]
            panel(axes[2][column], validation, lines, x=speed, y="bank after 1 s, deg per in")
            axes[2][column].set_ylim(bottom=0.0)
    lines = [
        Line(series="lateral.bank_airplane.clean", label="X62407, flaps up, 3.36 in, 1.9 s"),
        Line(series="lateral.bank_airplane.flaps", label="X62407, flaps 40, 4.8 in, 1.8 s", colour=ORANGE, marker="o",
             model="model, flaps 40", model_colour=GREEN),
    ]  # fmt: skip
    panel(axes[2][4], validation, lines, x=speed, y="bank, deg")


def _fidelity(validation: Validation, figure: Figure) -> None:
    axes = figure.subplots(1, 1)
    results = [one for one in validation.of_group("fidelity") if one.check.band is not None]
    shares = [100.0 * one.value / one.check.band[1] for one in results if one.check.band is not None]
    names = [one.check.id.removeprefix("fidelity.").replace(".", ", ").rsplit("_", 1)[0] for one in results]
    colours = [RED if one.status == "misses" else MODEL for one in results]
    axes.barh(names[::-1], shares[::-1], color=colours[::-1], height=0.6)
    axes.axvline(100.0, color="black", linewidth=1.0)
    axes.set(xlabel="difference between LPV and nonlinear, % of what is allowed", xlim=(0.0, max(110.0, *shares)))


def _hover_roots(validation: Validation, axes: Axes) -> None:
    """Roots in hover, flown and of the model, with the printed bands."""
    names = ("dynamics.hover.oscillation.frequency", "dynamics.hover.oscillation.damping", "dynamics.hover.pitch_root",
             "dynamics.hover.heave_root")  # fmt: skip
    found = [validation.of_series(name)[0] for name in names]
    frequency, _, pitch, heave = found
    for colour, marker, label, values in (
        (RED, "x", "identified in flight", [float(one.check.published or 0.0) for one in found]),
        (MODEL, "o", "model", [one.value for one in found]),
    ):
        size, ratio = values[0], values[1]
        real = [-ratio * size, values[2], values[3]]
        imaginary = [size * math.sqrt(max(1.0 - ratio**2, 0.0)), 0.0, 0.0]
        axes.plot(real, imaginary, marker, color=colour, markersize=7.0, label=label)
    for result, height in ((pitch, 0.02), (heave, 0.02)):
        if result.check.band is not None:
            low, high = result.check.band
            axes.plot([low, high], [height, height], color=GREY, linewidth=5.0, alpha=0.4, solid_capstyle="butt")
    angles = np.linspace(np.arccos(0.60), np.arccos(0.25), 40)
    if frequency.check.band is not None:
        inner, outer = frequency.check.band
        ring = [(r * np.cos(angles), r * np.sin(angles)) for r in (inner, outer)]
        axes.fill(np.concatenate([ring[0][0], ring[1][0][::-1]]), np.concatenate([ring[0][1], ring[1][1][::-1]]),
                  color=GREY, alpha=0.25, linewidth=0, label="bands")  # fmt: skip
    axes.axvline(0.0, color="black", linewidth=0.8)
    axes.set(xlabel="real part, 1/s", ylabel="imaginary part, rad/s", title="roots in hover", ylim=(-0.05, 0.75))
    axes.legend(loc="upper left")


FIGURES: tuple[PlannedFigure, ...] = (
    PlannedFigure("validation_trims", "trims", "Level-flight trims against GTRS and flight", _trims, (14.0, 6.4)),
    PlannedFigure("validation_loads", "loads", "Loads by component at nacelle 90 against GTRS", _loads, (17.0, 8.4)),
    PlannedFigure("validation_rotor", "rotor", "The isolated rotor against three tests", _rotor, (10.0, 7.6)),
    PlannedFigure("validation_power", "power", "Power in level flight", _power, (14.0, 6.4)),
    PlannedFigure("validation_flapping", "flapping", "Trim flapping against the chart of 1975", _flapping, (17.0, 3.8)),
    PlannedFigure("validation_stall", "stall", "Low-speed boundary", _stall, (10.0, 4.2)),
    PlannedFigure("validation_climb", "climb", "Climb and autorotation", _climb, (13.0, 4.0)),
    PlannedFigure("validation_hover", "hover", "Hover weights against height, and hover ceiling", _hover, (10.0, 4.2)),
    PlannedFigure("validation_dynamics", "dynamics", "Roots in hover, controls, responses", _dynamics, (13.0, 4.6)),
    PlannedFigure(
        "validation_lateral",
        "lateral",
        "Control power and roll response against the charts of 1975",
        _lateral,
        (17.0, 9.6),
    ),
    PlannedFigure("validation_fidelity", "fidelity", "LPV aircraft against the nonlinear one", _fidelity, (8.0, 3.8)),
)
"""The figures, in the order of the report."""


def draw_figures(validation: Validation, directory: Path) -> dict[str, dict[str, Path]]:
    """Draw every figure into files.

    Args:
        validation: The results.
        directory: Where they go.

    Returns:
        Files by stem and format.
    """
    files = {}
    with drawing(**(REPORT_STYLE | {"font.size": 9.0, "legend.fontsize": 8.0, "axes.titlesize": 9.5})):
        from matplotlib.figure import Figure

        for plan in FIGURES:
            figure = Figure(figsize=plan.size, layout="constrained")
            plan.draw(validation, figure)
            figure.draw_without_rendering()
            figure.set_layout_engine("none")  # laid out once for both formats
            files[plan.stem] = save_both(figure, directory, plan.stem)
    return files
