"""Draws the maps of docs/pilot.md from the shipped database: ``python docs/figures/make_pilot_figures.py``."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

from rtsim.analysis.frozen_loop import FrozenCommand, StabilityMap, frozen_loop, stability_map
from rtsim.choices import OuterLoop
from rtsim.corridor.boundaries import load_corridor
from rtsim.lpv.database import Database
from rtsim.lpv.files.storage import load_database
from rtsim.lpv.tables import prepare_tables
from rtsim.pilot.tables import load_pilot_tables
from rtsim.units import deg, kt, to_deg, to_kt

HERE = Path(__file__).parent
TABLE_1 = np.array([(0, 90), (24, 82), (40, 82), (61, 75), (80, 75), (105, 50), (130, 50), (150, 0), (170, 0)])


def edges(axis: np.ndarray) -> np.ndarray:
    """Borders of cells around grid points."""
    middle = 0.5 * (axis[1:] + axis[:-1])
    return np.concatenate([[1.5 * axis[0] - 0.5 * axis[1]], middle, [1.5 * axis[-1] - 0.5 * axis[-2]]])


def frame(axes, title: str) -> None:
    """Draw the design corridor and the points of Table 1."""
    corridor = load_corridor("design")
    angle = np.linspace(0.0, deg(90.0), 181)
    axes.plot(to_kt(np.asarray(corridor.low_speed(angle))), to_deg(angle), color="k", linewidth=1.0)
    axes.plot(to_kt(np.asarray(corridor.high_speed(angle))), to_deg(angle), color="k", linewidth=1.0)
    axes.plot(TABLE_1[:, 0], TABLE_1[:, 1], "k--", linewidth=0.8)
    axes.set(title=title, xlim=(-25.0, 265.0), ylim=(-3.0, 93.0))
    axes.tick_params(labelsize=8)
    axes.title.set_fontsize(9)


def draw_stability(database: Database) -> None:
    """Growth rates of both forms on the level and the outermost layers."""
    figure = Figure(figsize=(11.0, 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(2, 3, sharex=True, sharey=True)
    lpv = prepare_tables(database)
    norm = TwoSlopeNorm(vmin=-0.12, vcenter=0.0, vmax=0.12)
    fast, slow = database.layer_acceleration.size - 1, 0
    panels: tuple[tuple[OuterLoop, int | None, bool, str], ...] = (
        ("integrators", None, False, "integrators, level, grid points"),
        ("integrators", None, True, "integrators, level, middles of cells"),
        ("pi", None, False, "outer PI, level, grid points"),
        ("integrators", fast, False, f"integrators, {to_kt(database.layer_acceleration[fast]):+.0f} kn/s"),
        ("integrators", slow, False, f"integrators, {to_kt(database.layer_acceleration[slow]):+.0f} kn/s"),
        ("pi", fast, False, f"outer PI, {to_kt(database.layer_acceleration[fast]):+.0f} kn/s"),
    )
    for axes, (loop, layer, mid_cells, title) in zip(grid.flat, panels, strict=True):
        result = stability_map(
            database, outer_loop=loop, layer=layer, mid_cells=mid_cells, tables=(lpv, load_pilot_tables(database, loop))
        )
        mesh = axes.pcolormesh(
            to_kt(edges(result.airspeed)), to_deg(edges(result.nacelle)), result.growth.T, norm=norm, cmap="RdYlGn_r"
        )
        for airspeed, nacelle, _ in result.unstable:
            axes.plot(to_kt(airspeed), to_deg(nacelle), "kx", markersize=4)
        frame(axes, f"{title}: max {np.nanmax(result.growth):+.3f}")
        report(title, result)
    figure.colorbar(mesh, ax=grid, label="largest real part [rad/s]")
    figure.supxlabel("airspeed [kn]")
    figure.supylabel("nacelle angle [deg]")
    figure.savefig(HERE / "pilot_stability.png", dpi=110)


def report(title: str, result: StabilityMap) -> None:
    """Print the numbers of a map."""
    places = [f"{to_kt(v):.0f}/{to_deg(n):.1f}: {g:+.3f}" for v, n, g in result.unstable]
    sys.stdout.write(
        f"{title}: {np.isfinite(result.growth).sum()} points, max {np.nanmax(result.growth):+.4f}, "
        f"median {np.nanmedian(result.growth):+.4f}, unstable {len(places)} {places}\n"
    )


def draw_margins(database: Database) -> None:
    """Margins of both hands on the level layer, and along Table 1."""
    lpv, pilot = prepare_tables(database), load_pilot_tables(database)
    valid = database.valid[database.level_layer]
    values = np.full((6, *valid.shape), np.nan)
    for i, j in np.argwhere(valid):
        loop = frozen_loop(database, FrozenCommand(database.airspeed[i], database.nacelle[j]), tables=(lpv, pilot))
        margins = loop.margins()
        values[:, i, j] = np.stack([margins.w_c, margins.phase_margin, np.minimum(margins.gain_margin, 30.0)]).T.ravel()
    figure = Figure(figsize=(11.0, 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(2, 3, sharex=True, sharey=True)
    names = [f"{hand}: {what}" for hand in ("stick", "lever") for what in (
        "crossover [rad/s]", "phase margin [deg]", "gain margin [dB]")]  # fmt: skip
    ranges = ((0.0, 4.0), (0.0, 90.0), (0.0, 15.0)) * 2
    for axes, name, value, (low, high) in zip(grid.flat, names, values, ranges, strict=True):
        mesh = axes.pcolormesh(
            to_kt(edges(database.airspeed)), to_deg(edges(database.nacelle)), value.T, vmin=low, vmax=high
        )
        figure.colorbar(mesh, ax=axes)
        frame(axes, name)
        least, middle, most = np.nanquantile(value, (0.0, 0.5, 1.0))
        sys.stdout.write(f"{name}: {least:.2f} to {most:.2f}, median {middle:.2f}\n")
    figure.supxlabel("airspeed [kn]")
    figure.supylabel("nacelle angle [deg]")
    figure.savefig(HERE / "pilot_margins.png", dpi=110)
    for airspeed, nacelle in TABLE_1:
        m = frozen_loop(database, FrozenCommand(kt(airspeed), deg(nacelle)), tables=(lpv, pilot)).margins()
        sys.stdout.write(
            f"| {airspeed}/{nacelle} | {m.w_c[0]:.2f}, {m.phase_margin[0]:.0f}, {m.gain_margin[0]:.1f} "
            f"| {m.w_c[1]:.2f}, {m.phase_margin[1]:.0f}, {m.gain_margin[1]:.1f} |\n"
        )


def main() -> None:
    """Draw both figures."""
    database = load_database()
    draw_stability(database)
    draw_margins(database)


if __name__ == "__main__":
    main()
