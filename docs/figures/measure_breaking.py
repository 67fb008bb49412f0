"""Measures how many flights ``rtsim break`` needs for laws with planted faults, beside random flights.

    python docs/figures/measure_breaking.py LAW METHOD SEEDS [BUDGET [CAMPAIGN]]

LAW is a class of ``examples/broken_laws/planted_laws.py``. Prints the flight that broke it, by seed, or the budget.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from rtsim.worker_pool import Workers
from scenarios.falsification.flyers import LocalFlyer
from scenarios.falsification.run import BreakOptions, break_task
from scenarios.falsification.search import run_search
from scenarios.falsification.subject import CORRIDOR_KEPT, subject_of

sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "broken_laws"))


def main() -> None:
    """Measure."""
    law, method, seeds = sys.argv[1], sys.argv[2], range(*map(int, sys.argv[3].split(":")))
    budget = int(sys.argv[4]) if len(sys.argv) > 4 else 2000
    spec, text, file = subject_of(sys.argv[5] if len(sys.argv) > 5 else "misuse")
    needed = []
    for seed in seeds:
        options = BreakOptions(law=f"planted_laws:{law}", properties=(CORRIDOR_KEPT,), seed=seed)
        task = break_task(spec, text, options=options, file=file)
        begin = time.perf_counter()
        found = run_search(task, LocalFlyer(task, Workers(1), 1), budget=budget, method=method)  # type: ignore[arg-type]
        first = found.archive.first_broken(0)
        needed.append(first or budget)
        worst = found.archive.worst(0)
        where = f"{spec.classes[worst.query.class_number].name}, nacelles {worst.answer.nacelle_deg:.0f} deg"
        where += f", {worst.answer.airspeed_kt:.0f} kn, {worst.answer.time_s:.0f} s"
        seconds = time.perf_counter() - begin
        print(f"{law} {method} seed {seed}: {first or f'not in {budget}'} ({where}; {seconds:.0f} s)", flush=True)
    print(f"{law} {method}: median {np.median(needed):.0f} of {len(needed)} seeds, largest {max(needed)}", flush=True)


if __name__ == "__main__":
    main()
