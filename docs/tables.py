"""Writes the tables of a flight's options into the pages, from their declaration in ``rtsim/loop/options.py``.

After a change of the declaration:

    python -m docs.tables
"""

from __future__ import annotations

import re
from pathlib import Path

from rtsim.loop.options import Option, declared

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
        value = "" if item.kind is bool else f" {'|'.join(item.choices)}" if item.choices else f" {_placeholder(item)}"
        flag = f"`--{name}`, `--no-{name}`" if item.kind is bool else f"`--{name}{value}`"
        lines.append(_row(flag, _meaning(item), item.default_text))
    return "\n".join(lines)


TABLES = {"scenarios.md": scenario_table, "commands.md": command_table}
"""Pages with a table, and what makes it."""


def with_table(page: str, text: str) -> str:
    """A page with its table as the declaration has it now.

    Args:
        page: Name of the page.
        text: The page as it is.
    """
    table = f"{BEGIN}\n{TABLES[page]()}\n{END}"
    return re.sub(f"{re.escape(BEGIN)}.*?{re.escape(END)}", lambda _: table, text, flags=re.DOTALL)


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
