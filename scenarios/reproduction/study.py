"""Flies everything the paper's figures and claims need, in parallel, and judges the claims."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

from rtsim.errors import InputError
from rtsim.lpv.files.storage import load_database
from rtsim.optimization.path import ConversionPath
from rtsim.worker_pool import work
from scenarios.reproduction.claims import Claim, judge_claims
from scenarios.reproduction.evidence import (
    Evidence,
    Number,
    corridor_differences,
    grid_errors,
    lpv_differences,
    twelve_seconds,
    valley_and_ridges,
)
from scenarios.reproduction.flights import BASELINE, VARIANTS, Flight, Flyer, Variant, paper_paths
from scenarios.reproduction.measures import FlightMeasures, measure

REFERENCE_CORRIDOR = {
    "nacelle_deg": [90.0, 75.0, 60.0, 50.0, 45.0, 40.0, 30.0, 20.0, 10.0, 0.0],
    "low_kt": [0.0, 0.0, 55.4, 66.7, 71.3, 75.3, 82.6, 89.1, 95.2, 101.0],
    "high_kt": [125.0, 140.0, 155.0, 165.0, 170.0, 170.0, 170.0, 170.0, 170.0, 170.0],
}
"""Corners read from NASA TM X-62407, Figures 4.1.1 and 5.4.1 (13 000 lb, V_C), to 1.5 kn."""
TRUTH, PLAIN = "nonlinear", "two-variable"
"""Variants that the LPV form is compared with."""
DESIGN_WEIGHT = 8
"""What the design of a pilot counts in the progress, in flights."""


@dataclass(frozen=True, slots=True, eq=False)
class Study:
    """Everything that was flown and judged."""

    flights: Mapping[str, Flight]
    """The baseline's flights by path."""
    paths: Mapping[str, ConversionPath]
    """The paths."""
    claims: tuple[Claim, ...]
    """The claims, in the paper's order."""
    evidence: Mapping[str, Evidence]
    """What each variant shows, by its name."""
    database_hash: str
    """Hash of the aircraft that was flown."""
    database: str = ""
    """Its LPV database, a file; empty: the shipped XV-15."""


@dataclass(frozen=True, slots=True, eq=False)
class _Flown:
    """One variant's part of the work."""

    variant: Variant
    measures: dict[str, FlightMeasures]
    flights: dict[str, Flight]
    """Only what is needed later: all of the baseline, one conversion of the others."""


def work_amount(variants: tuple[Variant, ...] = VARIANTS) -> int:
    """Amount of work of a study, in the unit of its progress: one flight.

    Args:
        variants: Who flies.
    """
    return (
        len(variants) * len(paper_paths()) + DESIGN_WEIGHT * sum(variant.pilot is not None for variant in variants) + 2
    )


def run_study(
    *,
    jobs: int = 1,
    progress: Callable[[float, str], None] | None = None,
    variants: tuple[Variant, ...] = VARIANTS,
    database: str = "",
) -> Study:
    """Fly and judge.

    Args:
        jobs: Processes to use; the result does not depend on it.
        progress: Called with the work done since the last call and what is done now; it adds up to :func:`work_amount`.
        variants: Who flies; the first one is what counts. ``nonlinear`` and ``two-variable`` must be among them.
        database: LPV database that is flown, a file; empty: the shipped XV-15.

    Raises:
        InputError: The database cannot be used, or is of another aircraft than the paper's.
    """
    aircraft = load_database(database or None)
    if not aircraft.profile.is_xv15:
        raise InputError(
            f"is of the {aircraft.profile.name}, and the paper's claims are about the XV-15",
            file=database, mend="fly a database that borrows every part of the XV-15's profile",
        )  # fmt: skip
    variants = tuple(replace(variant, database=database) for variant in variants)
    advance = progress if progress is not None else _ignore
    flown: dict[str, _Flown] = {}
    for part in _all_flown(variants, jobs, advance):
        whole = flown.setdefault(part.variant.name, _Flown(part.variant, {}, {}))
        whole.measures.update(part.measures)
        whole.flights.update(part.flights)
    for whole in flown.values():
        _sort_as_asked(whole)
    base = flown[variants[0].name]
    facts: dict[str, dict[str, Number]] = {
        "fig1_corridor": corridor_differences(REFERENCE_CORRIDOR),
        "fig6_map": valley_and_ridges(database),
        "fig8_worse": {
            "nonlinear_peak_deg": flown[TRUTH].measures["fast_side_table_1_caps"].metrics.flapping_deg.peak,
        },
        "text_12_s": twelve_seconds(database),
        "text_lpv_accuracy": lpv_differences(
            base.flights["typical"], flown[PLAIN].flights["typical"], flown[TRUTH].flights["typical"]
        ),
    }
    advance(1.0, "Judging the claims")
    facts |= grid_errors(database)
    advance(1.0, "Judging the claims")
    evidence = {variant.name: Evidence(flown[variant.name].measures, facts) for variant in variants}
    others = {variant: evidence[variant.name] for variant in variants[1:]}
    return Study(
        flights=base.flights,
        paths=paper_paths(database),
        claims=judge_claims(evidence[variants[0].name], others),
        evidence=evidence,
        database_hash=aircraft.aircraft_hash,
        database=database,
    )


def _tasks(variants: tuple[Variant, ...]) -> list[tuple[Variant, tuple[str, ...]]]:
    """Pieces of work, the longest first, so that the processes end together; a pilot is designed only once."""
    names = tuple(paper_paths())
    tasks: list[tuple[Variant, tuple[str, ...]]] = []
    for variant in sorted(variants, key=lambda variant: (variant.pilot is None, variant.plant != "nonlinear")):
        tasks += [(variant, names)] if variant.pilot is not None else [(variant, (name,)) for name in names]
    return tasks


def _all_flown(variants: tuple[Variant, ...], jobs: int, advance: Callable[[float, str], None]) -> Iterator[_Flown]:
    tasks = _tasks(variants)
    for part in work(_fly_variant, tasks, jobs=jobs):
        done = len(part.measures) + (DESIGN_WEIGHT if part.variant.pilot is not None else 0)
        advance(done, f"Flying the paper, {part.variant.name}")
        yield part


def _sort_as_asked(part: _Flown) -> None:
    """Put the flights into the order of the paths: they come back as they were finished."""
    measures, flights = dict(part.measures), dict(part.flights)
    part.measures.clear()
    part.flights.clear()
    for name in paper_paths():
        if name in measures:
            part.measures[name] = measures[name]
        if name in flights:
            part.flights[name] = flights[name]


def _fly_variant(variant: Variant, names: tuple[str, ...]) -> _Flown:
    """Fly and measure paths by one variant."""
    flyer = Flyer(variant)
    paths = paper_paths(variant.database)
    measures, flights = {}, {}
    for name in names:
        flight = flyer.fly(name, paths[name])
        measures[name] = measure(flight)
        if variant.name == BASELINE.name or name == "typical":
            flights[name] = flight
    return _Flown(variant, measures, flights)


def _ignore(_amount: float, _words: str) -> None:
    pass
