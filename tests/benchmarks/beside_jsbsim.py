"""Steps per second of the loop, as ratios to JSBSim's c172p in the same run, taken in turns.

    python -m tests.benchmarks.beside_jsbsim [--rounds 60]

On a shared machine a busy neighbour halves everything for seconds. Each round therefore runs every row once and JSBSim
before and after; shown are the best of each against the best of JSBSim, and the median of the rounds' own ratios.
JSBSim comes from PyPI (``pip install -e '.[benchmark]'``).
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import jsbsim

import scenarios
from rtsim.loop.setup import FlightSetup
from rtsim.loop.simulation import Simulation
from rtsim.lpv.aircraft import load_aircraft
from rtsim.units import deg, kt
from scenarios.files.loader import load_scenario

WHOLE_FLIGHT_EVERY = 5
"""Rounds between two whole flights, which take longer than all else."""


def rows() -> dict[str, Callable[[], int]]:
    """What is measured, by name: each does its work once and gives the number of steps done."""

    def simulated(name: str) -> Simulation:
        setup = FlightSetup(programme=load_scenario(name).programme)
        return Simulation(setup.with_options(protection="monitor", corridor="design"))

    simulation = simulated("typical_conversion")
    simulation.run(5000)
    begin = simulation.snapshot()
    turning = simulated("conversion_turn")
    turning.run(5000)
    banked = turning.snapshot()
    aircraft, nacelle = load_aircraft(), deg(75.0)
    point = aircraft.trim(airspeed=kt(100.0), nacelle=nacelle)
    other = jsbsim.FGFDMExec(None)
    other.set_debug_level(0)
    other.load_model("c172p")
    other["ic/h-sl-ft"], other["ic/u-fps"] = 3000, 150
    other.run_ic()

    def jsbsim_steps() -> int:
        for _ in range(400):
            other.run()
        return 400

    def closed_loop() -> int:
        simulation.restore(begin)
        return len(simulation.run(1000))

    def turning_loop() -> int:
        turning.restore(banked)
        return len(turning.run(1000))

    def frame_by_frame() -> int:
        simulation.restore(begin)
        for _ in range(600):
            simulation.step()
        return 600

    def plant() -> int:
        for _ in range(1200):
            aircraft.step(point.x, point.u, nacelle_angle=nacelle)
        return 1200

    def whole_flight() -> int:
        return len(scenarios.fly("typical_conversion", speed="max").rows)

    return {
        "JSBSim c172p, run()": jsbsim_steps,
        "closed loop, compiled": closed_loop,
        "the same in a turn": turning_loop,
        "Simulation.step()": frame_by_frame,
        "plant step from Python": plant,
        "scenarios.fly(speed='max')": whole_flight,
    }


def microseconds(work: Callable[[], int]) -> float:
    """Time per step of one turn [us]."""
    begin = time.perf_counter()
    steps = work()
    return (time.perf_counter() - begin) / steps * 1e6


def main() -> None:
    """Measure in turns and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=60)
    rounds = parser.parse_args().rounds
    (reference, jsbsim_steps), *measured = rows().items()
    for _, work in measured:
        work()
    best = {name: float("inf") for name, _ in [(reference, None), *measured]}
    ratios: dict[str, list[float]] = {name: [] for name, _ in measured}
    for number in range(rounds):
        for name, work in measured:
            if name.startswith("scenarios") and number % WHOLE_FLIGHT_EVERY:
                continue
            before, own, after = microseconds(jsbsim_steps), microseconds(work), microseconds(jsbsim_steps)
            best[name], best[reference] = min(best[name], own), min(best[reference], before, after)
            ratios[name].append(0.5 * (before + after) / own)
    print(f"{reference:<28} {best[reference]:6.2f} us")
    for name, _ in measured:
        share, middle = best[reference] / best[name], statistics.median(ratios[name])
        print(f"{name:<28} {best[name]:6.2f} us   best {share:5.2f} J   median of the rounds {middle:5.2f} J")


if __name__ == "__main__":
    main()
