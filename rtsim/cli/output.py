"""What the commands say and where: answers on stdout, one JSON object if asked for; all else on stderr."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, Literal, Protocol, TextIO

from rtsim.jsonable import to_jsonable

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


_answers: list[TextIO] = []
"""Where the JSON object goes while the rest of the process writes to stderr."""


@contextmanager
def machine_output() -> Iterator[None]:
    """Keep stdout for the JSON object: whatever else is printed meanwhile, by anybody, goes to stderr."""
    stdout = sys.stdout
    try:
        whole = stdout.fileno() == 1 and sys.stderr.fileno() == 2
    except (OSError, ValueError, AttributeError):
        whole = False  # replaced by something without a descriptor
    if not whole:
        sys.stdout = sys.stderr
        _answers.append(stdout)
        try:
            yield
        finally:
            _answers.pop()
            sys.stdout = stdout
        return
    stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)  # what C code and processes started from here print, too
    _answers.append(os.fdopen(kept, "w", encoding="utf-8"))
    try:
        yield
    finally:
        with suppress(OSError, ValueError):  # a user's own code closed it
            stdout.flush()
        os.dup2(kept, 1)
        _answers.pop().close()


def emit_json(value: object) -> None:
    """Print one JSON object as the last line of stdout.

    Args:
        value: The object; see ``to_jsonable``.
    """
    text = json.dumps(to_jsonable(value), allow_nan=False, ensure_ascii=False)
    # One write: a reader of a pipe sees a whole line or nothing.
    stream = _answers[-1] if _answers else sys.stdout
    stream.write(text + "\n")
    stream.flush()


class Advance(Protocol):
    """Moves a progress bar on."""

    def __call__(self, amount: float, words: str = "") -> None:
        """Add to what is done.

        Args:
            amount: The work done since the last call.
            words: What is done now; empty leaves the words that stand there.
        """


_shown: list[Callable[[str], None]] = []
"""The bars that are up, the innermost last: each shows words about what is done right now."""


def tell_bar(words: str) -> bool:
    """Show words about what is done right now in the bar that is up.

    Args:
        words: What is done.

    Returns:
        Whether there is one.
    """
    if _shown:
        _shown[-1](words)
    return bool(_shown)


@contextmanager
def progress(description: str, *, total: float) -> Iterator[Advance]:
    """Show a progress bar with the time left on stderr while the block runs.

    Args:
        description: What is being done, as a short present participle ("Solving trims").
        total: The amount of work, in the unit that ``advance`` counts.

    Yields:
        ``advance(amount)`` or ``advance(amount, words)``, to be called as work is done.
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
        BarColumn(bar_width=16),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[now]}"),
    )
    with Progress(*columns, console=console.real(), redirect_stderr=False) as bar:
        task = bar.add_task(description, total=total, now="")
        _shown.append(lambda words: bar.update(task, now=words))
        try:
            yield lambda amount, words="": bar.update(task, advance=amount, description=words or None, now="")
        finally:
            bar.update(task, now="")
            _shown.pop()


@contextmanager
def working(description: str) -> Iterator[Callable[[], None]]:
    """Show on a terminal what is being done and for how long, while the block runs; nothing in a pipe.

    Args:
        description: What is being done, as a short present participle ("Solving trims"); empty shows nothing.

    Yields:
        What takes it away before the end.
    """
    if not sys.stderr.isatty() or not description:
        yield lambda: None
        return
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console.real(), transient=True, redirect_stderr=False) as bar:
        bar.add_task(description, total=None)
        yield bar.stop
