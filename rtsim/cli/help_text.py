"""What ``--help`` looks like: plain text for 80 columns, options in groups with their defaults, examples at the end.

A command's examples stand in its docstring: a last section of lines ``rtsim ...  # what for``.

Legend:
    ctx: What the parser knows of the command line so far.
    formatter: Takes the text.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import typer
from typer.core import TyperCommand, TyperGroup

from rtsim.cli.options import PANELS

_EXAMPLES = re.compile(r"\n\n(?P<heading>[A-Z][\w ]*:)\n(?P<lines>(?:[ \t]+rtsim[^\n]*\n?)+)\s*\Z")
_OWNED_DEFAULT = re.compile(r"\[default: \((.*)\)([;\]])", re.DOTALL)
_PANEL_OF = {
    **dict.fromkeys(("--json", "--junit", "--html", "--out", "--plot", "--fresh"), "Outputs"),
    **dict.fromkeys(("--jobs", "--dask", "--dask-tls"), "Machines"),
    "--help": "Help",
}
"""Panels of options that many commands have."""
_FIRST, _LAST = "Options", ("Machines", "Outputs", "MAVLink", "Help")


class Example(NamedTuple):
    """One line to type."""

    command: str
    """The whole line, from ``rtsim`` on."""
    purpose: str
    """What it is for; may be empty."""


class HelpText(NamedTuple):
    """A docstring as help."""

    text: str
    """What the command does."""
    heading: str
    """Above the examples."""
    examples: tuple[Example, ...]
    """Lines to type."""


def help_text(docstring: str) -> HelpText:
    """Take the examples out of a docstring.

    Args:
        docstring: As inspected, without its indent.
    """
    found = _EXAMPLES.search(docstring)
    if found is None:
        return HelpText(docstring, "", ())
    lines = (line.strip().partition("  # ") for line in found["lines"].splitlines())
    examples = tuple(Example(command.strip(), purpose.strip()) for command, _, purpose in lines)
    return HelpText(docstring[: found.start()], found["heading"], examples)


class HelpCommand(TyperCommand):
    """A command whose help is plain text."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write usage, text, options and examples."""
        content = help_text(self.help or "")
        self.format_usage(ctx, formatter)
        _write_text(formatter, content.text)
        _write_options(self.get_params(ctx), ctx, formatter)
        _write_examples(formatter, content.heading, content.examples)


class HelpGroup(TyperGroup):
    """A group of commands whose help is plain text; without examples of its own it has the first of each command."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write usage, text, the commands under their headings, options and examples."""
        content = help_text(self.help or "")
        heading, examples = content.heading, content.examples
        if not examples:
            first = [help_text(command.help or "").examples[:1] for command in self.commands.values()]
            heading, examples = "Examples:", tuple(example for one in first for example in one)
        self.format_usage(ctx, formatter)
        _write_text(formatter, content.text)
        panels: dict[str, list[tuple[str, str]]] = {}
        for name, command in self.commands.items():
            panel = getattr(command, "rich_help_panel", None)
            panels.setdefault(panel if isinstance(panel, str) else "Commands", []).append((name, _brief(command.help)))
        for panel, rows in panels.items():
            with formatter.section(panel):
                formatter.write_dl(rows)
        _write_options(self.get_params(ctx), ctx, formatter)
        _write_examples(formatter, heading, examples)


class App(typer.Typer):
    """A typer whose commands have such help."""

    def __init__(self, **settings: Any) -> None:
        """Prepare.

        Args:
            settings: As of ``typer.Typer``.
        """
        super().__init__(cls=HelpGroup, rich_markup_mode=None, no_args_is_help=True, **settings)

    def command(self, name: str | None = None, **settings: Any) -> Callable[[Any], Any]:
        """Add a command.

        Args:
            name: Its name.
            settings: As of ``typer.Typer.command``.
        """
        return super().command(name, cls=HelpCommand, **settings)


def _brief(text: str | None) -> str:
    """The first clause of a help text."""
    first = help_text(text or "").text.partition("\n\n")[0].replace("\n", " ")
    return re.split(r"[:;.](?:\s|$)", first, maxsplit=1)[0]


def _write_text(formatter: Any, text: str) -> None:
    if text:
        formatter.write_paragraph()
        with formatter.indentation():
            formatter.write_text(text)


def _write_examples(formatter: Any, heading: str, examples: Iterable[Example]) -> None:
    if heading:
        with formatter.section(heading.removesuffix(":")):
            for command, purpose in examples:
                formatter.write(f"{'':>{formatter.current_indent}}{command}\n")
                if purpose:
                    with formatter.indentation(), formatter.indentation():
                        formatter.write_text(purpose)


def _write_options(parameters: Iterable[Any], ctx: Any, formatter: Any) -> None:
    """Arguments, then the options in their panels."""
    panels: dict[str, list[tuple[str, str]]] = {}
    for parameter in parameters:
        record = parameter.get_help_record(ctx)
        if record is None:
            continue
        name, text = record
        own = getattr(parameter, "rich_help_panel", None)
        if parameter.param_type_name == "argument":
            panel = "Arguments"
        elif isinstance(own, str):
            panel = own
        else:
            panel = _PANEL_OF.get(max(parameter.opts, key=len), _FIRST)
        panels.setdefault(panel, []).append((name, _OWNED_DEFAULT.sub(r"[default: \1\2", text)))
    order = ("Arguments", _FIRST, *(panel for panel in PANELS if panel not in _LAST))
    rank = {panel: place for place, panel in enumerate(order)}
    last = {panel: len(panels) + len(order) + place for place, panel in enumerate(_LAST)}
    for panel in sorted(panels, key=lambda panel: last.get(panel, rank.get(panel, len(order)))):
        with formatter.section(panel):
            formatter.write_dl(panels[panel])
