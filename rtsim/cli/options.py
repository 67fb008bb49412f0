"""Options of a flight on the command line, made from their declaration in ``rtsim.loop.options``."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from rtsim.cli.completion import one_of
from rtsim.loop.options import Option, declared

PANELS = ("Who flies what", "Start", "Air", "Loop", "Outputs", "MAVLink")
"""Headings of ``rtsim fly --help``, in order."""
OPTIONAL_VALUES = {"--flightgear": "127.0.0.1:5510"}
"""Options whose value may be left out, and what holds then; a value after a space has a colon, as an address has."""
Command = TypeVar("Command", bound=Callable[..., None])


def with_values(words: Sequence[str]) -> list[str]:
    """A command line in which every option that stands without its value has it.

    Args:
        words: The words after ``rtsim``.
    """
    words = list(words)
    end = words.index("--") if "--" in words else len(words)
    for place, word in enumerate(words[:end]):
        following = words[place + 1] if place + 1 < end else "-"
        if word in OPTIONAL_VALUES and (following.startswith("-") or ":" not in following):
            words[place] = f"{word}={OPTIONAL_VALUES[word]}"
    return words


def takes_options(*names: str, own: str = "the scenario's") -> Callable[[Command], Command]:
    """Give a command the options of a flight, in the place of its parameter ``options``.

    The command gets there what was given: a dictionary by field of ``FlightOptions``, in SI.

    Args:
        names: Fields of ``FlightOptions`` to offer; none offers all.
        own: Whose value holds where an option is not given, in words.
    """
    offered = [item for name, item in declared().items() if name in names or not names]

    def decorate(command: Command) -> Command:
        @functools.wraps(command)
        def run(**given: Any) -> None:
            values = [(item, given.pop(item.name)) for item in offered]
            options = {item.name: _flown(item, value) for item, value in values if value is not None}
            command(**given, options=options)

        signature = inspect.signature(command, eval_str=True)
        parameters = []
        for parameter in signature.parameters.values():
            if parameter.name == "options":
                parameters += [_parameter(item, own, item.panel) for item in offered]
            else:
                parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))
        parameters.sort(key=_panel)
        run.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        return run  # type: ignore[return-value]

    return decorate


def _panel(parameter: inspect.Parameter) -> int:
    """Place of an option's panel in ``--help``."""
    panel = parameter.annotation.__metadata__[0].rich_help_panel
    if panel is None:
        return -1
    return PANELS.index(panel) if panel in PANELS else len(PANELS)


def _parameter(item: Option, own: str, panel: str | None) -> inspect.Parameter:
    kind = Path if item.is_file else str if item.is_list else item.kind
    flags = (item.flag, f"--no-{item.flag.removeprefix('--')}") if item.kind is bool else (item.flag,)
    described = typer.Option(
        "/".join(flags),
        help=f"{item.help.removesuffix('.')} [{item.unit}]." if item.unit else item.help,
        show_default=f"{own}, else {item.default_text}",
        rich_help_panel=panel,
        metavar="A,B" if item.is_list else None,
        autocompletion=one_of(*words) if (words := _words(item)) else None,
    )
    return inspect.Parameter(
        item.name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=Annotated[kind | None, described]
    )


def _words(item: Option) -> list[str]:
    """Single words that a text may be, of what its declaration tells."""
    told = (word.strip() for word in item.values.partition(";")[0].split(","))
    return [word for word in told if re.fullmatch("[a-z]+", word)]


def _flown(item: Option, value: Any) -> Any:
    """A value from the command line as a flight keeps it."""
    if item.is_file:
        return str(value.resolve())
    if item.is_list:
        value = [word.strip() for word in value.split(",") if word.strip()]
    return item.inside(value)
