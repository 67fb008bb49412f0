"""What flies besides a database's numbers: an aircraft's profile, in parts that another aircraft may borrow.

A profile is a TOML document. The XV-15's names one file for each part; a profile of one's own stands beside its
database (``NAME.profile.toml``) or inside it (attribute ``aircraft_profile``), holds the parts as tables of the same
layout, and says with ``borrows`` which it takes from the XV-15. Each subsystem reads its own part, and checks it there.

Legend:
    key: Its name.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal, get_args

from rtsim.errors import InputError
from rtsim.outside import read_text
from rtsim.toml_file import parse_toml, shipped_toml

PartName = Literal["nacelle", "corridor", "protection", "systems", "controls", "dimensions", "pilot", "aids"]
PARTS: tuple[PartName, ...] = get_args(PartName)
"""Conversion actuator and switch; boundaries; limits and laws; flaps, engines and governor; gearing, stops and flap
schedule; sizes; weights of the virtual pilot; gains of the aids."""
PROFILE_ATTRIBUTE = "aircraft_profile"
"""Attribute of a database file that holds its profile."""
OWN_SUFFIX = ".profile.toml"
"""How the name of a profile beside a database ends."""
XV15_DATA = "rtsim/aircraft/xv15/data"
"""Where the XV-15's numbers lie."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """One part of a profile: a table of numbers, read with a check of each."""

    name: str
    """Part, and table within it, as in messages."""
    file: str
    """Where it stands."""
    data: Mapping[str, Any] = field(repr=False)
    """The table as read."""

    def table(self, key: str) -> Part:
        """A table within this one.

        Raises:
            InputError: There is none.
        """
        value = self._value(key)
        if not isinstance(value, dict):
            raise self._refusal("is not a table", key, value, None)
        return Part(f"{self.name}.{key}", self.file, value)

    def has(self, key: str) -> bool:
        """Whether there is a value."""
        return key in self.data

    def number(self, key: str, *, low: float = -math.inf, high: float = math.inf) -> float:
        """A number within a range.

        Args:
            low: Smallest value allowed.
            high: Largest value allowed.

        Raises:
            InputError: It is missing, no number or out of range.
        """
        return self._checked(key, self._value(key), low, high)

    def numbers(
        self,
        key: str,
        *,
        low: float = -math.inf,
        high: float = math.inf,
        count: int | None = None,
        least: int = 1,
        rises: bool = False,
    ) -> list[float]:
        """A list of numbers within a range.

        Args:
            low: Smallest value allowed.
            high: Largest value allowed.
            count: How many there must be; None: ``least`` or more.
            least: How many there must be at least.
            rises: Whether each must be larger than the one before.

        Raises:
            InputError: It is missing, no such list, or one of them is out of range.
        """
        value = self._value(key)
        if not isinstance(value, list) or len(value) < least or (count is not None and len(value) != count):
            number = f"{count} " if count is not None else f"at least {least} " if least > 1 else ""
            words = f"a list of {number}numbers"
            raise self._refusal(f"is not {words}", key, value, words)
        found = [self._checked(f"{key}[{place}]", item, low, high) for place, item in enumerate(value)]
        if rises and any(after <= before for before, after in itertools.pairwise(found)):
            raise self._refusal("does not rise", key, value, "ascending numbers")
        return found

    def text(self, key: str) -> str:
        """A text.

        Raises:
            InputError: It is missing or no text.
        """
        value = self._value(key)
        if not isinstance(value, str):
            raise self._refusal("is not a text", key, value, None)
        return value

    def _value(self, key: str) -> Any:
        if key not in self.data:
            mend = "add it; docs/lpv.md shows a profile, and rtsim/aircraft/xv15/data the XV-15's"
            raise InputError("is missing", file=self.file, key=f"{self.name}.{key}", mend=mend)
        return self.data[key]

    def _checked(self, key: str, value: Any, low: float, high: float) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise self._refusal("is not a number", key, value, _range_words(low, high))
        if not low <= value <= high:
            raise self._refusal("is out of range", key, value, _range_words(low, high))
        return float(value)

    def _refusal(self, problem: str, key: str, value: Any, allowed: str | None) -> InputError:
        return InputError(problem, file=self.file, key=f"{self.name}.{key}", value=value, allowed=allowed)


def _range_words(low: float, high: float) -> str | None:
    if math.isinf(low) and math.isinf(high):
        return None
    if math.isinf(high):
        return f"{low:g} or more"
    return f"at most {high:g}" if math.isinf(low) else f"{low:g} to {high:g}"


@dataclass(frozen=True, slots=True, eq=False)  # the same only as itself, so that what is made from it can be kept
class AircraftProfile:
    """An aircraft besides its trims and linear models."""

    name: str
    """What people call it."""
    file: str
    """Where it stands."""
    nacelle: Part
    """Travel, rates and detents of the nacelles."""
    corridor: Part
    """Boundaries of the conversion corridor and its levels."""
    protection: Part
    """Limits, their levels, and the numbers of the protection laws."""
    systems: Part
    """Flaps, engines, rotor drive."""
    controls: Part
    """Gearing, stops, actuators, flap schedule."""
    dimensions: Part
    """Sizes that flights reckon with."""
    pilot: Part
    """Weights, thresholds and noises of the virtual pilot."""
    aids: Part
    """Gains of the pilot aids."""
    borrowed: tuple[str, ...] = ()
    """Parts that are the XV-15's."""
    source: str = field(default="", repr=False)
    """The document of a profile of one's own."""

    @property
    def content_hash(self) -> str:
        """SHA-256 of every number, as JSON."""
        content = {part: getattr(self, part).data for part in PARTS}
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    @property
    def is_xv15(self) -> bool:
        """Whether every part is the XV-15's."""
        return len(self.borrowed) == len(PARTS) or self is xv15_profile()


_MAKING = threading.Lock()


def xv15_profile() -> AircraftProfile:
    """The XV-15's profile: one object, whatever thread asks first."""
    with _MAKING:
        return _xv15_profile()


@cache
def _xv15_profile() -> AircraftProfile:
    """From its folder."""
    document = shipped_toml(XV15_DATA, "profile.toml")
    parts: dict[str, Any] = {}
    for part in PARTS:
        given = document[part]
        files = [given] if isinstance(given, str) else given if isinstance(given, list) else []
        data: dict[str, Any] = {} if files else given
        sources: dict[str, str] = {}
        for file in files:
            content = shipped_toml(XV15_DATA, file)
            sources |= content.get("sources", {})
            data = data | content | ({"sources": sources} if sources else {})
        parts[part] = Part(part, f"xv15/data/{', '.join(files) or 'profile.toml'}", data)
    return AircraftProfile(name=document["name"], file="xv15/data/profile.toml", **parts)


@cache
def borrowed_profile() -> AircraftProfile:
    """The profile of a database that has none: the XV-15's in every part."""
    return replace(xv15_profile(), borrowed=PARTS)


def read_profile(path: Path) -> AircraftProfile:
    """Read a profile of one's own.

    Args:
        path: The TOML file.

    Raises:
        InputError: It cannot be read, or a part is neither there nor borrowed.
    """
    return parse_profile(read_text(path, noun="aircraft profile"), file=str(path))


def parse_profile(text: str, *, file: str) -> AircraftProfile:
    """Take a profile from its text.

    Args:
        text: The TOML document.

    Raises:
        InputError: It is not valid TOML, or a part is neither there nor borrowed.
    """
    document = parse_toml(text, file=file)
    borrowed = document.pop("borrows", [])
    name = document.pop("name", None)
    if not isinstance(name, str) or not name:
        raise InputError("is missing", file=file, key="name", mend="say what the aircraft is called")
    if not isinstance(borrowed, list) or not set(borrowed) <= set(PARTS) or len(set(borrowed)) < len(borrowed):
        raise InputError("is not a list of parts", file=file, key="borrows", value=borrowed, allowed=", ".join(PARTS))
    for part in document:
        if part not in PARTS or not isinstance(document[part], dict):
            allowed = f"name, borrows, and the tables {', '.join(PARTS)}"
            raise InputError("is no part of an aircraft profile", file=file, key=part, allowed=allowed)
    parts: dict[str, Any] = {}
    for part in PARTS:
        if (part in document) == (part in borrowed):
            problem = "is given and borrowed" if part in document else "is neither given nor borrowed"
            mend = "keep one of them" if part in document else f'add the table, or borrows = ["{part}"]'
            raise InputError(problem, file=file, key=part, mend=mend)
        parts[part] = getattr(xv15_profile(), part) if part in borrowed else Part(part, file, document[part])
    return AircraftProfile(name=name, file=file, borrowed=tuple(borrowed), source=text, **parts)
