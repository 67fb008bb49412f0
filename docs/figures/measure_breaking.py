"""Measures how many flights ``rtsim break`` needs for laws with planted faults, beside random flights.

    python docs/figures/measure_breaking.py search LAW SEEDS [METHOD [BUDGET [CAMPAIGN]]]
    python docs/figures/measure_breaking.py random SEEDS [BUDGET [CAMPAIGN]]

LAW is a class of ``examples/broken_laws/planted_laws.py``, SEEDS is FIRST:LAST+1. Prints the flight that broke it, by
seed. ``random`` does so for all laws at once: a law that sleeps flies like ``full`` until it sleeps, so only those
random flights of ``full`` that come where a law sleeps are flown with it.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from rtsim.frame import COLUMN
from rtsim.random_streams import STREAM_SEARCH, stream_generator
from rtsim.worker_pool import Workers
from scenarios.campaign.chunks import LawVariant, fly_law
from scenarios.campaign.draws import NoStart
from scenarios.campaign.trial import Bench
from scenarios.falsification.drawing import RandomSearch
from scenarios.falsification.evaluation import fly_points
from scenarios.falsification.flyers import LocalFlyer
from scenarios.falsification.run import BreakOptions, break_task
from scenarios.falsification.search import run_search
from scenarios.falsification.space import class_spaces
from scenarios.falsification.subject import CORRIDOR_KEPT, subject_of

sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "broken_laws"))
LAWS = ("LowSpeed", "Hover", "HighCorner", "LowCorner", "Late", "LateCorner")
SEEN = (COLUMN.time_s, COLUMN.airspeed_kt, COLUMN.nacelle_deg, COLUMN.margin_low_kt, COLUMN.margin_high_kt)


def search(law: str, seeds: range, method: str = "mixed", budget: int = 2000, campaign: str = "misuse") -> None:
    """Count the flights of a search.

    Args:
        law: Class of the planted law.
        seeds: Seeds.
        method: Method of the search.
        budget: Flights at most.
        campaign: What is searched.
    """
    spec, text, file = subject_of(campaign)
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


def random(seeds: range, budget: int = 2000, campaign: str = "misuse") -> None:
    """Count the flights of a random search.

    Args:
        seeds: Seeds.
        budget: Flights at most.
        campaign: What is searched.
    """
    import planted_laws

    spec, text, file = subject_of(campaign)
    spaces, bench = class_spaces(spec), Bench()
    needed: dict[str, list[int]] = {law: [] for law in LAWS}
    for seed in seeds:
        task = break_task(
            spec, text, options=BreakOptions(law="full", properties=(CORRIDOR_KEPT,), seed=seed), file=file
        )
        draws = RandomSearch(spaces, stream_generator(seed, STREAM_SEARCH, 1))
        first: dict[str, int] = {}
        flights = 0
        while flights < budget and len(first) < len(LAWS):
            query = draws.draw()
            try:
                plan = spaces[query.class_number].plan(spec, query.vector, task.options)
            except NoStart:
                continue
            flights += 1
            columns = fly_law(bench, plan, LawVariant("full")).rows[:, SEEN].T.copy()
            for law in LAWS:
                if law not in first and getattr(planted_laws, law).region.holds(*columns).any():
                    other = replace(task, laws=(LawVariant(f"planted_laws:{law}"),))
                    if fly_points(other, [query])[0].robustness[0] < 0.0:
                        first[law] = flights
        for law in LAWS:
            needed[law].append(first.get(law, budget))
        print(f"random seed {seed}: {first}", flush=True)
    for law in LAWS:
        print(
            f"{law} random: median {np.median(needed[law]):.0f} of {len(seeds)} seeds: {sorted(needed[law])}",
            flush=True,
        )


if __name__ == "__main__":
    what, *arguments = sys.argv[1:]
    place = 0 if what == "random" else 1
    numbers = range(*map(int, arguments[place].split(":")))
    rest = [int(one) if one.isdigit() else one for one in arguments[place + 1 :]]
    if what == "random":
        random(numbers, *rest)  # type: ignore[arg-type]
    else:
        search(arguments[0], numbers, *rest)  # type: ignore[arg-type]
