"""Looks for the flight that breaks a law: generations asked, flown, kept and told, until something breaks."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import get_args

from rtsim.choices import FalsificationMethod
from rtsim.random_streams import STREAM_SEARCH, stream_generator
from scenarios.campaign.chunks import Task, task_spec
from scenarios.falsification.archive import Archive, Tried
from scenarios.falsification.drawing import RandomSearch
from scenarios.falsification.evaluation import Flyer
from scenarios.falsification.methods import DescentSearch, Method
from scenarios.falsification.situations import SituationSearch
from scenarios.falsification.space import ClassSpace, class_spaces

METHODS: tuple[FalsificationMethod, ...] = get_args(FalsificationMethod)
TURNS: tuple[FalsificationMethod, ...] = (*("situations",) * 3, "cma-es", *("situations",) * 3, "surrogate")
"""Turns of ``mixed``, after the first generations."""
FIRST_PER_CLASS = 4
"""Flights of every class that are drawn before anything is varied."""
MOST_WITHOUT_START = 20
"""Points tried for each flight of the budget, where most have no start."""


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a search has come."""

    flights: int
    """Flights under test."""
    budget: int
    """Flights under test that may be flown."""
    least: tuple[float, ...]
    """Least robustness so far, by property."""


@dataclass(eq=False)
class SearchResult:
    """What a search found."""

    archive: Archive
    """Everything flown."""
    stopped_by: BaseException | None = None
    """Ctrl-C or SIGTERM, for the caller to raise again once all is safe."""
    cpu_s: float = 0.0
    """CPU time of the flights [s]."""
    wall_s: float = 0.0
    """Wall time [s]."""
    problems: list[tuple[Tried, str]] = field(default_factory=list)
    """Flights in which the law failed by itself."""


def run_search(
    task: Task,
    flyer: Flyer,
    *,
    budget: int,
    method: FalsificationMethod = "mixed",
    keep_on: bool = False,
    classes: Sequence[str] = (),
    on_progress: Callable[[Progress], None] | None = None,
) -> SearchResult:
    """Search.

    Args:
        task: What flies and what is asked of it.
        flyer: Who flies.
        budget: Flights under test.
        method: How to look.
        classes: Names of the classes that are searched; empty for all.
        keep_on: Go on for the least robustness when all properties are broken.
        on_progress: Told after each generation.

    Returns:
        What was found: the same for any flyer, and after any interruption.

    Raises:
        KeyboardInterrupt: Ctrl-C came before the first flight.
    """
    spec = task_spec(task.text, task.file)
    spaces = [space for space in class_spaces(spec) if not classes or space.name in classes]
    archive = Archive()
    result = SearchResult(archive)
    plan = _Plan(task, method, archive, spaces)
    begin, number = time.perf_counter(), 0
    try:
        while len(archive.flown) < budget and archive.without_start < MOST_WITHOUT_START * budget:
            targets = (
                [k for k in range(len(task.properties)) if keep_on or not archive.first_broken(k)]
                if archive.flown
                else [0]
            )
            if not targets:
                break
            current = plan.method(number, targets)
            queries = current.ask()[: budget - len(archive.flown)] if method == "random" else current.ask()
            answers = flyer(queries)
            before = len(archive.flown)
            archive.add(queries, answers)
            current.tell(answers)
            result.cpu_s += sum(answer.seconds for answer in answers)
            result.problems += [(one, one.answer.problem) for one in archive.flown[before:] if one.answer.problem]
            number += 1
            if on_progress is not None:
                least = tuple(archive.least(k) for k in range(len(task.properties)))
                on_progress(Progress(len(archive.flown), budget, least))
    except (KeyboardInterrupt, SystemExit) as stop:
        if not archive.flown:
            raise
        result.stopped_by = stop
    result.wall_s = time.perf_counter() - begin
    return result


class _Plan:
    """Whose turn it is."""

    def __init__(self, task: Task, method: FalsificationMethod, archive: Archive, spaces: Sequence[ClassSpace]) -> None:
        self._task, self._name, self._archive, self._spaces = task, method, archive, spaces
        random = stream_generator(task.seed, STREAM_SEARCH, 1)
        self._first = RandomSearch(spaces, random)
        self._methods: dict[tuple[FalsificationMethod, int], Method] = {}
        self._first_flights = FIRST_PER_CLASS * len(spaces)
        self._begun = 0

    def method(self, number: int, targets: Sequence[int]) -> Method:
        """The method of a generation, for one of the properties that are not broken yet."""
        known = math.isfinite(self._archive.least(targets[0]))
        if self._name == "random" or not known or len(self._archive.flown) < self._first_flights:
            self._begun = number + 1
            return self._first
        turn = number - self._begun
        name: FalsificationMethod = self._name if self._name != "mixed" else TURNS[(turn // len(targets)) % len(TURNS)]
        target = targets[turn % len(targets)]
        if (name, target) not in self._methods:
            self._methods[name, target] = self._made(name, target)
        return self._methods[name, target]

    def _made(self, name: FalsificationMethod, target: int) -> Method:
        branch = 2 + METHODS.index(name) + len(METHODS) * target
        random = stream_generator(self._task.seed, STREAM_SEARCH, branch)
        if name == "situations":
            return SituationSearch(self._spaces, self._archive, random)
        return DescentSearch(name, self._archive, target, int(random.integers(2**40)), self._spaces)
