"""How fast the plant and the closed loop run, with JSBSim's c172p beside them in the same run.

    python -m tests.benchmarks.throughput [--repeats 5] [--json]

Every row is measured ``--repeats`` times, the rows taking turns so that a busy minute of the machine touches all of
them; best and median are shown. JSBSim comes from PyPI (``pip install -e '.[benchmark]'``); without it its rows are
left out, and said so.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from rtsim.units import deg, kt

CLOSED_LOOP_HZ = 250
JSBSIM_HZ = 120


@dataclass(frozen=True)
class Row:
    """One thing to measure."""

    name: str
    run: Callable[[], int]
    """Does the work once and gives the number of steps done."""
    rate_hz: float
    """Steps per simulated second."""
    target: str = ""


def plant_step_rows(steps: int) -> list[Row]:
    """The aircraft alone, one call from Python per step."""
    import rtsim

    aircraft = rtsim.load_aircraft()
    point = aircraft.trim(airspeed=kt(100.0), nacelle=deg(75.0))

    def run() -> int:
        x, u, angle, dt = point.x, point.u, deg(75.0), 1.0 / CLOSED_LOOP_HZ
        for _ in range(steps):
            x = aircraft.step(x, u, nacelle_angle=angle, dt=dt)
        assert np.all(np.isfinite(x))
        return steps

    return [Row("plant step (LPV), from Python", run, CLOSED_LOOP_HZ, "100 000 steps/s")]


def closed_loop_rows() -> list[Row]:
    """The typical conversion: aircraft, MOCM pilot, nacelles, corridor, and a row of every frame."""
    from rtsim.loop.simulation import FlightSetup, Simulation
    from scenarios.files.loader import load_scenario

    programme = load_scenario("typical_conversion").programme
    frames = round(programme.duration * CLOSED_LOOP_HZ)
    simulations = {
        plant: Simulation(FlightSetup(programme=programme).with_options(plant=plant))
        for plant in ("lpv", "lpv-plain", "nonlinear")
    }
    for simulation in simulations.values():
        simulation.warm_up()

    def compiled(plant: str) -> Callable[[], int]:
        def run() -> int:
            simulations[plant].reset()
            return len(simulations[plant].run(frames))

        return run

    def stepped() -> int:
        simulation = simulations["lpv"]
        simulation.reset()
        for _ in range(frames):
            simulation.step()
        return frames

    return [
        Row("closed loop (LPV), one compiled call", compiled("lpv"), CLOSED_LOOP_HZ, "500 x real time"),
        Row("closed loop (LPV plain), one compiled call", compiled("lpv-plain"), CLOSED_LOOP_HZ),
        Row("closed loop (nonlinear), one compiled call", compiled("nonlinear"), CLOSED_LOOP_HZ),
        Row("closed loop (LPV), one call per frame", stepped, CLOSED_LOOP_HZ),
    ]


def flight_rows() -> list[Row]:
    """A whole headless flight as the command flies it, metrics and history hash included."""
    import scenarios

    def run() -> int:
        record = scenarios.fly("typical_conversion", speed="max")
        return int(record.summary()["frames"])

    run()  # compile
    return [Row("scenarios.fly(..., speed='max'), whole flight", run, CLOSED_LOOP_HZ, "500 x real time")]


def jsbsim_rows(steps: int) -> list[Row]:
    """JSBSim's c172p and f16 trimmed in flight, ``run()`` only; none where JSBSim is not installed."""
    try:
        import jsbsim
    except ImportError:
        sys.stderr.write("JSBSim is not installed (pip install -e '.[benchmark]'): its rows are left out\n")
        return []

    def aircraft(name: str, speed_kt: float) -> Row:
        fdm = jsbsim.FGFDMExec(None)
        fdm.set_debug_level(0)
        fdm.load_model(name)
        fdm.set_dt(1.0 / JSBSIM_HZ)
        fdm["ic/h-sl-ft"] = 5000.0
        fdm["ic/vc-kts"] = speed_kt
        fdm.run_ic()
        fdm["propulsion/set-running"] = -1

        def run() -> int:
            fdm.reset_to_initial_conditions(0)
            for _ in range(steps):
                fdm.run()
            return steps

        return Row(f"JSBSim {jsbsim.__version__} {name}, run() from Python", run, JSBSIM_HZ)

    return [aircraft("c172p", 100.0), aircraft("f16", 350.0)]


def telemetry_rows(pushes: int) -> list[Row]:
    """What showing a frame costs the loop: a push into the view's ring, which nobody empties (it drops the oldest)."""
    from rtsim.frame import SIGNAL_COUNT, TIMING_SIGNALS
    from telemetry.exchange.ring import Ring

    ring, row, timing = Ring(), np.zeros(SIGNAL_COUNT), np.zeros(len(TIMING_SIGNALS))

    def run() -> int:
        for _ in range(pushes):
            ring.push(row, timing)
        return pushes

    return [Row("push of a frame into the view's ring", run, CLOSED_LOOP_HZ, "10 us each")]


def measure(rows: list[Row], repeats: int) -> list[dict[str, object]]:
    """Measure the rows in turns; steps per second and times real time."""
    rates: dict[str, list[float]] = {row.name: [] for row in rows}
    for row in rows:
        row.run()
    for _ in range(repeats):
        for row in rows:
            begin = time.perf_counter()
            steps = row.run()
            rates[row.name].append(steps / (time.perf_counter() - begin))
    return [
        {
            "name": row.name,
            "steps_per_s_best": max(rates[row.name]),
            "steps_per_s_median": statistics.median(rates[row.name]),
            "us_per_step_best": 1e6 / max(rates[row.name]),
            "times_real_time_best": max(rates[row.name]) / row.rate_hz,
            "target": row.target,
        }
        for row in rows
    ]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Throughput of rtsim, with JSBSim beside it.")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--steps", type=int, default=50_000)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows = [
        *plant_step_rows(options.steps),
        *closed_loop_rows(),
        *flight_rows(),
        *telemetry_rows(options.steps),
        *jsbsim_rows(options.steps),
    ]
    results = measure(rows, options.repeats)
    if options.json:
        print(json.dumps({"machine": platform.machine(), "python": platform.python_version(), "rows": results}))
        return
    print(f"{'':52s} {'best':>12s} {'median':>12s} {'best':>8s} {'best':>12s}")
    print(f"{'':52s} {'steps/s':>12s} {'steps/s':>12s} {'us/step':>8s} {'x real time':>12s}  hold")
    for row in results:
        print(
            f"{row['name']:52s} {row['steps_per_s_best']:12,.0f} {row['steps_per_s_median']:12,.0f} "
            f"{row['us_per_step_best']:8.2f} {row['times_real_time_best']:12,.0f}  {row['target']}"
        )


if __name__ == "__main__":
    main()
