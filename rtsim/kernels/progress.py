"""What is being compiled, for whoever shows it; silent while nothing is."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple


class Compiling(NamedTuple):
    """How far the compiling is."""

    what: str
    """Name of the kernel that is compiled now."""
    done: int
    """Kernels compiled so far in this process."""
    total: int
    """About how many there will be; 0 where nobody knows."""
    seconds: float
    """Since the first of them was begun [s]."""


Listener = Callable[[Compiling], None]
_listeners: list[Listener] = []
_done = 0
_total = 0
_began = 0.0


def note(what: str) -> None:
    """Say that a kernel is compiled now.

    Args:
        what: Its name.
    """
    global _done, _began  # noqa: PLW0603 - one process compiles one thing at a time
    if _done == 0:
        _began = time.monotonic()
    for listener in _listeners:
        listener(Compiling(what, _done, max(_total, _done + 1) if _total else 0, time.monotonic() - _began))
    _done += 1


def expect(total: int) -> None:
    """Say how many kernels there will be, should any have to be compiled.

    Args:
        total: About how many.
    """
    global _total  # noqa: PLW0603
    _total = total


@contextmanager
def told(listener: Listener) -> Iterator[None]:
    """Tell somebody what is compiled while the block runs.

    Args:
        listener: Called when a kernel begins to be compiled; must be quick.
    """
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)
