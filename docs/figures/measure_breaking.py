"""Measures how many flights ``rtsim break`` needs for laws with planted faults, beside random flights.

    python docs/figures/measure_breaking.py LAW FIRST:END [METHOD [BUDGET [CAMPAIGN]]]

LAW is a class of ``examples/broken_laws/planted_laws.py``, seeds are FIRST to END - 1. Prints the flight that broke
it, by seed. A planted law flies like ``full`` until it gives up, so ``full`` is flown, which is compiled, and the law
itself where that comes into its region.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rtsim.choices import FalsificationMethod
from scenarios.falsification.evaluation import Answer, Query, fly_points
from scenarios.falsification.run import BreakOptions, break_task
from scenarios.falsification.search import run_search
from scenarios.falsification.subject import CORRIDOR_KEPT, subject_of

sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "broken_laws"))
import planted_laws
from planted_laws import Region


def kept_away(region: Region) -> str:
    """The formula that a flight never comes where a law gives up.

    Args:
        region: Where that is.
    """
    low, high = region.nacelle_deg
    apart = [f"margin_low_kt > {region.low_kt:g}"] if math.isfinite(region.low_kt) else []
    apart += [f"margin_high_kt > {region.high_kt:g}"] if math.isfinite(region.high_kt) else []
    ways = [f"({' and '.join(apart)})"]
    ways += [f"nacelle_deg < {low:g}"] if math.isfinite(low) else []
    ways += [f"nacelle_deg >= {high:g}"] if math.isfinite(high) else []
    ways += [f"airspeed_kt >= {region.below_kt:g}"] if math.isfinite(region.below_kt) else []
    ways += [f"time_s <= {region.after_s:g}"] if region.after_s > 0.0 else []
    return f"always ({' or '.join(ways)})"


class Shortcut:
    """Flies ``full``, and the planted law where that comes into its region."""

    def __init__(self, campaign: str, law: str, seed: int) -> None:
        """Prepare both."""
        spec, text, file = subject_of(campaign)
        region = kept_away(getattr(planted_laws, law).region)
        options = BreakOptions(law="full", properties=(CORRIDOR_KEPT, region), seed=seed)
        self._full = break_task(spec, text, options=options, file=file)
        options = BreakOptions(law=f"planted_laws:{law}", properties=(CORRIDOR_KEPT,), seed=seed)
        self.task = break_task(spec, text, options=options, file=file)

    def __call__(self, queries: Sequence[Query]) -> list[Answer]:
        """Fly points.

        Args:
            queries: The points.
        """
        answers = []
        for query, known in zip(queries, fly_points(self._full, queries), strict=True):
            if known.robustness[1] < 0.0:
                answers += fly_points(self.task, [query])
            else:
                answers.append(replace(known, robustness=known.robustness[:1], guidance=known.guidance[:1]))
        return answers


def search(law: str, seeds: range, method: FalsificationMethod, budget: int, campaign: str) -> None:
    """Count the flights of a search.

    Args:
        law: Class of the planted law.
        seeds: Seeds.
        method: Method of the search.
        budget: Flights at most.
        campaign: What is searched.
    """
    spec, _, _ = subject_of(campaign)
    needed = []
    for seed in seeds:
        flyer = Shortcut(campaign, law, seed)
        begin = time.perf_counter()
        found = run_search(flyer.task, flyer, budget=budget, method=method)
        first = found.archive.first_broken(0)
        needed.append(first or budget)
        worst = found.archive.worst(0)
        where = f"{spec.classes[worst.query.class_number].name}, nacelles {worst.answer.nacelle_deg:.0f} deg"
        where += f", {worst.answer.airspeed_kt:.0f} kn, {worst.answer.time_s:.0f} s"
        seconds = time.perf_counter() - begin
        print(f"{law} {method} seed {seed}: {first or f'not in {budget}'} ({where}; {seconds:.0f} s)", flush=True)
    print(f"{law} {method}: median {np.median(needed):.0f} of {len(needed)} seeds, largest {max(needed)}", flush=True)


if __name__ == "__main__":
    rest = sys.argv[1:]
    law, seeds, method, budget, campaign = rest + ["", "", "mixed", "2000", "misuse"][len(rest) :]
    search(law, range(*map(int, seeds.split(":"))), method, int(budget), campaign)  # type: ignore[arg-type]
