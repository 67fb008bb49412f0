"""Draws the figures of docs/lpv.md: trim map, neighbour check, and the LPV forms against the nonlinear model.

Run from the top of the repository: ``python docs/figures/make_lpv_figures.py``.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

from rtsim.corridor.boundaries import load_corridor
from rtsim.frame import COLUMN
from rtsim.loop.simulation import FlightSetup, Simulation
from rtsim.lpv.building.checks import check_neighbours
from rtsim.lpv.files.storage import load_database
from rtsim.units import DEGREE, KNOT, deg
from scenarios.files.loader import load_scenario

HERE = Path(__file__).parent


def cells(axis):
    """Edges of the coloured cells around grid points."""
    middle = 0.5 * (axis[1:] + axis[:-1])
    return np.concatenate([[axis[0] - (middle[0] - axis[0])], middle, [axis[-1] + (axis[-1] - middle[-1])]])


def draw_map(axes, database, values, title, **options):
    """One map over airspeed and nacelle angle with the design corridor."""
    speed, angle = database.airspeed / KNOT, database.nacelle / DEGREE
    picture = axes.pcolormesh(cells(speed), cells(angle), np.ma.masked_invalid(values).T, **options)
    corridor, line = load_corridor("design"), np.linspace(0.0, 90.0, 181)
    for side in (corridor.low_speed, corridor.high_speed):
        axes.plot([side(deg(b)) / KNOT for b in line[2:]], line[2:], "k", lw=1.2)
    axes.set(title=title, xlabel="airspeed, kn", ylabel="nacelle angle, deg", xlim=(-22, 205))
    plt.colorbar(picture, ax=axes)


def trim_map(database):
    """Pitch, stick, lever and flapping of the level trims."""
    level = database.level_layer
    names = [variable.name for variable in database.states]
    x, u = database.x_ref[level], database.u_ref[level]
    hole = np.where(database.valid[level], 0.0, np.nan)
    flapping = np.hypot(x[..., names.index("flap_1c")], x[..., names.index("flap_1s")])
    panels = (
        (x[..., names.index("pitch")] / DEGREE, "pitch, deg"),
        (u[..., 0], "stick, forward positive"),
        (u[..., 1], "lever"),
        (flapping / DEGREE, "flapping, deg"),
    )
    figure, axes = plt.subplots(2, 2, figsize=(13, 9), constrained_layout=True)
    for place, (values, title) in zip(axes.ravel(), panels, strict=True):
        draw_map(place, database, values + hole, f"Level trim: {title}", cmap="viridis")
    figure.savefig(HERE / "lpv_trim_map.png", dpi=80)


def neighbour_map(database):
    """Errors of the neighbour check along both axes."""
    report = check_neighbours(database)
    figure, axes = plt.subplots(1, 2, figsize=(13, 4.8), constrained_layout=True)
    for place, axis in zip(axes, ("airspeed", "nacelle"), strict=True):
        errors = report.cell_errors(axis, database.valid.shape[1:])
        draw_map(place, database, errors, f"Neighbour check along {axis}", cmap="magma_r", vmin=0.0, vmax=0.01)
    figure.savefig(HERE / "lpv_neighbour_check.png", dpi=80)


def fly(programme, plant):
    """History of a flight on one plant."""
    return Simulation(FlightSetup(programme=programme).with_options(plant=plant)).run(round(programme.duration * 250))


def against_nonlinear():
    """Differences of the layered and the plain form from the nonlinear model over Table 1 and back."""
    figure, axes = plt.subplots(4, 2, figsize=(13, 10), sharex="col", constrained_layout=True)
    signals = (("airspeed_kt", "airspeed, kn"), ("altitude_m", "altitude, m"), ("pitch_deg", "pitch, deg"),
               ("flapping_deg", "flapping, deg"))  # fmt: skip
    for column, name in enumerate(("typical_conversion", "reconversion")):
        programme = load_scenario(name).programme
        truth = fly(programme, "nonlinear")
        for plant, label, colour in (("lpv-plain", "plain (paper)", "tab:orange"), ("lpv", "layered", "tab:blue")):
            mine = fly(programme, plant)
            for row, (signal, _) in enumerate(signals):
                k = getattr(COLUMN, signal)
                axes[row, column].plot(truth[:, COLUMN.time_s], mine[:, k] - truth[:, k], color=colour, label=label)
        axes[0, column].set_title(f"{name}: LPV minus nonlinear")
        axes[-1, column].set_xlabel("time, s")
        for row, (_, text) in enumerate(signals):
            axes[row, column].set_ylabel(text)
            axes[row, column].grid(alpha=0.3)
    axes[0, 0].legend()
    figure.savefig(HERE / "lpv_against_nonlinear.png", dpi=80)


if __name__ == "__main__":
    shipped = load_database()
    trim_map(shipped)
    neighbour_map(shipped)
    against_nonlinear()
