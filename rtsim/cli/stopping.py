"""Signals that end a command: it unwinds, so that files are closed and helpers ended, and exits with 128 + the signal.

Raised where Python runs inside somebody else's callback (a compiler's, a destructor), an exception is thrown away. That
is noticed, and it is raised again a moment later, as often as it takes.

Once a command unwinds, further signals are ignored for ``CLOSING_S``, so that they do not cut off what it closes; one
that comes later ends it at once. The exit code is that of the first.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
import time
import weakref
from types import FrameType
from typing import Any

from rtsim.errors import Terminated

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
"""Ctrl-C, a polite end, a closed terminal, Ctrl-Backslash."""
AGAIN_S = 0.05
"""How soon an exception that was thrown away is raised again [s]."""
CLOSING_S = 2.0
"""For how long after a signal others are ignored [s]."""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C."""


_newest: list[tuple[int, weakref.ref[BaseException]]] = []
"""The signal that asked the process to end, and what was raised for it."""
_closing: list[tuple[int, float]] = []
"""The first such signal, and until when others are ignored, monotonic [s]."""


def exit_code(number: int) -> int:
    """What a shell expects of a process that a signal ended.

    Args:
        number: The signal.
    """
    return 128 + number


def stopped_by() -> int | None:
    """The signal that asked the process to end; None where there was none."""
    return _newest[-1][0] if _newest else None


def catch_signals() -> None:
    """Let the signals raise; one for a closed terminal stays ignored where that was asked for (``nohup``)."""
    for number in SIGNALS:
        # Shells start background jobs with SIGINT ignored; a flight must still end cleanly when it is asked to.
        if number == signal.SIGINT or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, _handle)
    sys.unraisablehook = _notice_loss


def begin_closing(number: int) -> None:
    """A signal ends the command: let no other disturb that for a while.

    Args:
        number: The signal.
    """
    _closing[:] = [(_closing[0][0] if _closing else number, time.monotonic() + CLOSING_S)]


def disturbs() -> bool:
    """Whether a signal that comes now is to be ignored."""
    return bool(_closing) and time.monotonic() < _closing[0][1]


def leave_at_once(code: int) -> None:
    """All is closed: a signal that comes while the interpreter ends changes nothing.

    Args:
        code: The exit code.
    """
    for number in SIGNALS:
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, lambda *_: os._exit(code))


def _handle(number: int, _frame: FrameType | None) -> None:
    if number == signal.SIGHUP:
        leave_terminal()
    if not disturbs():
        raise_stop(number)


def raise_stop(number: int) -> None:
    """Unwind, for the first signal that came.

    Args:
        number: The signal.

    Raises:
        Interrupted: Ctrl-C.
        Terminated: Any other.
    """
    begin_closing(number)
    number = _closing[0][0]
    stop = Interrupted() if number == signal.SIGINT else Terminated(number)
    _newest[:] = [(number, weakref.ref(stop))]
    try:
        raise stop
    finally:
        del stop  # or its own traceback would keep it alive


def raise_if_lost() -> None:
    """Unwind where a signal asked for it and what was raised is nowhere any more."""
    if _newest and _newest[-1][1]() is None:
        raise_stop(_newest[-1][0])


def leave_terminal() -> None:
    """Let go of a terminal that was closed: whatever is still said must not become an error."""
    poll = select.poll()
    for descriptor in range(3):
        poll.register(descriptor, 0)
    gone = [descriptor for descriptor, event in poll.poll(0) if event & (select.POLLHUP | select.POLLERR)]
    if gone:
        nothing = os.open(os.devnull, os.O_RDWR)
        for descriptor in gone:
            os.dup2(nothing, descriptor)
        os.close(nothing)


def _notice_loss(loss: Any) -> None:
    """An exception was thrown away: as usual, unless it is ours."""
    if issubclass(loss.exc_type, (Interrupted, Terminated)):
        _closing[:] = [(_newest[-1][0], 0.0)]
        again = threading.Timer(AGAIN_S, os.kill, (os.getpid(), _newest[-1][0]))
        again.daemon = True
        again.start()
    else:
        sys.__unraisablehook__(loss)
