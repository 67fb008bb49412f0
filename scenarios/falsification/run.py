"""``rtsim break`` without its terminal: searches, compares with random flights, shrinks, estimates, reports."""

from __future__ import annotations

import dataclasses
import hashlib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rtsim.choices import FalsificationMethod
from rtsim.errors import InputError, suggestion
from rtsim.properties.formula import parse_property
from rtsim.versions import versions
from scenarios.campaign.chunks import LawVariant, Task, law_code, task_spec
from scenarios.campaign.run import CampaignOptions, make_task
from scenarios.campaign.spec import CampaignFile, properties_of
from scenarios.falsification.counterexample import Counterexample, counterexample
from scenarios.falsification.coverage import Coverage, coverage_of
from scenarios.falsification.evaluation import Flyer, Query
from scenarios.falsification.record import Record
from scenarios.falsification.search import Progress, SearchResult, run_search
from scenarios.falsification.space import ClassSpace, class_spaces
from scenarios.falsification.subject import CORRIDOR_KEPT
from scenarios.falsification.subset_simulation import Estimate, estimate

PROBLEMS_SHOWN = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class BreakOptions:
    """What the user asks of a search."""

    law: str | None = None
    """Law under test; None: the campaign's."""
    properties: tuple[str, ...] = ()
    """Formulas; empty: the campaign's, else that the corridor is kept."""
    budget: int = 1000
    """Flights under test."""
    method: FalsificationMethod = "mixed"
    """How to look."""
    seed: int = 0
    """Root of every random stream."""
    keep_on: bool = False
    """Go on for the least robustness when everything is broken."""
    compare: bool = True
    """Fly as many random flights, for comparison."""
    classes: tuple[str, ...] = ()
    """Classes that are searched; empty for all."""
    changes: Mapping[str, Any] = field(default_factory=dict)
    """Options of all flights instead of the campaign's, by field of ``FlightOptions``, SI."""
    folder: Path | None = None
    """Where generations and reports are kept; None keeps nothing."""
    fresh: bool = False
    """Throw away what the folder holds."""


@dataclass(frozen=True, slots=True, eq=False)
class BreakResult:
    """What came of a search."""

    task: Task
    """What flew."""
    options: BreakOptions
    """What was asked."""
    found: SearchResult
    """The search."""
    random: SearchResult | None
    """Random flights of the same budget."""
    counterexamples: tuple[Counterexample, ...]
    """One for each broken property, but for those on the edge."""
    coverage: Coverage
    """What was flown, and what never."""

    @property
    def broken(self) -> bool:
        """Whether a property was broken, or the law failed by itself."""
        return bool(self.found.problems) or any(
            self.found.archive.first_broken(place) for place in range(len(self.task.properties))
        )

    def report(self, files: Mapping[str, str] | None = None) -> dict[str, Any]:
        """Everything, as JSON values.

        Args:
            files: Scenario file of each counterexample, by formula.
        """
        archive, files = self.found.archive, files or {}
        told = [_told(one, files.get(one.formula)) for one in self.counterexamples]
        spec = task_spec(self.task.text, self.task.file)
        return {
            "campaign": spec.name,
            "law": self.task.laws[0].label,
            "seed": self.task.seed,
            "method": self.options.method,
            "budget": self.options.budget,
            "plant": self.task.options.plant,
            "database_hash": self.task.aircraft_hash,
            "broken": self.broken,
            "properties": [
                {
                    "formula": formula,
                    "robustness_min": archive.least(place),
                    "unit": parse_property(formula).unit,
                    "broken": archive.first_broken(place) is not None,
                    "first_broken": archive.first_broken(place),
                }
                for place, formula in enumerate(self.task.properties)
            ],
            "evaluations": len(archive.flown),
            "without_start": archive.without_start,
            "cpu_s": self.found.cpu_s,
            "wall_s": self.found.wall_s,
            "counterexample": told[0] if told else None,
            "counterexamples": told,
            "random_search": _random(self.random),
            "law_problems": {
                "count": len(self.found.problems),
                "examples": [words for _, words in self.found.problems[:PROBLEMS_SHOWN]],
            },
            "coverage": self.coverage.report(),
        }


@dataclass(frozen=True, slots=True)
class ClassEstimate:
    """How likely one class of flights breaks a property."""

    name: str
    """The class."""
    weight: float
    """Its share of the campaign's flights."""
    estimate: Estimate
    """The estimate."""


@dataclass(frozen=True, slots=True)
class EstimateResult:
    """How likely a property is broken."""

    formula: str
    """The property."""
    classes: tuple[ClassEstimate, ...]
    """By class."""

    def report(self) -> dict[str, Any]:
        """Everything, as JSON values. The interval adds those of the classes, which is wider than need be."""
        probability, low, high = (
            sum(one.weight * getattr(one.estimate, name) for one in self.classes)
            for name in ("probability", "low", "high")
        )
        return {
            "formula": self.formula,
            "unit": parse_property(self.formula).unit,
            "probability": probability,
            "interval": [low, high],
            "flights": sum(one.estimate.evaluations for one in self.classes),
            "classes": [
                {
                    "name": one.name,
                    "probability": one.estimate.probability,
                    "interval": [one.estimate.low, one.estimate.high],
                    "flights": one.estimate.evaluations,
                    "levels": list(one.estimate.levels),
                    "robustness_min": one.estimate.least,
                }
                for one in self.classes
            ],
        }


def break_task(spec: CampaignFile, text: str, *, options: BreakOptions, file: str) -> Task:
    """Decide what flies.

    Args:
        spec: The campaign.
        text: Its text.
        options: What is asked.
        file: Where it came from.

    Raises:
        InputError: A law, a class or a property is not there.
    """
    names = [item.name for item in spec.classes]
    for name in options.classes:
        if name not in names:
            mend = suggestion(name, tuple(names), otherwise="choose one")
            raise InputError("is not a class", key="--class", value=name, allowed=", ".join(names), mend=mend)
    formulas = options.properties or properties_of(spec) or (CORRIDOR_KEPT,)
    for formula in formulas:
        parse_property(formula)
    asked = CampaignOptions(law=options.law, against=(), seed=options.seed, changes=options.changes)
    task = make_task(spec.model_copy(update={"expect": []}), text, options=asked, file=file)
    law = LawVariant(options.law or spec.law)
    return dataclasses.replace(task, laws=(law,), properties=tuple(dict.fromkeys(formulas)))


def identity(task: Task, options: BreakOptions) -> dict[str, Any]:
    """What must agree for finished generations to be used again.

    Args:
        task: What flies.
        options: What is asked.
    """
    return {
        "campaign": hashlib.sha256(task.text.encode()).hexdigest(),
        "law": task.laws[0].label,
        "law_code": law_code(task),
        "properties": list(task.properties),
        "seed": task.seed,
        "method": options.method,
        "classes": list(options.classes),
        "flight": repr(task.options),
        "database": task.aircraft_hash,
        "versions": versions(),
    }


def run_break(
    task: Task,
    flyer: Flyer,
    options: BreakOptions,
    *,
    on_progress: Callable[[str, Progress], None] | None = None,
    on_shrink: Callable[[], None] | None = None,
) -> BreakResult:
    """Search, compare, shrink.

    Args:
        task: What flies.
        flyer: Who flies.
        options: What is asked.
        on_progress: Told what is done and how far it is.
        on_shrink: Told before each flight of shrinking.

    Returns:
        What was found: the same for any flyer, and after any interruption.
    """

    def searched(method: FalsificationMethod, words: str, pieces: str) -> SearchResult:
        who: Flyer = flyer
        if options.folder is not None:
            fresh = options.fresh and pieces == "generations"
            who = Record(options.folder, identity(task, options), flyer, pieces=pieces, fresh=fresh)
        return run_search(
            task,
            who,
            budget=options.budget,
            method=method,
            keep_on=options.keep_on,
            classes=options.classes,
            on_progress=None if on_progress is None else lambda progress: on_progress(words, progress),
        )

    found = searched(options.method, "Searching", "generations")
    random = None
    if options.compare and options.method != "random" and found.stopped_by is None:
        random = searched("random", "Random flights, for comparison", "random")
    examples = []
    for place, formula in enumerate(task.properties):
        if found.archive.least(place) < 0.0:
            example = counterexample(
                task, formula, found.archive.worst(place), name=example_name(task, formula), on_flight=on_shrink
            )
            examples += [] if example is None else [example]
    spaces = _spaces(task, options)
    return BreakResult(task, options, found, random, tuple(examples), coverage_of(task, spaces, found.archive))


def run_estimate(
    task: Task,
    flyer: Flyer,
    options: BreakOptions,
    *,
    points: int,
    on_level: Callable[[str, int, float], None] | None = None,
) -> list[EstimateResult]:
    """Estimate how likely each property is broken, class by class.

    Args:
        task: What flies.
        flyer: Who flies.
        options: What is asked.
        points: Flights of a level.
        on_level: Told the class, the number of its level and the robustness at which it ended.
    """
    spec, spaces = task_spec(task.text, task.file), _spaces(task, options)
    runs = [spec.classes[space.number].runs or spec.runs for space in spaces]
    results = []
    for place, formula in enumerate(task.properties):
        classes = []
        for space, count in zip(spaces, runs, strict=True):
            who: Flyer = flyer
            if options.folder is not None:
                pieces = f"estimate-{place}-{points}-{space.name}"
                who = Record(options.folder, identity(task, options), flyer, pieces=pieces)
            classes.append(
                ClassEstimate(
                    space.name,
                    count / sum(runs),
                    estimate(
                        lambda vectors, space=space, who=who, place=place: _robustness(who, space, vectors, place),  # type: ignore[misc]
                        space.size,
                        points=points,
                        seed=task.seed + space.number,
                        jumps=np.array([one.kind == "seed" for one in space.coordinates], dtype=np.bool_),
                        on_level=None
                        if on_level is None
                        else lambda level, end, space=space: on_level(space.name, level, end),  # type: ignore[misc]
                    ),
                )
            )
        results.append(EstimateResult(formula, tuple(classes)))
    return results


def example_name(task: Task, formula: str) -> str:
    """Name of a counterexample's scenario: of the law, the campaign and the property.

    Args:
        task: What flew.
        formula: The property.
    """
    law = re.sub(r"[^a-z0-9]+", "_", task.laws[0].name.lower()).strip("_")
    number = task.properties.index(formula)
    name = f"broken_{law}_{task_spec(task.text, task.file).name}"
    return (name if len(task.properties) == 1 else f"{name}_{number + 1}")[:90]


def _spaces(task: Task, options: BreakOptions) -> list[ClassSpace]:
    spaces = class_spaces(task_spec(task.text, task.file))
    return [space for space in spaces if not options.classes or space.name in options.classes]


def _robustness(flyer: Flyer, space: ClassSpace, vectors: Any, place: int) -> Any:
    answers = flyer([Query(space.number, vector) for vector in vectors])
    return np.array([answer.robustness[place] for answer in answers], dtype=np.float64)


def _random(found: SearchResult | None) -> dict[str, Any] | None:
    if found is None:
        return None
    archive = found.archive
    places: Sequence[int] = range(len(archive.elites)) if archive.flown else ()
    least = [archive.least(place) for place in places]
    firsts = [archive.first_broken(place) for place in places]
    return {
        "robustness_min": least[0] if least else None,
        "first_broken": firsts[0] if firsts else None,
        "evaluations": len(archive.flown),
        "properties": [
            {"robustness_min": value, "first_broken": first} for value, first in zip(least, firsts, strict=True)
        ],
    }


def _told(one: Counterexample, file: str | None) -> dict[str, Any]:
    nonlinear = one.nonlinear
    return {
        "formula": one.formula,
        "scenario_file": file,
        "history_sha256": one.history_sha256,
        "robustness": one.robustness.value,
        "unit": one.robustness.unit,
        "decides": one.robustness.decides,
        "time_s": one.robustness.time,
        "robustness_as_found": one.as_found.value,
        "nonlinear_robustness": None if nonlinear is None else nonlinear.value,
        "sentence": one.sentence,
        "shrinking_flights": one.flights,
    }
