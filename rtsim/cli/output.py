"""What the commands say and where: answers on stdout, one JSON object if asked for; all else on stderr."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from rich.console import Console


class _LazyConsole:
    """A rich console that is built when first used, since importing rich costs start-up time."""

    __slots__ = ("_console", "_name", "_stream")

    def __init__(self, name: Literal["stdout", "stderr"]) -> None:
        self._name = name
        self._console: Console | None = None
        self._stream: object = None

    def real(self) -> Console:
        """Give the rich console for the present stream of that name."""
        # A console keeps the stream it was made with; tests and shells replace sys.stderr, so follow it.
        stream = getattr(sys, self._name)
        if self._console is None or self._stream is not stream:
            from rich.console import Console

            self._stream = stream
            # Without markup: a unit in brackets, "[kn]", is text, not a style.
            self._console = Console(file=stream, highlight=False, markup=False)
        return self._console

    def __getattr__(self, name: str) -> Any:
        return getattr(self.real(), name)


console = _LazyConsole("stderr")
"""Where progress, logs, warnings and remarks go: a ``rich.console.Console`` on stderr."""
results = _LazyConsole("stdout")
"""Where tables and sentences that answer the command go when ``--json`` is not asked for."""


def to_jsonable(value: object) -> object:
    """Turn a value into what JSON can hold.

    NaN and infinities become null (JSON has neither), numpy scalars and arrays become numbers and lists,
    dataclasses become objects, enumerations their value, paths their text.

    Args:
        value: Anything made of mappings, sequences, dataclasses, numpy values and plain Python values.

    Returns:
        Nested dict, list, str, int, float, bool and None.

    Raises:
        TypeError: Where a value has no JSON form, naming its type.
    """
    if value is None or (isinstance(value, (str, bool, int)) and not isinstance(value, Enum)):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Enum):
        return to_jsonable(value.value)
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): to_jsonable(item) for key, item in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: to_jsonable(getattr(value, field.name)) for field in fields(value)}
    tolist = getattr(value, "tolist", None)  # numpy scalars and arrays, without importing numpy
    if callable(tolist):
        return to_jsonable(tolist())
    if isinstance(value, (list, tuple, set, frozenset)):
        return [to_jsonable(item) for item in value]
    if isinstance(value, complex):
        return {"re": to_jsonable(value.real), "im": to_jsonable(value.imag)}
    raise TypeError(f"{type(value).__name__} has no JSON form")


def emit_json(value: object) -> None:
    """Print one JSON object as the last line of stdout.

    Args:
        value: The object; see ``to_jsonable``.
    """
    text = json.dumps(to_jsonable(value), allow_nan=False, ensure_ascii=False)
    # One write: a reader of a pipe sees a whole line or nothing.
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


@contextmanager
def progress(description: str, *, total: float) -> Iterator[Callable[[float], None]]:
    """Show a progress bar with the time left on stderr while the block runs.

    Args:
        description: What is being done, as a short present participle ("Solving trims").
        total: The amount of work, in the unit that ``advance`` counts.

    Yields:
        ``advance(amount)``, to be called as work is done.
    """
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console.real(), transient=False) as bar:
        task = bar.add_task(description, total=total)
        yield lambda amount: bar.advance(task, amount)
