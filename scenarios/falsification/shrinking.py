"""Shrinks a scenario that breaks a property until nothing more can be left out.

What is tried stands in one order: to end sooner, to leave out whole things (failures, gusts, movements, air, turns,
points of the programme), to halve what is left, to write numbers shorter. A change is kept where the property is still
broken; the order is gone through until no change is kept (delta debugging, Zeller and Hildebrandt 2002).
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator
from typing import Any

from scenarios.falsification.scenario_tables import Tables, rounded

Change = Callable[[Tables], None]
Test = Callable[[Tables], bool]
"""Whether tables still break the property; False also where they cannot be flown."""

LISTS = (("faults",), ("air", "gusts"), ("pulses",))
"""Lists whose members can be left out."""
AMOUNTS = ("amount", "ahead_kt", "below_kt", "lateral_kt", "bias_kt", "bank_deg", "turn_rate_deg_s")
"""Numbers that are nothing at 0."""
TURNS = ("bank_deg", "turn_rate_deg_s", "heading_deg", "lateral_kt", "track")
SHORT_DIGITS = (2, 3, 4)
"""Significant digits that are tried, the fewest first."""
MOST_FLIGHTS = 400
"""Flights that shrinking may take."""
SHORTER = 0.8
"""Share of the flight that is tried as its end."""
AFTER_S = 1.0
"""Time kept after the property is decided [s]."""


class Shrinker:
    """Tries changes and keeps those after which the property is still broken."""

    def __init__(self, tables: Tables, test: Test, *, on_flight: Callable[[], None] | None = None) -> None:
        """Begin.

        Args:
            tables: A scenario that breaks the property.
            test: Asks whether another one does.
            on_flight: Told before each flight.
        """
        self.tables = tables
        self.flights = 0
        self._test = test
        self._on_flight = on_flight

    def shrink(self, decided_s: float) -> Tables:
        """Change it until nothing more can be left out, or enough flights were flown.

        Args:
            decided_s: When the property is decided [s].

        Returns:
            The smallest scenario found.
        """
        self._try(lambda tables: _end(tables, decided_s + AFTER_S))
        while self._try(lambda tables: _end(tables, SHORTER * tables["duration_s"])):
            pass
        changed = True
        while changed and self.flights < MOST_FLIGHTS:
            changed = False
            for change in self._omissions():
                changed |= self._try(change)
        for change in self._halvings():
            while self._try(change):
                pass
        for digits in SHORT_DIGITS:
            for place in list(_numbers(self.tables)):
                self._try(lambda tables, place=place, digits=digits: _shorten(tables, place, digits))  # type: ignore[misc]
        return self.tables

    def _try(self, change: Change) -> bool:
        """Keep a change if the property is still broken after it; one that changes nothing is not flown."""
        if self.flights >= MOST_FLIGHTS:
            return False
        tables = copy.deepcopy(self.tables)
        change(tables)
        if tables == self.tables:
            return False
        self.flights += 1
        if self._on_flight is not None:
            self._on_flight()
        if not self._test(tables):
            return False
        self.tables = tables
        return True

    def _omissions(self) -> Iterator[Change]:
        """What may be left out, the largest parts first."""
        for path in LISTS:
            size = len(_list(self.tables, path))
            while size:
                for first in range(0, len(_list(self.tables, path)), size):
                    yield lambda tables, path=path, first=first, size=size: _cut(tables, path, first, size)  # type: ignore[misc]
                size //= 2
        yield _drop_turbulence
        yield lambda tables: tables.pop("reaction_s", None)
        for key in list(self.tables["flight"]):
            if key not in {"protection", "seed"}:
                yield lambda tables, key=key: tables["flight"].pop(key, None)  # type: ignore[misc]
        yield _drop_turns
        yield _hold
        for number in range(len(self.tables["programme"]["points"]) - 1, 0, -1):
            yield lambda tables, number=number: _drop_point(tables, number)  # type: ignore[misc]
        if "air" not in self.tables and not self.tables["flight"].get("pilot_noise"):
            yield lambda tables: tables["flight"].pop("seed", None)

    def _halvings(self) -> Iterator[Change]:
        for path in list(_numbers(self.tables)):
            if path[-1] in AMOUNTS:
                yield lambda tables, path=path: _halve(tables, path)  # type: ignore[misc]


def _list(tables: Tables, path: tuple[str, ...]) -> list[Any]:
    found: Any = tables
    for key in path:
        found = found.get(key, {})
    return found or []


def _cut(tables: Tables, path: tuple[str, ...], first: int, size: int) -> None:
    listed = _list(tables, path)
    if first >= len(listed):
        return
    del listed[first : first + size]
    if not listed:
        owner = tables if len(path) == 1 else tables[path[0]]
        owner.pop(path[-1], None)
        if not tables.get("air", True):
            del tables["air"]


def _end(tables: Tables, time: float) -> None:
    """End at a time, without what begins later."""
    tables["duration_s"] = min(tables["duration_s"], float(math.ceil(time)))
    for path in LISTS:
        for number in range(len(_list(tables, path)) - 1, -1, -1):
            if _list(tables, path)[number]["time_s"] >= tables["duration_s"]:
                _cut(tables, path, number, 1)
    points = tables["programme"]["points"]
    while len(points) > 1 and points[-2]["time_s"] >= tables["duration_s"]:
        points.pop()


def _drop_turbulence(tables: Tables) -> None:
    air = tables.get("air", {})
    for key in ("wind_at_20_ft_kt", "lateral"):
        air.pop(key, None)
    if not air:
        tables.pop("air", None)


def _drop_turns(tables: Tables) -> None:
    for point in tables["programme"]["points"]:
        for key in TURNS:
            point.pop(key, None)


def _hold(tables: Tables) -> None:
    """Ask for nothing but the first point."""
    del tables["programme"]["points"][1:]


def _drop_point(tables: Tables, number: int) -> None:
    points = tables["programme"]["points"]
    if 0 < number < len(points):
        del points[number]


def _numbers(tables: Tables) -> Iterator[tuple[Any, ...]]:
    """Paths of the numbers that may be changed."""

    def walk(value: Any, path: tuple[Any, ...]) -> Iterator[tuple[Any, ...]]:
        if isinstance(value, dict):
            for key, part in value.items():
                yield from walk(part, (*path, key))
        elif isinstance(value, list):
            for number, part in enumerate(value):
                yield from walk(part, (*path, number))
        elif isinstance(value, float) and value != 0.0:
            yield path

    for key in ("start", "programme", "air", "faults", "pulses", "reaction_s"):
        yield from walk(tables.get(key, {}), (key,))


def _change(tables: Tables, path: tuple[Any, ...], change: Callable[[float], float]) -> None:
    owner: Any = tables
    try:
        for key in path[:-1]:
            owner = owner[key]
        owner[path[-1]] = change(owner[path[-1]])
    except (KeyError, IndexError, TypeError):
        return


def _halve(tables: Tables, path: tuple[Any, ...]) -> None:
    _change(tables, path, lambda value: rounded(0.5 * value) if abs(value) > 1e-3 else value)


def _shorten(tables: Tables, path: tuple[Any, ...], digits: int) -> None:
    _change(tables, path, lambda value: rounded(value, digits) if len(f"{value:g}") > digits else value)
