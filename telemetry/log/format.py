"""What a flight log is made of: file names, schema, metadata and events, shared by recorder and reader.

``PATH.parquet`` is a directory. ``part-000000.parquet`` has no rows: it carries the metadata, and at the end the
summary. ``part-000001.parquet`` and up hold about one second of flight each. ``_events.jsonl`` holds the discrete
events, one JSON object a line; readers of Parquet data sets pass over names that start with ``_`` or ``.``.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from rtsim.frame import SIGNALS, TIMING_SIGNALS
from telemetry.log.corridor_outline import CorridorOutline

if TYPE_CHECKING:
    import pyarrow as pa

LOG_VERSION = 1
"""Version of this layout, stored in every log."""
HEADER_PART = "part-000000.parquet"
"""The part without rows that carries the metadata."""
EVENTS_FILE = "_events.jsonl"
"""The discrete events."""
LOG_SIGNALS = SIGNALS + TIMING_SIGNALS
"""Every column of a log, in order."""
LOG_NAMES = tuple(signal.name for signal in LOG_SIGNALS)
"""Names of the columns of a log, in order."""

_KEY = "rtsim."


def part_name(number: int) -> str:
    """Name of a part; six digits keep the order of names the order of time for eleven days.

    Args:
        number: Number of the part, 0 for the header.
    """
    return f"part-{number:06d}.parquet"


@dataclass(frozen=True, slots=True)
class FlightMetadata:
    """What must be known of a flight to understand and repeat its log."""

    scenario_name: str
    """Name of the scenario, or what was flown instead."""
    scenario_toml: str
    """The scenario's text as flown; empty where there was none."""
    database_hash: str
    """SHA-256 of the LPV database."""
    seed: int
    """Seed of every random stream."""
    rate_hz: float
    """Frames per second of simulated time."""
    versions: Mapping[str, str] = field(default_factory=dict)
    """Versions of rtsim, Python, numpy, numba and the machine type."""
    setup: Mapping[str, Any] = field(default_factory=dict)
    """Everything else replay needs, as JSON values: plant, pilot, outer loop, start, wind, corridor."""
    corridor: CorridorOutline | None = None
    """Boundaries in force, so that plots need nothing but the log."""

    def to_json(self) -> str:
        """The metadata as one JSON object."""
        values = {**asdict(self), "versions": dict(self.versions), "setup": dict(self.setup)}
        values["corridor"] = self.corridor.to_dict() if self.corridor else None
        return json.dumps(values)

    @classmethod
    def from_json(cls, text: str) -> FlightMetadata:
        """Read back what ``to_json`` wrote.

        Args:
            text: The JSON object.

        Raises:
            ValueError: It is none, or a value is missing or of another type.
        """
        found: FlightMetadata = _checked(cls, text)
        return found


@dataclass(frozen=True, slots=True)
class LogEvent:
    """One discrete thing that happened: mode, reset, parameter, pilot, protection, end."""

    frame: int
    """Frame before which it acts."""
    time_s: float
    """Simulated time of that frame [s]."""
    kind: str
    """What it is: one word, for programs."""
    text: str
    """What it is: one line, for people."""
    level: str = "info"
    """``info``, ``caution``, ``warning`` or ``exceedance``."""
    data: Mapping[str, Any] = field(default_factory=dict)
    """Whatever replay needs to do it again, as JSON values."""

    def to_json(self) -> str:
        """The event as one line of JSON."""
        return json.dumps({**asdict(self), "data": dict(self.data)})

    @classmethod
    def from_json(cls, line: str) -> LogEvent:
        """Read back what ``to_json`` wrote.

        Args:
            line: One line of ``_events.jsonl``.

        Raises:
            ValueError: It is no JSON, or a value is missing or of another type.
        """
        found: LogEvent = _checked(cls, line)
        return found


def log_schema(metadata_json: str | None, summary: Mapping[str, Any] | None = None) -> pa.Schema:
    """The schema of a part, units and descriptions at every column.

    Args:
        metadata_json: ``FlightMetadata.to_json()`` for the header part, None for the others.
        summary: How the flight ended, once it has.
    """
    import pyarrow as pa

    fields = [
        pa.field(
            signal.name,
            pa.float64(),
            metadata={"unit": signal.unit, "group": signal.group, "description": signal.description},
        )
        for signal in LOG_SIGNALS
    ]
    values: dict[str, str] = {_KEY + "log_version": str(LOG_VERSION)}
    if metadata_json is not None:
        values |= {f"{_KEY}{key}": _text(value) for key, value in json.loads(metadata_json).items()}
        values[_KEY + "metadata"] = metadata_json
        values[_KEY + "names"] = json.dumps(LOG_NAMES)
        values[_KEY + "units"] = json.dumps([signal.unit for signal in LOG_SIGNALS])
    if summary is not None:
        values[_KEY + "summary"] = json.dumps(dict(summary))
    return pa.schema(fields, metadata=values)


def read_schema_metadata(raw: Mapping[bytes, bytes] | None) -> dict[str, str]:
    """The log's own entries of a schema's metadata, without their prefix.

    Args:
        raw: ``schema.metadata`` as pyarrow gives it.
    """
    entries = {key.decode(): value.decode() for key, value in (raw or {}).items()}
    return {key.removeprefix(_KEY): value for key, value in entries.items() if key.startswith(_KEY)}


def _checked(kind: Any, text: str) -> Any:
    """A dataclass from JSON, its types checked."""
    return _adapter(kind).validate_python(json.loads(text))


@functools.cache
def _adapter(kind: Any) -> Any:
    from pydantic import TypeAdapter  # the writer's process does without

    return TypeAdapter(kind)


def _text(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value)
