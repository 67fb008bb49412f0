"""The published numbers, each with the place it stands at in ``data/published.toml``, its source and its grade."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from rtsim.toml_file import shipped_toml

GRADES = {"table": "T", "table2": "T2", "text": "X", "figure": "F", "figure2": "F2", "derived": "D", "memory": "M"}
"""T printed table, T2 the same as transcribed by a third party, X text, F figure, F2 figure read by a third party, D
derived, M from memory."""


@cache
def published_data() -> Mapping[str, Any]:
    """Everything that stands in ``data/published.toml``."""
    return shipped_toml("rtsim/validation/data", "published.toml")


@dataclass(frozen=True, slots=True)
class Number:
    """One published number."""

    value: float
    """As printed."""
    place: str
    """Where it stands in ``data/published.toml``, as ``table.key[index]``."""
    source: str
    """Source as in the file: a code of ``[sources]`` and the place there."""
    grade: str
    """See ``GRADES``."""


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the published data."""

    name: str
    """Its name, dotted."""

    @property
    def content(self) -> Mapping[str, Any]:
        """The table as read."""
        found: Any = published_data()
        for part in self.name.split("."):
            found = found[part]
        content: Mapping[str, Any] = found
        return content

    def values(self, key: str) -> list[float]:
        """A row of numbers.

        Args:
            key: Its key.
        """
        return [float(value) for value in self.content[key]]

    def number(self, key: str, index: int | None = None, *, source: str = "", grade: str = "") -> Number:
        """One number with its source.

        Args:
            key: Its key.
            index: Its place in the row; None: a number of its own.
            source: Its source, where it is not that of the table.
            grade: Its grade, where it is not that of the table.
        """
        value = self.content[key] if index is None else self.content[key][index]
        place = f"{self.name}.{key}" if index is None else f"{self.name}.{key}[{index}]"
        source = source or self.content.get("src", "")
        return Number(float(value), place, source, grade or GRADES[self.content.get("kind", "table2")])
