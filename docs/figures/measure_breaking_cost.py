"""Measures what a flight costs in a search, beside the same number of flights in a campaign, in one process.

    python docs/figures/measure_breaking_cost.py [RUNS [ROUNDS]]

RUNS of every class of ``misuse`` under ``full`` each way, in turns, first one and then the other first; CPU time, with
all that the search does between flights. Run it on a quiet machine.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np

from scenarios.campaign.chunks import Task, fly_chunk, plan_chunks
from scenarios.falsification.evaluation import fly_points
from scenarios.falsification.run import BreakOptions, break_task
from scenarios.falsification.search import run_search
from scenarios.falsification.subject import CORRIDOR_KEPT, subject_of


def cpu_per_flight(work: Callable[[int], int], seed: int) -> float:
    """CPU time of a flight [s].

    Args:
        work: Flies with a seed, and says how many flights that were.
        seed: The seed.
    """
    begin = time.process_time()
    flights = work(seed)
    return (time.process_time() - begin) / flights


def main() -> None:
    """Measure."""
    runs, rounds = (int(one) for one in [*sys.argv[1:], "60", "6"][:2])
    spec, text, file = subject_of("misuse")

    def task(seed: int) -> Task:
        options = BreakOptions(law="full", properties=(CORRIDOR_KEPT,), seed=seed)
        return break_task(spec, text, options=options, file=file)

    def search(seed: int) -> int:
        flown = task(seed)
        budget = runs * len(spec.classes)
        found = run_search(flown, lambda queries: fly_points(flown, queries), budget=budget, keep_on=True)
        return len(found.archive.flown)

    def campaign(seed: int) -> int:
        return sum(len(fly_chunk(task(seed), chunk).metrics) for chunk in plan_chunks(spec, runs))

    fly_points(task(0), [])
    ratios = []
    for seed in range(rounds):
        cost = {}
        for work in (search, campaign) if seed % 2 else (campaign, search):
            cost[work] = cpu_per_flight(work, seed)
        ratios.append(cost[search] / cost[campaign])
        times = f"search {1e3 * cost[search]:.1f} ms, campaign {1e3 * cost[campaign]:.1f} ms"
        print(f"{times}: {ratios[-1]:.2f}", flush=True)
    print(f"median ratio {np.median(ratios):.2f} of {rounds} rounds of {runs * len(spec.classes)} flights each way")


if __name__ == "__main__":
    main()
