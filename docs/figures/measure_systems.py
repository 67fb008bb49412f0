"""Compares flaps by hand and rotors without their governor on both plants; prints the tables of docs/systems.md.

Usage: python docs/figures/measure_systems.py [FIGURE.png]
"""

from __future__ import annotations

import sys

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.choices import PlantName
from rtsim.command import Command
from rtsim.frame import COLUMN
from rtsim.loop.simulation import FlightSetup, Simulation
from rtsim.programme import Programme
from rtsim.units import deg, kt

FLAPS = ((0, 90, 0), (0, 90, 75), (60, 75, 20), (60, 75, 75), (105, 50, 20), (130, 25, 20), (130, 25, 0), (160, 0, 20),
         (160, 0, 0))  # fmt: skip
LEVERS = ((0, 90), (60, 75), (105, 50), (150, 0))
COMPARED = ("airspeed_kt", "altitude_m", "pitch_deg", "flapping_deg")
PLANTS: tuple[PlantName, PlantName] = ("lpv", "nonlinear")
LEVER_STEP = 0.03


def _simulation(airspeed: float, nacelle: float, plant: PlantName) -> Simulation:
    programme = Programme.hold(airspeed=kt(airspeed), nacelle_angle=deg(nacelle), altitude=100.0)
    simulation = Simulation(FlightSetup(programme=programme).with_options(plant=plant))
    simulation.run(250)
    return simulation


def flaps_moved(airspeed: float, nacelle: float, setting: float, plant: PlantName) -> FloatArray:
    """Fly 40 s with the MOCM while the flaps go to a setting.

    Args:
        airspeed: Airspeed to hold [kn].
        nacelle: Nacelle angle [deg].
        setting: Flap deflection to go to from 40 deg [deg].
        plant: Which aircraft.
    """
    simulation = _simulation(airspeed, nacelle, plant)
    simulation.set_flaps(deg(setting))
    return simulation.run(40 * 250)


def lever_moved(airspeed: float, nacelle: float, plant: PlantName) -> FloatArray:
    """Hold the stick, raise the lever by ``LEVER_STEP`` for 3 s with the governor off, then switch it on for 4 s.

    Args:
        airspeed: Airspeed at the start [kn].
        nacelle: Nacelle angle [deg].
        plant: Which aircraft.
    """
    simulation = _simulation(airspeed, nacelle, plant)
    trim = simulation.pilot_command()
    simulation.set_aid("governor", False)
    simulation.set_pilot("external")
    rows = []
    for frame in range(7 * 250):
        if frame == 3 * 250:
            simulation.set_aid("governor", True)
        rows.append(simulation.step(Command(trim.stick, trim.lever + LEVER_STEP, 0.0)))
    return np.array(rows)


def _figure(flights: dict[tuple[int, int], dict[PlantName, FloatArray]], file: str) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, len(flights), figsize=(11.0, 4.6), sharex=True, layout="constrained")
    panels = (("rotor_speed_rpm", "rotor speed, rpm"), ("engine_power_shp", "engine power, shp"))
    for column, ((airspeed, nacelle), rows) in enumerate(flights.items()):
        for panel, (name, label) in zip(axes[:, column], panels, strict=True):
            for plant, style in (("nonlinear", {"color": "0.6", "lw": 3.0}), ("lpv", {"color": "C0", "lw": 1.2})):
                flight = rows[plant]
                panel.plot(flight[:, COLUMN.time_s] - 1.0, flight[:, getattr(COLUMN, name)], label=plant, **style)
            panel.axvline(3.0, color="0.4", ls=":", lw=1.0)
            panel.grid(alpha=0.3)
            if column == 0:
                panel.set_ylabel(label)
        axes[0, column].set_title(f"{airspeed} kn, {nacelle}°", fontsize=10)
        axes[1, column].set_xlabel("time, s")
    axes[0, 0].legend(fontsize=8, title="governor on at 3 s", title_fontsize=8)
    figure.savefig(file, dpi=110)


def main() -> None:
    """Print two tables and, where a name is given, draw the second."""
    print(
        "| condition | flaps to | airspeed, kn | altitude, m | pitch, deg | flapping, deg | largest height change, m |"
    )
    print("|---|---|---|---|---|---|---|")
    for airspeed, nacelle, setting in FLAPS:
        mine, truth = (flaps_moved(airspeed, nacelle, setting, plant) for plant in PLANTS)
        columns = [getattr(COLUMN, name) for name in COMPARED]
        errors = np.sqrt(np.mean((mine[:, columns] - truth[:, columns]) ** 2, axis=0))
        height = np.abs(truth[:, COLUMN.altitude_m] - 100.0).max()
        cells = " | ".join(f"{error:.2f}" for error in errors)
        print(f"| {airspeed} kn, {nacelle}° | {setting}° | {cells} | {height:.1f} |")
    flights = {where: {plant: lever_moved(*where, plant) for plant in PLANTS} for where in LEVERS}
    print("\n| condition | rotor speed after 3 s, nonlinear, rpm | LPV | engine power, nonlinear, shp | LPV |")
    print("|---|---|---|---|---|")
    for (airspeed, nacelle), rows in flights.items():
        late = {plant: flight[3 * 250 - 1] for plant, flight in rows.items()}
        speeds = " | ".join(f"{late[plant][COLUMN.rotor_speed_rpm]:.1f}" for plant in reversed(PLANTS))
        powers = " | ".join(f"{late[plant][COLUMN.engine_power_shp]:.0f}" for plant in reversed(PLANTS))
        print(f"| {airspeed} kn, {nacelle}° | {speeds} | {powers} |")
    if len(sys.argv) > 1:
        _figure(flights, sys.argv[1])


if __name__ == "__main__":
    main()
