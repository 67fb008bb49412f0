"""The LPV aircraft judged by the nonlinear one: trims between grid points, and the same pilot flying both.

The database is the shipped one: this group says nothing about changed aircraft.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np

from rtsim.aircraft.variables import STATE
from rtsim.frame import COLUMN
from rtsim.programme import Programme
from rtsim.units import deg, kt, to_deg
from rtsim.validation.bench import Bench, the_bench
from rtsim.validation.check import Check, Measure, Series

LIMITS = {"airspeed_kt": 0.3, "altitude_m": 0.5, "pitch_deg": 0.4, "flapping_deg": 0.15}
"""Requirements on the root mean square over a manoeuvre."""
_UNITS = {"airspeed_kt": "kn", "altitude_m": "m", "pitch_deg": "deg", "flapping_deg": "deg"}
_REQUIRED = "requirement of this project"
_BETWEEN = ((12.5, 86.0), (47.5, 83.5), (67.0, 76.0), (93.0, 62.0), (112.0, 47.0), (126.0, 33.0), (138.0, 18.0),
            (156.0, 4.0), (176.0, 0.0))  # fmt: skip
"""Airspeeds [kn] and nacelle angles [deg] off the grid, along the middle of the corridor."""


def rms_errors(programme: Programme, plant: str = "lpv") -> dict[str, float]:
    """Root mean square of the difference between two plants that one pilot flies, by signal of ``LIMITS``.

    Args:
        programme: What is flown.
        plant: The plant that is judged by the nonlinear one.
    """
    from rtsim.loop.simulation import FlightSetup, Simulation

    frames = round(programme.duration * 250)
    rows = []
    for flown in ("nonlinear", plant):
        simulation = Simulation(FlightSetup(programme=programme).with_options(plant=flown))
        rows.append(simulation.run(frames))
    truth, mine = rows
    if not len(truth) == len(mine) == frames:
        return dict.fromkeys(LIMITS, math.nan)
    return {
        name: float(np.sqrt(np.mean((mine[:, column] - truth[:, column]) ** 2)))
        for name in LIMITS
        for column in [getattr(COLUMN, name)]
    }


@cache
def _flown(name: str) -> dict[str, float]:
    from rtsim.optimization.paths import table_1

    path = replace(table_1(), nacelle_motion="spread")
    return rms_errors((path if name == "conversion" else path.reconversion()).programme())


@cache
def _trim_error() -> dict[str, float]:
    """Largest difference of level trims between grid points."""
    from rtsim import load_aircraft

    lpv, bench = load_aircraft(), the_bench()
    errors = {"pitch": 0.0, "collective": 0.0, "flapping": 0.0}
    for airspeed, nacelle in _BETWEEN:
        true = bench.point(bench.condition(airspeed, nacelle))
        mine = lpv.trim(airspeed=kt(airspeed), nacelle=deg(nacelle))
        places = {"pitch": STATE.pitch, "collective": STATE.collective_75}
        for name, place in places.items():
            errors[name] = max(errors[name], abs(to_deg(float(mine.x[place] - true.x[place]))))
        flapping = [math.hypot(point.x[STATE.flap_1c], point.x[STATE.flap_1s]) for point in (mine, true)]
        errors["flapping"] = max(errors["flapping"], abs(to_deg(flapping[0] - flapping[1])))
    return errors


def checks() -> list[Check]:
    """The checks of this group."""
    trims = Series(name="fidelity.trim", quantity="largest trim difference between grid points", unit="deg", decimals=3)

    def trim(name: str) -> Measure:
        return lambda _: _trim_error()[name]

    found = [
        trims.check(name, f"{name}, {len(_BETWEEN)} conditions along the corridor", trim(name), source=_REQUIRED,
                    grade="-", limits=(0.0, 0.2), band_from="ours")
        for name in ("pitch", "collective", "flapping")
    ]  # fmt: skip
    for flight, words in (("conversion", "Table 1, hover to 170 kn"), ("reconversion", "170 kn to hover at 2 kn/s")):
        for signal, limit in LIMITS.items():
            series = Series(
                name=f"fidelity.{flight}.{signal}", quantity=f"RMS of LPV less nonlinear, {signal.rsplit('_', 1)[0]}",
                unit=_UNITS[signal], decimals=3,
            )  # fmt: skip

            def measure(_: Bench, flight: str = flight, signal: str = signal) -> float:
                return _flown(flight)[signal]

            found.append(series.check("", f"{words}, virtual pilot", measure, source=_REQUIRED, grade="-",
                                      limits=(0.0, limit), band_from="ours"))  # fmt: skip
    return found
