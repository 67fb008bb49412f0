"""Draw the figures of docs/model.md: the nonlinear XV-15 beside published data.

Run from the top of the checkout: ``python docs/figures/make_model_figures.py``.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from rtsim.aircraft.points import Condition, TrimPoint
from rtsim.aircraft.variables import OUTPUT, STATE
from rtsim.aircraft.xv15 import rotor_kernels as kernels
from rtsim.aircraft.xv15.model import Xv15
from rtsim.units import FOOT, HORSEPOWER, POUND_FORCE, deg, kt, rpm, to_deg

HERE = Path(__file__).parent
DATA = tomllib.loads((HERE.parents[1] / "tests" / "data" / "xv15_validation.toml").read_text())
AIRCRAFT = Xv15.load()
MODEL = {"color": "#1b5e9e", "linewidth": 1.8, "label": "rtsim"}
GTRS = {"color": "black", "marker": "s", "linestyle": "none", "markersize": 5, "label": "GTRS"}
FLIGHT = {"color": "#c0392b", "marker": "o", "linestyle": "none", "markersize": 5, "label": "flight"}
CHART = {"color": "#7f6000", "linestyle": "--", "linewidth": 1.5, "label": "TM X-62407"}


def trims(
    speeds_kt: np.ndarray, nacelle: float, flap: float | None = None, rotor_rpm: float = 589.0
) -> list[TrimPoint]:
    """Trims along a line of airspeed; those that do not converge are returned as they are."""
    return [
        AIRCRAFT.trim(
            Condition(
                airspeed=kt(float(speed)),
                nacelle_angle=deg(nacelle),
                flap=None if flap is None else deg(flap),
                rotor_speed=rpm(rotor_rpm),
            )
        )
        for speed in speeds_kt
    ]


def series(points: list[TrimPoint], quantity: str) -> np.ndarray:
    """One quantity in the unit of the plots; nan where the trim did not converge."""
    functions = {
        "pitch": lambda p: to_deg(p.x[STATE.pitch]),
        "stick": lambda p: 50.0 + 50.0 * p.u[0],
        "power": lambda p: p.y[OUTPUT.power] / 1e3,
        "thrust": lambda p: p.y[OUTPUT.thrust] / POUND_FORCE,
        "root": lambda p: to_deg(p.x[STATE.collective_75]) + 34.43,
        "flapping": lambda p: to_deg(p.y[OUTPUT.flapping]),
        "ratio": lambda p: p.y[OUTPUT.power] / HORSEPOWER / 0.93 / 2920.0,
    }
    return np.array([functions[quantity](p) if p.converged else np.nan for p in points])


def finish(axis: plt.Axes, x: str, y: str) -> None:
    """Label an axis."""
    axis.set_xlabel(x)
    axis.set_ylabel(y)
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8, frameon=False)


def trim_figure() -> None:
    """Level-flight trims at nacelle 90 and 30."""
    figure, axes = plt.subplots(2, 4, figsize=(14.5, 6.6), layout="constrained")
    speeds = np.arange(0.0, 104.0, 2.0)
    points = trims(speeds, 90.0)
    heli, wang, flight = DATA["trim"]["heli_gtrs"], DATA["trim"]["wang_gtrs_90"], DATA["trim"]["wang_flight_90"]
    rows = {
        "pitch": (heli["speed_kn"], heli["pitch_deg"], flight["pitch_deg"], "pitch, deg"),
        "stick": (
            heli["speed_kn"],
            np.array(heli["stick_in"]) / 9.6 * 100.0,
            flight["stick_pct"],
            "stick, % of travel",
        ),
        "power": (wang["speed_kn"], wang["power_kW"], flight["power_kW"], "rotor power, kW"),
        "root": (wang["speed_kn"], wang["theta0_deg"], None, "root collective, deg"),
    }
    for axis, (name, (x, y, flown, label)) in zip(axes[0], rows.items(), strict=True):
        axis.plot(speeds, series(points, name), **MODEL)
        axis.plot(x, y, **GTRS)
        if flown is not None:
            axis.plot(flight["speed_kn"], flown, **FLIGHT)
        finish(axis, "airspeed, kn (nacelle 90, flaps 40)", label)
    speeds = np.arange(92.0, 172.0, 2.0)
    points = trims(speeds, 30.0, 20.0)
    wang = DATA["trim"]["wang_gtrs_30"]
    keys = {"pitch": "pitch_deg", "stick": "stick_pct", "power": "power_kW", "root": "theta0_deg"}
    for axis, (name, key) in zip(axes[1], keys.items(), strict=True):
        axis.plot(speeds, series(points, name), **MODEL)
        axis.plot(wang["speed_kn"], wang[key], **GTRS)
        finish(axis, "airspeed, kn (nacelle 30, flaps 20)", rows[name][3])
    figure.savefig(HERE / "model_trim.png", dpi=110)
    plt.close(figure)


def flapping_and_power_figure() -> None:
    """Trim flapping and power over 2920 shp against the charts of TM X-62407."""
    figure, axes = plt.subplots(1, 4, figsize=(14.5, 3.6), layout="constrained")
    flapping, power = DATA["trim"]["flapping"], DATA["power"]["ratio"]
    for axis, nacelle, last in ((axes[0], 90, 131.0), (axes[1], 75, 141.0)):
        speeds = np.arange(0.0, last, 2.5)
        axis.plot(speeds, series(trims(speeds, float(nacelle)), "flapping"), **MODEL)
        axis.plot(flapping[f"n{nacelle}_kn"], flapping[f"n{nacelle}_deg"], **CHART)
        axis.set_ylim(0.0, 6.0)
        finish(axis, f"airspeed, kn (nacelle {nacelle})", "trim flapping, deg")
    for axis, nacelle in ((axes[2], 90), (axes[3], 75)):
        speeds = np.arange(0.0, 101.0, 2.5)
        axis.plot(speeds, series(trims(speeds, float(nacelle)), "ratio"), **MODEL)
        x, y = np.array(power[f"n{nacelle}_kn"]), np.array(power[f"n{nacelle}"])
        axis.plot(x, y, **CHART)
        low, high = power["tol_frac"]
        axis.fill_between(x, y * (1.0 + low), y * (1.0 + high), color="#7f6000", alpha=0.15, linewidth=0)
        finish(axis, f"airspeed, kn (nacelle {nacelle})", "engine power / 2920 shp")
    figure.savefig(HERE / "model_flapping_power.png", dpi=110)
    plt.close(figure)


def hover_polar() -> np.ndarray:
    """CT, CP of one rotor alone in hover at 770 ft/s, by relaxation of flapping and inflow, collective 1 to 20 deg."""
    from scipy.optimize import fsolve

    rotor = AIRCRAFT.tables.rotor
    tip = 770.0 * FOOT
    air = AIRCRAFT.tables.configuration._replace(rotor_speed=tip / rotor.radius)
    loads, points = np.zeros(kernels.LOAD_COUNT), []
    scale = air.density * np.pi * rotor.radius**2 * tip**2

    def residual(z: np.ndarray, collective: float) -> list[float]:
        flapping = (z[0], 0.0, z[1], 0.0, z[2], 0.0)
        hub, inflow = (0.0, 0.0, 0.0), (z[3], z[4], z[5])
        kernels.rotor_loads(rotor, air, hub, flapping, inflow, (collective, 0.0), loads)
        accelerations = kernels.flapping_accelerations(rotor, air.rotor_speed, (0.0, 0.0), flapping, loads)
        return [*(np.array(accelerations) / 4e3), *kernels.inflow_rates(rotor, air, hub, inflow, loads)]

    z = np.array([0.04, 0.0, 0.0, 0.03, 0.0, 0.0])
    for collective in np.arange(1.0, 20.1, 0.5):
        z = fsolve(residual, z, args=(deg(collective),))
        points.append((loads[kernels.THRUST] / scale, loads[kernels.TORQUE] / scale / rotor.radius))
    return np.array(points)


def rotor_and_stall_figure() -> None:
    """Isolated rotor in hover against OARF; low-speed boundary against prediction and flight."""
    figure, axes = plt.subplots(1, 3, figsize=(14.5, 4.0), layout="constrained")
    oarf = DATA["hover"]["oarf_run15"]
    thrust, power = hover_polar().T
    test = dict(GTRS, label="OARF run 15")
    axes[0].plot(thrust, power, **MODEL)
    axes[0].plot(oarf["CT"], oarf["CP"], **test)
    finish(axes[0], "CT", "CP")
    positive = thrust > 0.0
    axes[1].plot(thrust[positive], thrust[positive] ** 1.5 / np.sqrt(2.0) / power[positive], **MODEL)
    axes[1].plot(oarf["CT"], oarf["FM"], **test)
    finish(axes[1], "CT", "figure of merit")
    nacelles = np.arange(0.0, 61.0, 5.0)
    lowest = []
    for nacelle in nacelles:
        point = None
        for speed in np.arange(125.0, 45.0, -0.5):
            trial = AIRCRAFT.trim(
                Condition(airspeed=kt(float(speed)), nacelle_angle=deg(float(nacelle)), flap=deg(40.0)), guess=point
            )
            jumped = point is not None and abs(trial.x[STATE.pitch] - point.x[STATE.pitch]) > deg(2.5)
            if not trial.converged or jumped or to_deg(trial.y[OUTPUT.wing_angle_of_attack]) > 16.0:
                break
            point = trial
        lowest.append(speed + 0.5)
    axes[2].plot(lowest, nacelles, **MODEL)
    chart, flown = DATA["corridor"]["design_low"], DATA["corridor"]["flight_power_on_stall"]
    axes[2].plot(chart["speed_kn"], chart["nacelle_deg"], **CHART)
    axes[2].plot(flown["speed_kn"], flown["nacelle_deg"], **dict(FLIGHT, label="flight, power-on stall (TM-81244)"))
    axes[2].set_ylim(0.0, 75.0)
    axes[2].set_xlim(40.0, 120.0)
    finish(axes[2], "lowest airspeed before stall, kn (flaps 40)", "nacelle, deg")
    figure.savefig(HERE / "model_rotor_stall.png", dpi=110)
    plt.close(figure)


if __name__ == "__main__":
    trim_figure()
    flapping_and_power_figure()
    rotor_and_stall_figure()
