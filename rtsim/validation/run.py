"""Runs the checks, group by group, in as many processes as wished: the results do not depend on it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from rtsim.validation.bench import Bench, the_bench
from rtsim.validation.check import Result, Status
from rtsim.validation.declared import GROUPS, checks_of
from rtsim.worker_pool import work

Progress = Callable[[float, str], None]
"""Called with the work done since the last call, and what comes next."""


@dataclass(frozen=True, slots=True)
class Validation:
    """All results, in the order of the report."""

    results: tuple[Result, ...]
    """The results."""

    def of_group(self, group: str) -> tuple[Result, ...]:
        """The results of one group.

        Args:
            group: Its name.
        """
        return tuple(result for result in self.results if result.check.group == group)

    def of_series(self, series: str) -> tuple[Result, ...]:
        """The results of one series.

        Args:
            series: Its name.
        """
        return tuple(result for result in self.results if result.check.series == series)

    def counts(self) -> dict[Status, int]:
        """How many checks have each verdict."""
        order: tuple[Status, ...] = ("holds", "misses", "reported", "outside")
        return {status: sum(result.status == status for result in self.results) for status in order}


@lru_cache(maxsize=2)
def _bench(changes: tuple[tuple[str, Any], ...]) -> Bench:
    return Bench(dict(changes)) if changes else the_bench()


def frozen(changes: Mapping[str, Any]) -> tuple[tuple[str, Any], ...]:
    """Changes of the aircraft as what can be looked up.

    Args:
        changes: As of ``Xv15.load``.
    """
    return tuple((key, tuple(value) if isinstance(value, list) else value) for key, value in changes.items())


def measured(group: str, changes: tuple[tuple[str, Any], ...] = ()) -> tuple[float, ...]:
    """The model's numbers for the checks of a group, rounded.

    Args:
        group: The group.
        changes: See :func:`frozen`.
    """
    bench = _bench(changes)
    return tuple(check.judged(check.measure(bench)).value for check in checks_of(group))


def validate(*, jobs: int = 1, progress: Progress | None = None, groups: Iterable[str] = GROUPS) -> Validation:
    """Run checks.

    Args:
        jobs: Processes.
        progress: Told what is done; each group counts 1.
        groups: Which groups.
    """
    tell = progress if progress is not None else _silent
    names = list(groups)
    results: list[Result] = []
    tell(0.0, GROUPS[names[0]][0])
    for number, values in enumerate(work(measured, [(name,) for name in names], jobs=jobs)):
        pairs = zip(checks_of(names[number]), values, strict=True)
        results += [check.judged(value) for check, value in pairs]
        following = names[number + 1] if number + 1 < len(names) else names[number]
        tell(1.0, GROUPS[following][0])
    return Validation(tuple(results))


def _silent(_: float, __: str) -> None:
    pass
