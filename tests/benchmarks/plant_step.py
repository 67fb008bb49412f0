"""Time of one compiled step of the LPV aircraft: straight, and turning with sideslip, by turns in one process.

    python -m tests.benchmarks.plant_step [--rounds 200]

The aircraft of one half (the symmetric motion alone) and the whole one fly the same flight to where it turns; then the
part that steps the plant is called again and again from there, without the loop around it.
"""

from __future__ import annotations

import argparse
import statistics
import time
from typing import Any

import numpy as np

from rtsim.kernels.compiled import kernel
from rtsim.kernels.parts import call_at
from rtsim.loop.data import PART
from rtsim.loop.loading import entry_of
from rtsim.loop.setup import FlightSetup
from rtsim.loop.simulation import Simulation
from rtsim.programme import TURN, Programme
from rtsim.units import deg, kt

STEPS = 400


@kernel
def steps(flight: Any, start: Any, count: int) -> float:
    """Step the plant from the same state again and again."""
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    x = state.x
    flags = 0.0
    for _ in range(count):
        for i in range(x.shape[0]):
            x[i] = start[i]
        flags = call_at(
            flight.parts[PART.step], tables.plant.aircraft, x, state.u, scratch.path, tables.dt, scratch.work
        )
    return flags


def turning(bank: float) -> Programme:
    """Level flight at 90 kn, nacelles at 75 deg, in a turn from 1 s on."""
    same = np.ones(3)
    turn = deg(bank) * np.array([0.0, 0.0, 1.0])
    return Programme(np.array([0.0, 1.0, 3.0]), kt(90.0) * same, deg(75.0) * same, 300.0 * same, TURN.bank * same, turn)


def main() -> None:
    """Measure in turns and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=200)
    rounds = parser.parse_args().rounds
    cases = {}
    for name, bank in (("straight", 0.0), ("turning", 20.0)):
        simulation = Simulation(FlightSetup(programme=turning(bank)))
        simulation.run(1500)
        flight = simulation.flying.flight
        start = simulation.flying.state.x.copy()
        cases[name] = (entry_of(steps, flight, start, STEPS), flight, start)
    best = dict.fromkeys(cases, float("inf"))
    ratios = []
    for _ in range(rounds):
        took = {}
        for name, (call, flight, start) in cases.items():
            begin = time.perf_counter()
            call(flight, start, STEPS)
            took[name] = (time.perf_counter() - begin) / STEPS * 1e6
            best[name] = min(best[name], took[name])
        ratios.append(took["turning"] / took["straight"])
    for name, value in best.items():
        print(f"{name:<10} {value:6.3f} us")
    print(
        f"turning over straight: best {best['turning'] / best['straight']:.2f}, median {statistics.median(ratios):.2f}"
    )


if __name__ == "__main__":
    main()
