"""What a campaign says: counts with bounds, laws against each other, expectations held or not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.measures.metric_kernels import METRICS, VALUE
from scenarios.campaign.chunks import LawVariant
from scenarios.campaign.events import EVENTS
from scenarios.campaign.spec import CampaignFile, ExpectRate, properties_of
from scenarios.campaign.statistics import Rate, bound_decided, flights_to_bound, mcnemar, quantile, rate

BOOTSTRAP_SEED = 20_000
"""Added to the campaign's seed for the resampling."""


@dataclass(frozen=True, slots=True, eq=False)
class Flights:
    """All flights so far, class by class."""

    spec: CampaignFile
    """The campaign."""
    laws: tuple[LawVariant, ...]
    """The laws; the last is ``off``."""
    metrics: tuple[FloatArray, ...]
    """By class: metrics, shape (runs, laws, VALUE.size)."""
    robustness: tuple[FloatArray, ...]
    """By class: robustness in the campaign's properties, shape (runs, laws, properties)."""
    planned: tuple[int, ...]
    """By class: runs of the whole campaign."""

    @property
    def off(self) -> int:
        """Place of the unprotected flights among the laws."""
        return len(self.laws) - 1

    def happened(self, event: str, law: int, classes: Sequence[str] = ()) -> FloatArray:
        """Whether an event happened, flight by flight, as 0 and 1.

        Args:
            event: One of ``EVENTS``.
            law: Place of the law.
            classes: Names of the classes; empty for all.
        """
        test = EVENTS[event]
        found = [
            test(metrics[:, law], metrics[:, self.off])
            for item, metrics in zip(self.spec.classes, self.metrics, strict=True)
            if not classes or item.name in classes
        ]
        return np.concatenate(found).astype(np.float64)

    def broken(self, formula: str, law: int, classes: Sequence[str] = ()) -> tuple[FloatArray, float]:
        """Whether flights broke a property, as 0 and 1, and the least robustness; inf of none.

        Args:
            formula: The property.
            law: Place of the law.
            classes: Names of the classes; empty for all.
        """
        place = properties_of(self.spec).index(formula)
        found = np.concatenate(
            [
                robustness[:, law, place]
                for item, robustness in zip(self.spec.classes, self.robustness, strict=True)
                if not classes or item.name in classes
            ]
        )
        return (found < 0.0).astype(np.float64), float(found.min(initial=math.inf))

    def runs_planned(self, classes: Sequence[str]) -> int:
        """Flights of the whole campaign in some classes.

        Args:
            classes: Their names; empty for all.
        """
        return sum(
            count
            for item, count in zip(self.spec.classes, self.planned, strict=True)
            if not classes or item.name in classes
        )

    def place_of(self, law: str) -> int:
        """Place of a law by how expectations call it.

        Args:
            law: ``law``, ``off`` or a law's name.
        """
        if law == "law":
            return 0
        return next(place for place, item in enumerate(self.laws) if item.name == law and item.buffer_kt == 0.0)


@dataclass(frozen=True, slots=True)
class Judged:
    """One expectation and what the campaign made of it."""

    name: str
    """What was expected, in words."""
    event: str
    """What was counted: an event, or flights that broke a property."""
    law: str
    """Of which law."""
    classes: tuple[str, ...]
    """In which classes; empty for all."""
    limit: str
    """What was allowed, such as ``upper bound <= 0.01``."""
    rate: Rate
    """What was found."""
    held: bool | None
    """Whether it held; None while that is not decided."""
    robustness: float | None = None
    """The least robustness in the property; None of an event."""

    @property
    def sentence(self) -> str:
        """What to say where it failed."""
        least = "" if self.robustness is None else f", least robustness {self.robustness:.4g}"
        found = f"{self.rate.value:.4g} (bound {self.rate.upper:.4g}{least})"
        return f"{self.event} of {self.law}={found} want {self.limit}"


def judge(flights: Flights, *, final: bool) -> list[Judged]:
    """Judge the expectations of a campaign.

    Args:
        flights: What was flown.
        final: Whether this is all; else only what more flights cannot change is decided.
    """
    return [_judged(flights, clause, final=final) for clause in flights.spec.expect]


def _judged(flights: Flights, clause: ExpectRate, *, final: bool) -> Judged:
    law = flights.place_of(clause.of)
    least = None
    if clause.property is not None:
        happened, least = flights.broken(clause.property, law, clause.classes)
    else:
        assert clause.event is not None  # the file was checked
        happened = flights.happened(clause.event, law, clause.classes)
    count, done = int(happened.sum()), len(happened)
    confidence = flights.spec.confidence
    planned = done if final else flights.runs_planned(clause.classes)
    verdicts, words = [], []
    if clause.upper_max is not None:
        verdicts.append(bound_decided(count, done, planned, clause.upper_max, confidence=confidence))
        least_flights = flights_to_bound(clause.upper_max, confidence=confidence) if clause.upper_max > 0.0 else 0
        impossible = f" (takes at least {least_flights} flights: raise the runs)" if planned < least_flights else ""
        words.append(f"upper bound <= {clause.upper_max:g}{impossible}")
    if clause.rate_max is not None:
        most = math.floor(clause.rate_max * planned + 1e-9)
        verdicts.append(False if count > most else True if count + planned - done <= most else None)
        words.append(f"rate <= {clause.rate_max:g}")
    if clause.rate_min is not None:
        least = math.ceil(clause.rate_min * planned - 1e-9)
        verdicts.append(True if count >= least else False if count + planned - done < least else None)
        words.append(f"rate >= {clause.rate_min:g}")
    held = False if False in verdicts else None if None in verdicts else True
    return Judged(
        name=clause.name,
        event=clause.event or f"broken: {clause.property}",
        law=flights.laws[law].label,
        classes=tuple(clause.classes),
        limit=" and ".join(words),
        rate=rate(count, done, confidence=confidence),
        held=held,
        robustness=least,
    )


def decided(judged: Sequence[Judged]) -> bool:
    """Whether more flights can change nothing of the verdict; a campaign without expectations is flown to its end.

    Args:
        judged: The expectations so far.
    """
    return bool(judged) and all(item.held is not None for item in judged)


def summarize(flights: Flights, seed: int) -> dict[str, Any]:
    """Everything a campaign found, as JSON values.

    Args:
        flights: What was flown.
        seed: The campaign's seed, from which the bootstrap's follows.
    """
    laws = [_law_summary(flights, place, seed) for place in range(len(flights.laws))]
    return {
        "laws": laws,
        "classes": [
            {
                "name": item.name,
                "nominal": item.nominal,
                "runs": len(metrics),
                "laws": {
                    law.label: {
                        event: _rate(happened, flights)
                        for event in ("exceeded", "deep", "activated", "harmed")
                        for happened in (flights.happened(event, place, (item.name,)),)
                    }
                    for place, law in enumerate(flights.laws)
                },
            }
            for item, metrics in zip(flights.spec.classes, flights.metrics, strict=True)
        ],
        "comparisons": _comparisons(flights),
        "operating_characteristic": _characteristic(flights),
    }


def _rate(happened: FloatArray, flights: Flights) -> dict[str, Any]:
    found = rate(int(happened.sum()), len(happened), confidence=flights.spec.confidence)
    return {"value": found.value, **asdict(found)}


def _law_summary(flights: Flights, place: int, seed: int) -> dict[str, Any]:
    events = {}
    for event in EVENTS:
        happened = flights.happened(event, place)
        events[event] = _rate(happened, flights)
    metrics = np.concatenate([values[:, place] for values in flights.metrics])
    off = np.concatenate([values[:, flights.off] for values in flights.metrics])
    outside = metrics[:, VALUE.exceedances] > 0.0
    found: dict[str, Any] = {}
    for item in METRICS:
        values = metrics[:, getattr(VALUE, item.name)]
        statistics = {}
        for words in item.campaign:
            name, _, which = words.partition(" ")
            statistics[name] = _statistic(name, values[outside] if which else values, flights, seed)
        if statistics:
            found[item.name] = statistics.get("rms", statistics)
    beyond = metrics[:, VALUE.height_lost_m] - off[:, VALUE.height_lost_m]
    return {
        "law": flights.laws[place].label,
        "buffer_kt": flights.laws[place].buffer_kt,
        "flights": len(metrics),
        "events": events,
        **found,
        "height_lost_beyond_off_m": {"max": float(beyond.max(initial=0.0))},
    }


def _statistic(name: str, values: FloatArray, flights: Flights, seed: int) -> Any:
    """A statistic of a metric over flights: ``max``, ``rms``, or a quantile with its interval, such as ``p95``."""
    if name == "max":
        return float(values.max(initial=0.0))
    if name == "rms":
        return float(np.sqrt(np.mean(values**2)))
    share, seed = int(name.removeprefix("p")) / 100.0, seed % 2**32 + BOOTSTRAP_SEED
    return asdict(quantile(values, share, seed=seed, confidence=flights.spec.confidence))


def _comparisons(flights: Flights) -> list[dict[str, Any]]:
    """The law under test against every other one, on the same flights."""
    found = []
    for other in range(1, len(flights.laws)):
        for event in ("exceeded", "deep", "harmed"):
            pair = mcnemar(flights.happened(event, 0), flights.happened(event, other))
            found.append(
                {"law": flights.laws[0].label, "against": flights.laws[other].label, "event": event, **asdict(pair)}
            )
    return found


def _characteristic(flights: Flights) -> list[dict[str, Any]]:
    """Nuisance against exceedance of the law under test, by buffer."""
    name = flights.laws[0].name
    nominal = [item.name for item in flights.spec.classes if item.nominal]
    other = [item.name for item in flights.spec.classes if not item.nominal]
    found = []
    for place, law in sorted(enumerate(flights.laws), key=lambda pair: pair[1].buffer_kt):
        if law.name != name:
            continue
        point: dict[str, Any] = {"law": law.label, "buffer_kt": law.buffer_kt}
        for key, event, classes in (("nuisance", "nuisance", nominal), ("exceeded", "exceeded", other)):
            happened = flights.happened(event, place, classes) if classes else np.zeros(0)
            point[key] = _rate(happened, flights)
        found.append(point)
    return found if len(found) > 1 else []
