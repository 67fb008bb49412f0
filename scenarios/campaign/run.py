"""Runs a campaign: pieces in order, kept as they come, until the verdict is certain."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rtsim.errors import InputError
from rtsim.loop.aircraft import database_of
from rtsim.loop.option_tables import given
from rtsim.loop.options import FlightOptions
from rtsim.measures.metric_kernels import VALUE
from rtsim.versions import versions
from scenarios.campaign.chunks import (
    ChunkResult,
    LawVariant,
    Task,
    law_chain,
    law_code,
    plan_chunks,
    present_folder,
)
from scenarios.campaign.executors import Executor, LocalExecutor
from scenarios.campaign.preflight import scenario_problems
from scenarios.campaign.spec import CampaignFile, properties_of
from scenarios.campaign.store import Store
from scenarios.campaign.verdict import Flights, Judged, decided, judge, summarize

PROBLEMS_SHOWN = 5
"""Examples of what went wrong in laws that a report holds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignOptions:
    """What the user asks of a campaign besides its file."""

    law: str | None = None
    """Law under test; None: the file's."""
    against: tuple[str, ...] | None = None
    """Laws flown on the same runs besides ``off``; None: the file's."""
    buffers_kt: tuple[float, ...] = ()
    """Buffers to sweep [kn]: the law under test is flown with each of them too."""
    runs: int | None = None
    """Runs of every class; None: the file's."""
    seed: int = 0
    """Seed of every draw."""
    changes: Mapping[str, Any] = field(default_factory=dict)
    """Options of all flights instead of the file's, by field of ``FlightOptions``, SI."""
    early_stop: bool = True
    """End as soon as the verdict is certain."""
    folder: Path | None = None
    """Where finished pieces and reports are kept; None keeps nothing."""
    fresh: bool = False
    """Throw away what the folder holds."""


@dataclass(frozen=True, slots=True, eq=False)
class CampaignResult:
    """A campaign that was flown."""

    spec: CampaignFile
    """The campaign."""
    task: Task
    """What was flown."""
    flights: Flights
    """Its flights."""
    judged: tuple[Judged, ...]
    """Its expectations."""
    problems: tuple[tuple[str, int, str, str], ...]
    """What went wrong in laws: class, run, law, sentence."""
    stopped_early: bool
    """Whether it ended before all flights were flown, its verdict being certain."""
    reused: int
    """Pieces that an earlier, interrupted campaign had finished."""
    wall_s: float
    """Wall time [s]."""
    cpu_s: dict[str, float]
    """CPU time of the flights by law [s]."""

    @property
    def held(self) -> bool:
        """Whether every expectation held and no law under test failed."""
        failed = any(law == self.task.laws[0].label for _, _, law, _ in self.problems)
        return not failed and all(item.held for item in self.judged)

    def report(self) -> dict[str, Any]:
        """Everything, as JSON values."""
        flown = sum(len(metrics) for metrics in self.flights.metrics)
        return {
            "campaign": self.spec.name,
            "law": self.task.laws[0].label,
            "seed": self.task.seed,
            "plant": self.task.options.plant,
            "database": self.task.options.database,
            **self.task.options.condition.attributes,
            "database_hash": self.task.aircraft_hash,
            "corridor_name": self.task.options.corridor_name,
            "rate_hz": self.task.options.rate_hz,
            "runs": flown,
            "runs_planned": sum(self.flights.planned),
            "flights": flown * len(self.flights.laws),
            "stopped_early": self.stopped_early,
            "reused_chunks": self.reused,
            "wall_s": self.wall_s,
            "cpu_s": self.cpu_s,
            "held": self.held,
            "expectations": [
                {
                    "name": item.name,
                    "event": item.event,
                    "law": item.law,
                    "classes": list(item.classes),
                    "held": item.held,
                    "count": item.rate.count,
                    "total": item.rate.total,
                    "value": item.rate.value,
                    "interval": [item.rate.low, item.rate.high],
                    "upper_bound": item.rate.upper,
                    "limit": item.limit,
                    "robustness_min": item.robustness,
                }
                for item in self.judged
            ],
            "law_problems": {
                "count": len(self.problems),
                "flights": len({(place, run, law) for place, run, law, _ in self.problems}),
                "examples": [
                    {"class": place, "run": run, "law": law, "text": text}
                    for place, run, law, text in self.problems[:PROBLEMS_SHOWN]
                ],
            },
            **summarize(self.flights, self.task.seed),
        }


def run_campaign(
    spec: CampaignFile,
    text: str,
    *,
    options: CampaignOptions,
    executor: Executor | None = None,
    file: str = "campaign",
    on_progress: Callable[[int, int], None] | None = None,
) -> CampaignResult:
    """Fly a campaign.

    Args:
        spec: The campaign.
        text: Its text, which workers read again.
        options: What is asked of it.
        executor: Who does the work; None: this process.
        on_progress: Told runs done and runs planned.

    Returns:
        What came of it: the same for any executor, and after any interruption.

    Raises:
        InputError: A law does not exist, or the folder holds another campaign.
    """
    task = make_task(spec, text, options=options, file=file)
    chunks = plan_chunks(spec, options.runs)
    planned = tuple(
        sum(chunk.count for chunk in chunks if chunk.class_number == number) for number in range(len(spec.classes))
    )
    store = None
    if options.folder is not None:
        store = Store(options.folder, identity(task), fresh=options.fresh)
    finished = {} if store is None else {chunk: found for chunk in chunks if (found := store.load(chunk)) is not None}
    reused = len(finished)
    begin = time.perf_counter()
    missing = [chunk for chunk in chunks if chunk not in finished]
    work = (executor or LocalExecutor(1)).fly(task, missing)
    results: list[ChunkResult] = []
    judged: list[Judged] = []
    stopped = False
    try:
        for chunk in chunks:
            while chunk not in finished:
                result = next(work)
                finished[result.chunk] = result
                if store is not None:
                    store.save(result)
            results.append(finished[chunk])
            if on_progress is not None:
                on_progress(sum(item.chunk.count for item in results), sum(planned))
            judged = judge(_flights(spec, task.laws, results, planned), final=False)
            if options.early_stop and decided(judged) and len(results) < len(chunks):
                stopped = True
                break
    finally:
        close = getattr(work, "close", None)
        if close is not None:
            close()
    flights = _flights(spec, task.laws, results, planned)
    if not stopped:
        judged = judge(flights, final=True)
    return CampaignResult(
        spec=spec,
        task=task,
        flights=flights,
        judged=tuple(judged),
        problems=tuple(
            (spec.classes[item.chunk.class_number].name, run, task.laws[law].label, words)
            for item in results
            for run, law, words in item.problems
        ),
        stopped_early=stopped,
        reused=reused,
        wall_s=time.perf_counter() - begin,
        cpu_s={law.label: float(sum(item.seconds[place] for item in results)) for place, law in enumerate(task.laws)},
    )


def make_task(spec: CampaignFile, text: str, *, options: CampaignOptions, file: str) -> Task:
    """Decide which laws are flown, on what.

    Args:
        spec: The campaign.
        text: Its text.
        options: What is asked of it.
        file: Where it came from.

    Raises:
        InputError: A law does not exist, or an option is out of range.
    """
    tested = options.law or spec.law
    against = spec.against if options.against is None else list(options.against)
    folder = present_folder()
    for name in (tested, *against):
        law_chain(name, folder)
    for problem in scenario_problems(spec, file):
        raise problem
    names = [tested, *(name for name in against if name not in {tested, "off"})]
    laws = [LawVariant(name) for name in names]
    for buffer in options.buffers_kt:
        if buffer != 0.0:
            if not laws[0].compiled:
                raise InputError("only built-in laws have buffers to sweep", key="--sweep-buffer-kt", value=buffer)
            laws.append(LawVariant(tested, buffer))
    unknown = [clause.of for clause in spec.expect if clause.of not in {"law", "off", *names}]
    if unknown:
        raise InputError(
            f"the campaign's expectations are about the law {unknown[0]}, which is not flown",
            key="--against",
            mend=f"add --against {unknown[0]}",
        )
    flown = FlightOptions(**given(spec, file)).changed(options.changes)
    return Task(
        text=text,
        file=file,
        laws=(*laws, LawVariant("off")),
        seed=options.seed,
        options=flown,
        folder=folder,
        aircraft_hash=database_of(flown.aircraft).aircraft_hash,
        properties=properties_of(spec),
    )


def identity(task: Task) -> dict[str, Any]:
    """What must agree for finished pieces to be used again.

    Args:
        task: The campaign.
    """
    return {
        "campaign": hashlib.sha256(task.text.encode()).hexdigest(),
        "laws": [law.label for law in task.laws],
        "law_code": law_code(task),
        "seed": task.seed,
        "plant": task.options.plant,
        "rate_hz": task.options.rate_hz,
        "metrics": list(VALUE.asdict()),
        "properties": list(task.properties),
        "database": task.aircraft_hash,
        "versions": versions(),
    }


def _flights(
    spec: CampaignFile, laws: tuple[LawVariant, ...], results: Sequence[ChunkResult], planned: tuple[int, ...]
) -> Flights:
    empty = np.zeros((0, len(laws), VALUE.size))
    none = np.zeros((0, len(laws), len(properties_of(spec))))
    return Flights(
        spec=spec,
        laws=laws,
        metrics=tuple(
            np.concatenate([empty, *(item.metrics for item in results if item.chunk.class_number == number)])
            for number in range(len(spec.classes))
        ),
        robustness=tuple(
            np.concatenate([none, *(item.robustness for item in results if item.chunk.class_number == number)])
            for number in range(len(spec.classes))
        ),
        planned=planned,
    )
