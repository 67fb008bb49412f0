"""Fly the paper's paths as docs/optimization.md tells: ``python docs/figures/measure_paths.py``; about ten minutes.

Prints the table of "How well the MOCM flies them", then what the nonlinear aircraft does in turbulence, seed by seed.
"""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from rtsim.analysis.path_stability import path_stability
from rtsim.atmosphere.specification import AirSpecification, Turbulence
from rtsim.frame import COLUMN
from rtsim.loop.setup import FlightSetup
from rtsim.loop.simulation import Simulation
from rtsim.optimization.path import ConversionPath
from rtsim.optimization.paths import PATH_NAMES, corridor_distance_kt, paper_path

MODERATE = AirSpecification(turbulence=Turbulence.of_severity("moderate"))
SEEDS = (*range(8), *range(1000, 1004))


def flown(path: ConversionPath, plant: str, *, seed: int | None = None) -> np.ndarray:
    """Rows of a flight; with a seed in moderate turbulence, with the pilot's noise."""
    setup = FlightSetup(programme=path.programme())
    options = {"plant": plant}
    if seed is not None:
        setup = FlightSetup(programme=path.programme(), air=MODERATE)
        options |= {"pilot_noise": True, "seed": seed}
    return Simulation(setup.with_options(**options)).run(round(path.programme().duration * 250))


def strays(rows: np.ndarray) -> float:
    """Largest error of the height [m]."""
    return float(np.abs(rows[:, COLUMN.altitude_m] - rows[:, COLUMN.altitude_reference_m]).max())


def main() -> None:
    """Print everything."""
    for back in (False, True):
        for name in PATH_NAMES:
            for rate in (3.0,) if name == "centre_line_variable" else (3.0, 8.0):
                path = paper_path(name, nacelle_rate_deg_s=rate, reconversion=back)
                calm, truth = flown(path, "lpv"), flown(path, "nonlinear")
                rough = max(strays(flown(path, "lpv", seed=seed)) for seed in range(10))
                growth = path_stability(path, points=30)
                title = f"`{name}`" + ("" if name == "centre_line_variable" else f", {rate:g} deg/s")
                cells = (
                    title + (", back" if back else ""),
                    f"{path.programme().duration:.1f}",
                    f"{corridor_distance_kt(path):.1f}",
                    f"{strays(calm):.2f}",
                    f"{strays(truth):.2f}",
                    f"{rough:.1f}",
                    f"{strays(flown(path, 'nonlinear', seed=0)):.1f}",
                    f"{calm[:, COLUMN.flapping_deg].sum() / 250.0:.1f}",
                    f"{growth.accelerated_growth.max():+.2f}, {growth.unstable_accelerated_s:.1f} s",
                )
                sys.stdout.write("| " + " | ".join(cells) + " |\n")
                sys.stdout.flush()
    for name in ("typical", "near_stall", "centre_line", "fast_side", "centre_line_variable"):
        path = paper_path(name)
        with ThreadPoolExecutor(2) as pool:
            found = list(pool.map(lambda seed, path=path: strays(flown(path, "nonlinear", seed=seed)), SEEDS))
        sys.stdout.write(f"{name}: " + ", ".join(f"{value:.1f}" for value in found) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
