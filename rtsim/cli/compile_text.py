"""Says what is compiled, how far that is and how long it will take; silent while nothing is compiled."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from rtsim.cli.output import console, tell_bar
from rtsim.cli.stopping import raise_if_lost

if TYPE_CHECKING:
    from rtsim.kernels.progress import Compiling

WORTH_TELLING_S = 1.0
"""Compiling that is over sooner is not told [s]."""


class CompileNotice:
    """A progress bar on a terminal, two lines in a pipe."""

    def __init__(self) -> None:
        """Show nothing yet."""
        self._stack = ExitStack()
        self._bar: object = None
        self._told = self._flying = False
        self._seconds = 0.0

    def note(self, now: Compiling) -> None:
        """Show how far it is.

        Args:
            now: The kernel that is compiled now.
        """
        self._seconds = now.seconds
        if now.seconds < WORTH_TELLING_S:
            return
        if not self._told:
            self._told = True
            console.print("Compiling this flight's kernels: once on this installation, then they are kept.")
        if sys.stderr.isatty() and not self._flying:
            of = f"/{now.total}" if now.total else ""
            if self._bar is not None or not tell_bar(f"compiling {now.done + 1}{of}"):
                self._draw(now)

    def finish(self) -> None:
        """Take the bar away and say how long it took."""
        self._stack.close()
        self._bar = None
        if self._told:
            self._told = False
            console.print(f"Compiled in {self._seconds:.0f} s.")

    def flies(self) -> None:
        """From now on the terminal is the flight's: what is compiled on its way is told in lines."""
        self.finish()
        self._flying = True

    def _draw(self, now: Compiling) -> None:
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            TextColumn,
            TimeElapsedColumn,
            TimeRemainingColumn,
        )

        if not isinstance(self._bar, Progress):
            columns = (
                TextColumn("Compiling"),
                BarColumn(bar_width=16),
                MofNCompleteColumn(),
                TimeElapsedColumn(),
                TimeRemainingColumn(),
                TextColumn("{task.fields[kernel]}"),
            )
            bar = Progress(*columns, console=console.real(), transient=True, redirect_stderr=False)
            self._bar = self._stack.enter_context(bar)
            self._bar.add_task("compiling", total=now.total or None, kernel=now.what)
        task = self._bar.task_ids[0]
        self._bar.update(task, completed=now.done, total=now.total or None, kernel=now.what)


NOTICE = CompileNotice()
"""The one of this process."""


@contextmanager
def compile_notice() -> Iterator[None]:
    """Tell about compiling while a command runs."""
    from rtsim.kernels.progress import told

    try:
        with told(lambda _: raise_if_lost()), told(NOTICE.note):
            yield
    finally:
        NOTICE.finish()
