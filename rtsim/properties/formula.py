"""A property: a formula of signal temporal logic, read once, and asked of any number of flights."""

from __future__ import annotations

import functools
import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.properties.words import TWIN, check_names, unit_of, values_of

if TYPE_CHECKING:
    from rtsim.properties.robustness import Trace

LATER_S = 4.0
"""Time after which a flight is what was made of it [s]."""
LARGEST_FORMULA = 2000
"""Characters of the longest formula that is read; what reads it goes into itself for every bracket."""


@dataclass(frozen=True, slots=True)
class Robustness:
    """How a flight stands to a property."""

    value: float
    """How far it is from breaking it; negative: broken by so much; in ``unit``."""
    unit: str
    """Unit of the comparison that decides."""
    time: float
    """When it decides [s]; the first time where it does so twice."""
    decides: str
    """The comparison that decides, in words."""
    later: float
    """Robustness from ``LATER_S`` on, or of the last frame: what is near to breaking at the start says little of what
    comes of it."""

    @property
    def broken(self) -> bool:
        """Whether the flight breaks the property."""
        return not self.value >= 0.0

    @property
    def words(self) -> str:
        """The value with its unit."""
        return f"{self.value:+.4g} {self.unit}".rstrip()


@dataclass(frozen=True, slots=True, eq=False)
class Flown:
    """What a property needs of a flight."""

    rows: FloatArray
    """Frame history, shape (frames, SIGNAL_COUNT)."""
    metrics: FloatArray
    """Its metrics, places ``VALUE``."""


@dataclass(frozen=True, slots=True, eq=False)
class Property:
    """A formula over signals and metrics of a flight and of its unprotected twin."""

    formula: str
    """As the user wrote it."""
    names: tuple[str, ...]
    """Signals and metrics it speaks of, sorted."""
    units: tuple[str, ...]
    """Units of its comparisons, sorted; robustness of more than one is that of the comparison that decides."""
    tree: Any
    """As rtamt reads it."""

    @property
    def needs_twin(self) -> bool:
        """Whether it speaks of the flight without a law."""
        return any(name.startswith(TWIN) for name in self.names)

    @property
    def unit(self) -> str:
        """Its unit; several separated by commas."""
        return ", ".join(unit for unit in self.units if unit)

    def robustness(self, flight: Flown, dt: float, twin: Flown | None = None) -> Robustness:
        """Ask a flight.

        Args:
            twin: The same flight without a law; needed where the formula speaks of it.

        Returns:
            Robustness at its first frame. A flight that ended by itself is judged as far as it went, beside its twin
            as far as both went.

        Raises:
            InputError: The formula speaks of a twin and there is none.
        """
        trace = self._trace(flight, dt, twin)
        over_time = _evaluated(self.tree, trace)
        value, later = float(over_time[0]), float(over_time[min(round(LATER_S / dt), trace.frames - 1)])
        # What decides stands in the formula as it is, or behind a "not".
        for sign, (node, found) in itertools.product((1.0, -1.0), trace.predicates):
            places = np.flatnonzero(found == sign * value)
            if places.size:
                return Robustness(value, _unit(node, self.formula), float(places[0]) * dt, _words(node), later)
        return Robustness(value, "", 0.0, self.formula, later)

    def over_time(self, flight: Flown, dt: float, twin: Flown | None = None) -> FloatArray:
        """Robustness of what stands behind the outermost ``always``, over time, shape (frames,): for plots.

        Args:
            twin: The same flight without a law.
        """
        inner = self.tree.children[0] if type(self.tree).__name__ == "Always" else self.tree
        return _evaluated(inner, self._trace(flight, dt, twin))

    def _trace(self, flight: Flown, dt: float, twin: Flown | None) -> Trace:
        if self.needs_twin and twin is None:
            raise InputError("speaks of a twin without a law, and none was flown", key="property", value=self.formula)
        frames = len(flight.rows) if twin is None or not self.needs_twin else min(len(flight.rows), len(twin.rows))
        signals = {}
        for name in self.names:
            source = flight
            if name.startswith(TWIN):
                assert twin is not None  # asked for above
                source = twin
            signals[name] = values_of(name.removeprefix(TWIN), source.rows[:frames], source.metrics)
        from rtsim.properties.robustness import Trace  # loads rtamt and antlr

        return Trace(signals, dt, frames)


@functools.lru_cache(maxsize=256)
def parse_property(formula: str) -> Property:
    """Read a formula.

    Args:
        formula: In rtamt's words: ``always``, ``eventually``, ``until``, ``once``, ``historically``, ``since`` with
            windows such as ``[0:1.5]`` in seconds; ``and``, ``or``, ``not``, ``implies``; comparisons of arithmetic.

    Raises:
        InputError: It cannot be read, speaks of what is not there, or compares what has different units.
    """
    from rtsim.properties.reader import identifiers, read  # loads rtamt and antlr

    key = "property"
    if len(formula) > LARGEST_FORMULA or formula.count("(") > LARGEST_FORMULA // 20:
        raise InputError("is too long", key=key, value=formula[:40] + "...", allowed=f"{LARGEST_FORMULA} characters")
    names = identifiers(formula)
    check_names(names, formula)
    try:
        tree = read(formula, names)
    except ValueError as error:
        raise InputError(f"cannot be read: {_told(str(error))}", key=key, value=formula, mend=_EXAMPLE) from None
    parts = list(_parts(tree))
    for node in parts:
        _check_window(node, formula)
        _check_brackets(node, formula)
    comparisons = [node for node in parts if type(node).__name__ == "Predicate"]
    if not comparisons or not _is_logic(tree):
        raise InputError("compares nothing", key=key, value=formula, mend=_EXAMPLE)
    units = tuple(sorted({_unit(node, formula) for node in comparisons}))
    used = sorted({node.var for node in parts if type(node).__name__ == "Variable"})
    return Property(formula, tuple(used), units, tree)


_EXAMPLE = "write such as: always (margin_kt > -0.5)"
_VALUES = {"Variable", "Constant", "Abs", "Sqrt", "Exp", "Pow", "Addition", "Subtraction", "Multiplication", "Division"}
_SIGNS = ("<", "<=", "==", "!=", ">", ">=")


def _told(words: str) -> str:
    """What the parser says, without its list of all that could stand there."""
    words = re.sub(r" expecting \{.*\}", "", words.replace("<EOF>", "end"))
    place = re.match(r"(\d+):(\d+): Syntax ERROR, (.*)", words)
    return f"{place[3]} (character {int(place[2]) + 1})" if place else words


def _evaluated(node: Any, trace: Trace) -> FloatArray:
    from rtsim.properties.robustness import Evaluator  # loads rtamt and antlr

    return np.asarray(Evaluator().visit(node, trace), dtype=np.float64)


def _check_window(node: Any, formula: str) -> None:
    """Refuse a window that ends before it begins."""
    if hasattr(node, "begin") and node.begin > node.end:
        raise InputError("has a window that ends before it begins", key="property", value=formula, mend="swap them")


def _check_brackets(node: Any, formula: str) -> None:
    """Refuse what rtamt reads otherwise than people: ``a - b + c`` as ``a - (b + c)``, ``a / b * c`` alike."""
    for outer, inner, mend in (
        ("Subtraction", "Addition", "write a - b - c, or (a - b) + c"),
        ("Division", "Multiplication", "write a / b / c, or (a / b) * c"),
    ):
        if type(node).__name__ == outer and type(node.children[1]).__name__ == inner:
            problem = f"would be read as {_words(node)}"
            raise InputError(problem, key="property", value=formula, mend=mend)


def _parts(node: Any) -> Iterator[Any]:
    yield node
    for child in node.children[:2]:  # rtamt enters those of a sum twice
        yield from _parts(child)


def _is_logic(node: Any) -> bool:
    """Whether comparisons stand where truth is asked for, and nothing else does."""
    kind = type(node).__name__
    if kind == "Predicate":
        return all(type(part).__name__ in _VALUES for child in node.children[:2] for part in _parts(child))
    return kind not in _VALUES and bool(node.children) and all(_is_logic(child) for child in node.children[:2])


def _unit(node: Any, formula: str) -> str:
    """Unit of what a part gives; a number fits every unit."""
    found = _unit_or_none(node, formula)
    return "" if found is None else found


def _unit_or_none(node: Any, formula: str) -> str | None:
    kind = type(node).__name__
    if kind == "Constant":
        return None
    if kind == "Variable":
        return unit_of(node.var)
    units = [_unit_or_none(child, formula) for child in node.children[:2]]
    if kind == "Abs":
        return units[0]
    if kind in {"Multiplication", "Division"}:
        kept = [unit for unit in units if unit]
        return (kept[0] if kept else "") if len(kept) < 2 and (kind == "Multiplication" or not units[1]) else ""
    if kind in {"Sqrt", "Exp", "Pow"}:
        return ""
    known = {unit for unit in units if unit is not None}
    if len(known) > 1:
        first, second = sorted(known)
        problem = f"compares {first or 'a number without unit'} with {second}"
        raise InputError(problem, key="property", value=formula, mend="compare what has one unit")
    return known.pop() if known else None


def _words(node: Any) -> str:
    """A comparison as people write it."""
    kind = type(node).__name__
    if kind == "Variable":
        return str(node.var)
    if kind == "Constant":
        return f"{node.val:g}"
    inner = [_words(child) for child in node.children[:2]]
    signs = {"Addition": "+", "Subtraction": "-", "Multiplication": "*", "Division": "/"}
    if kind == "Predicate":
        return f"{inner[0]} {_SIGNS[node.operator.value]} {inner[1]}"
    return f"({inner[0]} {signs[kind]} {inner[1]})" if kind in signs else f"{kind.lower()}({', '.join(inner)})"
