"""Writes the tables of a flight's options, metrics, signals and MAVLink messages into the pages.

They are declared in ``rtsim/loop/options.py``, ``rtsim/measures/metric_kernels.py``, ``rtsim/frame.py`` and
``telemetry/mavlink/streams.py``. After a change there:

    python -m docs.tables
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtsim.loop.options import Option, declared

if TYPE_CHECKING:
    from rtsim.measures.metric_kernels import Metric

DOCS = Path(__file__).parent
BEGIN, END = "<!-- written by python -m docs.tables -->", "<!-- end -->"
IN_A_CAMPAIGN = {"file": "file", "classes": "class", "own": ""}


def scenario_table() -> str:
    """The keys of ``[flight]``."""
    lines = ["| key | values | default | meaning | campaign |", "|---|---|---|---|---|"]
    for item in declared().values():
        default = "false" if item.default is False else "true" if item.default is True else item.default_text
        values = "true, false" if item.kind is bool else f"a list of {item.allowed}" if item.is_list else item.allowed
        lines.append(_row(f"`{item.key}`", values, default, _meaning(item), IN_A_CAMPAIGN[item.campaign]))
    return "\n".join(lines)


def command_table() -> str:
    """The options of ``rtsim fly`` that a scenario has too."""
    lines = ["| option | meaning | default |", "|---|---|---|"]
    for item in declared().values():
        name = item.flag.removeprefix("--")
        choices = f"{','.join(item.choices[:2])},..." if item.is_list else "|".join(item.choices)
        value = "" if item.kind is bool else f" {choices or _placeholder(item)}"
        flag = f"`--{name}`, `--no-{name}`" if item.kind is bool else f"`--{name}{value}`"
        lines.append(_row(flag, _meaning(item), item.default_text))
    return "\n".join(lines)


def flight_metrics_table() -> str:
    """What ``rtsim fly --json`` measures."""
    from rtsim.measures.metrics import FlightMetrics

    return _metrics_table("key", FlightMetrics.shown)


def trial_metrics_table() -> str:
    """What trials and campaigns measure."""
    from rtsim.measures.metrics import TrialMetrics

    return _metrics_table("metric", TrialMetrics.shown)


def _metrics_table(heading: str, shown: Mapping[str, Metric]) -> str:
    lines = [f"| {heading} | meaning |", "|---|---|"]
    return "\n".join([*lines, *(_row(f"`{name}`", item.text) for name, item in shown.items())])


def signal_tables() -> str:
    """Every column of the history and of the log, a table for each group."""
    from rtsim.frame import SIGNALS, TIMING_SIGNALS

    groups: dict[str, list[str]] = {}
    for signal in (*SIGNALS, *TIMING_SIGNALS):
        row = _row(f"`{signal.name}`", signal.unit, signal.description.removesuffix("."))
        groups.setdefault(signal.group, []).append(row)
    head = "| signal | unit | meaning |\n|---|---|---|\n"
    return "\n\n".join(f"## {group.capitalize()}\n\n{head}" + "\n".join(rows) for group, rows in groups.items())


def message_tables() -> str:
    """The fields of every MAVLink message that is streamed."""
    from pymavlink.dialects.v20.all import mavlink_map

    from telemetry.mavlink.streams import DEFAULT_RATES_HZ

    parts = []
    for number, rate in sorted(DEFAULT_RATES_HZ.items(), key=lambda item: mavlink_map[item[0]].msgname):
        message = mavlink_map[number]
        lengths = dict(zip(message.ordered_fieldnames, message.array_lengths, strict=True))
        rows = [
            _row(f"`{name}`", kind + (f"[{lengths[name]}]" if lengths[name] else ""), _unit_of(message, name))
            for name, kind in zip(message.fieldnames, message.fieldtypes, strict=True)
        ]
        title = f"## {message.msgname}\n\nNumber {number}, {rate:g} Hz.\n\n| field | type | unit |\n|---|---|---|\n"
        parts.append(title + "\n".join(rows))
    return "\n\n".join(parts)


def _unit_of(message: Any, field: str) -> str:
    """The unit of a field, or the enumeration of its values."""
    return message.fieldunits_by_name.get(field) or message.fieldenums_by_name.get(field, "")


TABLES: dict[str, tuple[Callable[[], str], ...]] = {
    "scenarios.md": (scenario_table, flight_metrics_table),
    "commands.md": (command_table,),
    "testing-protection.md": (trial_metrics_table,),
    "signals.md": (signal_tables,),
    "mavlink-fields.md": (message_tables,),
}
"""Pages with tables, and what makes each, in order."""


def with_table(page: str, text: str) -> str:
    """A page with its tables as the declarations have them now.

    Args:
        page: Name of the page.
        text: The page as it is.
    """
    tables = iter(TABLES[page])
    pattern = f"{re.escape(BEGIN)}.*?{re.escape(END)}"
    return re.sub(pattern, lambda _: f"{BEGIN}\n{next(tables)()}\n{END}", text, flags=re.DOTALL)


def _row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _meaning(item: Option) -> str:
    unit = f" [{item.unit}]" if item.unit else ""
    return f"{item.help.removesuffix('.')}{unit}" + (f" ([{item.page}]({item.page}))" if item.page else "")


def _placeholder(item: Option) -> str:
    return "FILE" if item.is_file else "N" if item.low is not None else "NAME"


def main() -> None:
    """Write the tables."""
    for page in TABLES:
        path = DOCS / page
        path.write_text(with_table(page, path.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
