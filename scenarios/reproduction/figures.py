"""The paper's Figures 1 to 18, drawn from our own flights."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtsim.corridor.boundaries import load_corridor
from rtsim.drawing import BLUE, GREEN, GREY, ORANGE, PURPLE, RED
from rtsim.lpv.files.storage import load_database
from rtsim.optimization.paths import trim_flapping_map
from rtsim.units import to_deg, to_kt
from scenarios.reproduction.drawing import (
    HALF,
    FigurePlan,
    draw_corridor,
    draw_path,
    draw_signal,
    thin,
    time_axis,
)
from scenarios.reproduction.measures import CENTRE_S, flown_trim
from scenarios.reproduction.study import Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STICK_HALF_TRAVEL_IN = 4.8
"""Stick deflection at a stick signal of 1 [in]."""


def _corridor(study: Study, figure: Figure) -> None:  # noqa: ARG001
    axes = figure.subplots()
    draw_corridor(axes, flight=True)
    axes.text(20, 40, "stall and attitude limits", rotation=0, color="black", fontsize=9)
    axes.text(172, 45, "load limit (V$_C$)", rotation=90, va="center", fontsize=9)
    _centre_line(axes, BLUE)
    axes.annotate("helicopter mode", (2, 91.5), fontsize=9, color=GREY)
    axes.annotate("airplane mode", (102, -3.2), fontsize=9, color=GREY)
    axes.legend(loc="lower left")


def _centre_line(axes: Axes, colour: str = GREY) -> None:
    nacelle = np.linspace(0.0, 90.0, 91)
    centre = to_kt(1.0) * np.asarray(load_corridor("design").centre_speed(np.radians(nacelle)))
    axes.plot(centre, nacelle, color=colour, linewidth=1.2, linestyle="-.", label="centre line")


def _grid(study: Study, figure: Figure) -> None:
    database = load_database(study.database or None)
    axes = figure.subplots()
    draw_corridor(axes)
    valid = database.valid[database.level_layer]
    speed, nacelle = np.meshgrid(to_kt(1.0) * database.airspeed, to_deg(1.0) * database.nacelle, indexing="ij")
    shown = speed >= -21.0
    trimmed = valid & shown
    axes.plot(speed[trimmed], nacelle[trimmed], ".", color=BLUE, markersize=4, label="trim and linear model")
    missing = ~valid & shown
    axes.plot(speed[missing], nacelle[missing], "x", color=RED, markersize=2.6, alpha=0.45, label="no trim")
    axes.set(xlim=(-24, 265))
    figure.legend(loc="outside lower center", ncols=2)


def _box(axes: Axes, place: tuple[float, float], text: str, *, width: float = 2.2, colour: str = "#eaf1f8") -> None:
    from matplotlib.patches import FancyBboxPatch

    x, y = place
    axes.add_patch(
        FancyBboxPatch(
            (x - width / 2, y - 0.42), width, 0.84, boxstyle="round,pad=0.02", facecolor=colour, edgecolor="#44607c"
        )
    )
    axes.text(x, y, text, ha="center", va="center", fontsize=8.4)


def _arrow(axes: Axes, points: list[tuple[float, float]]) -> None:
    axes.plot(*zip(*points[:-1], strict=True), color="black", linewidth=1.0, solid_capstyle="butt")
    axes.annotate("", points[-1], points[-2], arrowprops={"arrowstyle": "-|>", "color": "black", "linewidth": 1.0})


def _pilot(study: Study, figure: Figure) -> None:  # noqa: ARG001
    axes = figure.subplots()
    axes.set(xlim=(0, 15.4), ylim=(0, 5.6), aspect="equal")
    axes.axis("off")
    _box(axes, (1.35, 4.4), "programme:\nV, nacelle, altitude", width=2.5, colour="#f5efe0")
    _box(axes, (4.6, 4.4), "trim map,\nfeed-forward", width=2.2)
    _box(axes, (4.6, 2.6), "integrators (or PI)\non V and altitude", width=2.6)
    _box(axes, (7.9, 2.6), "optimal gains,\nneuromotor lag", width=2.4)
    _box(axes, (10.8, 2.6), "delay\n(2nd-order Padé)", width=2.2)
    _box(axes, (13.9, 2.6), "quasi-LPV\nXV-15", width=2.2, colour="#e6f2e6")
    _box(axes, (10.8, 4.4), "nacelle actuator\n(2nd-order filter)", width=2.6, colour="#f5efe0")
    _box(axes, (7.9, 0.75), "Kalman estimator\n(thresholds, attention)", width=3.2)
    _arrow(axes, [(2.65, 4.4), (3.45, 4.4)])
    _arrow(axes, [(1.35, 3.95), (1.35, 2.6), (3.25, 2.6)])
    _arrow(axes, [(5.95, 2.6), (6.65, 2.6)])
    _arrow(axes, [(5.75, 4.4), (7.4, 4.4), (7.4, 3.07)])
    _arrow(axes, [(9.15, 2.6), (9.65, 2.6)])
    _arrow(axes, [(11.95, 2.6), (12.75, 2.6)])
    _arrow(axes, [(1.35, 4.85), (1.35, 5.35), (10.8, 5.35), (10.8, 4.87)])
    _arrow(axes, [(12.15, 4.4), (13.9, 4.4), (13.9, 3.07)])
    _arrow(axes, [(13.9, 2.15), (13.9, 0.75), (9.55, 0.75)])
    _arrow(axes, [(7.9, 1.2), (7.9, 2.13)])
    _arrow(axes, [(6.25, 0.75), (4.6, 0.75), (4.6, 2.13)])
    axes.text(12.3, 2.75, "stick,\nlever", ha="center", va="bottom", fontsize=8)
    axes.text(11.8, 0.9, "displays", ha="center", fontsize=8)


def _typical_path(study: Study, figure: Figure) -> None:
    axes = figure.subplots()
    draw_corridor(axes, flight=True)
    draw_path(axes, study, "typical", label="flown, Table 1 linear in time")
    draw_path(axes, study, "typical_3deg", colour=ORANGE, label="flown, nacelles at 3 deg/s, then held", corners=False)
    axes.legend(loc="lower left")


def _flapping(study: Study, axes: Axes, name: str, *, colour: str = BLUE, label: str = "flown") -> None:
    flight = study.flights[name]
    time, trim, level = thin(flight.time, flown_trim(flight), flown_trim(flight, level=True))
    axes.plot(time, level, color="#bbbbbb", linewidth=1.2, label="level trim")
    axes.plot(time, trim, color=GREY, linewidth=1.2, linestyle="--", label="trim at the flown acceleration")
    draw_signal(axes, study, name, "flapping_deg", colour=colour, label=label)
    axes.set_ylim(0.0, 6.0)
    time_axis(axes, "cyclic flapping, deg")


def _typical_flapping(study: Study, figure: Figure) -> None:
    axes = figure.subplots()
    _flapping(study, axes, "typical", label="flown, Table 1 linear in time")
    draw_signal(axes, study, "typical_3deg", "flapping_deg", colour=ORANGE, label="flown, 3 deg/s, then held")
    axes.legend(loc="upper right")


def _map(study: Study, axes: Axes, figure: Figure) -> None:
    speed, nacelle, flapping = trim_flapping_map(load_database(study.database or None))
    shown = (speed >= 0.0) & (speed <= 180.0)
    levels = np.arange(0.0, 6.01, 0.5)
    values = np.ma.masked_invalid(np.minimum(flapping[shown], 6.0)).T
    picture = axes.contourf(speed[shown], nacelle, values, levels=levels, cmap="YlGnBu", extend="max")
    lines = axes.contour(speed[shown], nacelle, values, levels=levels[2::2], colors="black", linewidths=0.5)
    axes.clabel(lines, fmt="%g", fontsize=8)
    figure.colorbar(picture, ax=axes, label="trimmed cyclic flapping, deg")


def _flapping_map(study: Study, figure: Figure) -> None:
    axes = figure.subplots()
    draw_corridor(axes)
    _map(study, axes, figure)


def _fast_path(study: Study, figure: Figure) -> None:
    axes = figure.subplots()
    draw_corridor(axes)
    _map(study, axes, figure)
    draw_path(axes, study, "fast_side", colour=RED, label="least trimmed flapping, flown")
    draw_path(axes, study, "typical", colour=ORANGE, label="Table 1, flown", corners=False)
    axes.legend(loc="lower left")


def _fast_flapping(study: Study, figure: Figure) -> None:
    axes = figure.subplots()
    _flapping(study, axes, "fast_side", colour=RED)
    draw_signal(axes, study, "typical", "flapping_deg", colour=ORANGE, label="Table 1, for comparison")
    draw_signal(
        axes, study, "fast_side_table_1_caps", "flapping_deg", colour=PURPLE, label="same path at the caps of Table 1"
    )
    axes.legend(loc="upper right")


def _eight_path(study: Study, figure: Figure) -> None:
    axes = figure.subplots()
    draw_corridor(axes, flight=True)
    draw_path(axes, study, "typical_8deg", label="flown, nacelles at 8 deg/s, then held")
    axes.legend(loc="lower left")


def _eight_flapping(study: Study, figure: Figure) -> None:
    axes = figure.subplots()
    _flapping(study, axes, "typical_8deg", label="flown at 8 deg/s")
    draw_signal(axes, study, "typical_3deg", "flapping_deg", colour=ORANGE, label="flown at 3 deg/s")
    axes.legend(loc="upper right")


def _stall_path(study: Study, figure: Figure) -> None:
    axes = figure.subplots()
    draw_corridor(axes, flight=True)
    draw_path(axes, study, "near_stall", label="flown, 2 kn/s")
    axes.legend(loc="lower left")


def _controls(study: Study, figure: Figure, flown: tuple[str, str], other: tuple[str, str]) -> Axes:
    """Collective, stick and lever of two flights, each by path and label; gives the collective's axes."""
    all_axes: list[Axes] = list(figure.subplots(3, 1, sharex=True))
    collective, stick, lever = all_axes
    for axes, signal, scale, label in (
        (collective, "collective_75_deg", 1.0, "collective at\n0.75 R, deg"),
        (stick, "stick", STICK_HALF_TRAVEL_IN, "stick, in\n(forward +)"),
        (lever, "lever", 100.0, "lever, %"),
    ):
        draw_signal(axes, study, other[0], signal, colour=ORANGE, scale=scale, label=other[1])
        draw_signal(axes, study, flown[0], signal, scale=scale, label=flown[1])
        time_axis(axes, label, last=axes is lever)
    handles, labels = collective.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)
    figure.align_ylabels()
    return collective


def _stall_controls(study: Study, figure: Figure) -> None:
    collective = _controls(
        study, figure, ("near_stall", "along the stall limit"), ("typical_3deg", "Table 1 at 3 deg/s")
    )
    zoom = collective.inset_axes((0.06, 0.36, 0.35, 0.62))
    for name, colour in (("typical_3deg", ORANGE), ("near_stall", BLUE)):
        draw_signal(zoom, study, name, "collective_75_deg", colour=colour)
    zoom.set(xlim=(0.0, 32.0), ylim=(8.5, 12.2))
    zoom.tick_params(labelsize=8)


def _centre_path(study: Study, figure: Figure) -> None:
    axes = figure.subplots()
    draw_corridor(axes)
    _centre_line(axes)
    draw_path(axes, study, "centre_line", label="flown at 3 deg/s", corners=True)
    axes.legend(loc="lower left")


def _centre_acceleration(study: Study, figure: Figure) -> None:
    axes = figure.subplots()
    axes.axvspan(*CENTRE_S, color="#f3ead9", label="42 to 58 s")
    draw_signal(axes, study, "centre_line", "airspeed_rate_kt_s", label="centre line at 3 deg/s")
    draw_signal(axes, study, "typical_3deg", "airspeed_rate_kt_s", colour=ORANGE, label="Table 1 at 3 deg/s")
    time_axis(axes, "acceleration, kn/s")
    axes.set_ylim(-0.5, 6.5)
    axes.legend(loc="upper left")


def _variable_path(study: Study, figure: Figure) -> None:
    axes = figure.subplots()
    draw_corridor(axes)
    _centre_line(axes)
    draw_path(axes, study, "centre_line_variable", label="flown at 4 kn/s, nacelle rate variable")
    axes.legend(loc="lower left")


def _variable_rate(study: Study, figure: Figure) -> None:
    axes = figure.subplots()
    axes.axhline(12.0, color=GREY, linewidth=1.0, linestyle=":", label="12 deg/s")
    draw_signal(
        axes, study, "centre_line_variable", "nacelle_rate_deg_s", scale=-1.0, label="at 4 kn/s (limit 12 deg/s)"
    )
    draw_signal(
        axes, study, "centre_line_variable_3", "nacelle_rate_deg_s", scale=-1.0, colour=GREEN, label="at 3 kn/s"
    )
    draw_signal(axes, study, "centre_line", "nacelle_rate_deg_s", scale=-1.0, colour=ORANGE, label="constant, 3 deg/s")
    time_axis(axes, "nacelle rate towards\nairplane mode, deg/s")
    axes.legend(loc="center right")


def _variable_flapping(study: Study, figure: Figure) -> None:
    axes = figure.subplots()
    _flapping(study, axes, "centre_line_variable", label="variable rate, 4 kn/s")
    draw_signal(axes, study, "centre_line", "flapping_deg", colour=ORANGE, label="constant rate, 3 deg/s")
    axes.legend(loc="upper right")


def _variable_controls(study: Study, figure: Figure) -> None:
    _controls(
        study, figure, ("centre_line_variable", "variable rate, 4 kn/s"), ("centre_line", "constant rate, 3 deg/s")
    )


_TALL = (7.6, 5.6)
FIGURES: tuple[FigurePlan, ...] = (
    FigurePlan(
        1,
        "Conversion corridor of the XV-15",
        "Design corridor after NASA TM X-62407 (13 000 lb; low side: attitude above 59 deg, wing stall below; high "
        "side: V_C). Dashed: power-on stall as flown in 1980 (NASA TM 81244).",
        _corridor,
    ),
    FigurePlan(
        2,
        "Trims and linear models",
        "The grid of the LPV database, level layer. Points outside the corridor support the interpolation at its "
        "edge; where no trim exists the cell is marked and never used.",
        _grid,
    ),
    FigurePlan(
        3,
        "The virtual pilot",
        "Structure as flown: MOCM with Kalman estimator, neuromotor lag and second-order Padé delay, scheduled on "
        "airspeed and nacelle angle; airspeed and altitude held by integrators inside the design or by outer PI loops.",
        _pilot,
    ),
    FigurePlan(
        4,
        "Typical conversion (Table 1)",
        "Both readings of Table 1; circles: its points. Flown by the MOCM pilot on the layered LPV aircraft, calm air. "
        "Corners are rounded by the reference filters: airspeed follows 1.3 s late, the nacelles 0.7 s.",
        _typical_path,
    ),
    FigurePlan(
        5,
        "Flapping on the typical conversion",
        "Magnitude of gimbal flapping. The trim at the flown airspeed, nacelle angle and acceleration explains the "
        "early peak; what the flight adds are the transients at each start and stop of the nacelles.",
        _typical_flapping,
        HALF,
    ),
    FigurePlan(
        6,
        "Trimmed flapping over the corridor",
        "Level-flight trims of the database (flaps 40/25, 589 rpm, 13 000 lb, sea level). Blank: no trim.",
        _flapping_map,
    ),
    FigurePlan(
        7,
        "Path of least trimmed flapping",
        "At each nacelle angle the airspeed of least trimmed flapping, 8 kn away from the edge of the trims. Flown at "
        "1.5 kn/s above 50 deg: faster, the nonlinear aircraft nearly departs.",
        _fast_path,
    ),
    FigurePlan(
        8,
        "Flapping on the path of least trimmed flapping",
        "The peak is lower than on Table 1, but flapping stays above 3 deg until the nacelles tilt.",
        _fast_flapping,
        HALF,
    ),
    FigurePlan(
        9,
        "Typical conversion at 8 deg/s",
        "The points of Table 1 with the nacelles at 8 deg/s to the next angle, then held. On its way to 50 deg the "
        "path crosses the power-on stall line of 1980: the nacelles arrive there long before the airspeed.",
        _eight_path,
    ),
    FigurePlan(
        10,
        "Flapping at 8 deg/s",
        "Every motion of the nacelles rings the gimbal harder than at 3 deg/s. The trims are those of the flight at "
        "8 deg/s.",
        _eight_flapping,
        HALF,
    ),
    FigurePlan(
        11,
        "Conversion along the stall limit",
        "5 kn right of the power-on stall line of NASA TM 81244, at 2 kn/s.",
        _stall_path,
    ),
    FigurePlan(
        12,
        "Controls along the stall limit",
        "The collective falls steadily for half a minute; on Table 1 it climbs back each time the nacelles stop "
        "(inset).",
        _stall_controls,
        _TALL,
    ),
    FigurePlan(
        13,
        "Centre line at 3 deg/s",
        "Mean of both boundaries of the design corridor; acceleration capped as in Table 1.",
        _centre_path,
    ),
    FigurePlan(
        14,
        "Acceleration on the centre line",
        "From nacelle 50 deg on the corridor's centre moves by 20 kn only while the nacelles need 17 s.",
        _centre_acceleration,
        HALF,
    ),
    FigurePlan(
        15,
        "Centre line at variable nacelle rate",
        "The same points; the acceleration is held and the nacelle rate follows.",
        _variable_path,
    ),
    FigurePlan(
        16,
        "Nacelle rate on the centre line",
        "The corridor's slope times the acceleration held: 10 deg/s at 3 kn/s, up to the limit of 12 at 4 kn/s.",
        _variable_rate,
        HALF,
    ),
    FigurePlan(
        17,
        "Flapping at variable nacelle rate",
        "The fast last tilt adds more than a degree to the trim, which the constant 3 deg/s does not. The trims are "
        "those of the flight at variable rate.",
        _variable_flapping,
        HALF,
    ),
    FigurePlan(
        18,
        "Controls at variable nacelle rate",
        "Larger and quicker stick and lever motions than at constant rate, for a shorter time. The swinging of the "
        "lever at 5 to 16 s belongs to the 4 kn/s, not to the nacelle rate: see the claim.",
        _variable_controls,
        _TALL,
    ),
)
"""The figures in the paper's order."""
