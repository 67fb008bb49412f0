"""Calls a user's law so that nothing it does can stop a flight: exceptions, wrong answers, endless calls."""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, fields
from numbers import Real
from operator import attrgetter
from types import FrameType
from typing import Any, Literal, Self, TypeVar, cast

from rtsim.command import CHANNELS, Command, Intervention, Margins, ProtectionLaw, Sensors
from rtsim.errors import Terminated
from rtsim.guests import Visit, shown, words_of

TraceFunction = Callable[[FrameType, str, Any], Any]

Values = TypeVar("Values", Sensors, Command, Margins)
_FIELDS: dict[type, Callable[[Any], tuple[Any, ...]]] = {
    kind: attrgetter(*(field.name for field in fields(kind))) for kind in (Sensors, Command, Margins)
}
_set_handler: Callable[[int, Any], Any] = getattr(signal.signal, "__wrapped__", signal.signal)
"""``signal.signal`` without its look-up of enumerations, which takes longer than most laws."""
HANGS = 60.0
"""A call that uses no CPU time and does not come back for as long hangs [s]."""
KINDS = ("warn", "limit", "reverse", "blend", "clip")
"""How a law may say it acted."""
Failure = Literal["raised", "not_finite", "wrong_answer", "interrupted"]


class LawInterruptedError(BaseException):
    """Raised inside a law's call when it has used up its time; no ``Exception``, so that laws do not catch it."""


@dataclass(frozen=True, slots=True)
class GuardedAnswer:
    """What came of one call."""

    command: Command | None
    """The law's command; None where it failed."""
    interventions: tuple[Intervention, ...]
    """What the law says it did."""
    failure: Failure | None
    """How it failed, or None."""
    text: str
    """The failure for people."""
    duration: float
    """Time of the call: on the clock where a clock waits for it, else CPU time of the thread [s]."""


class CallLimit:
    """Interrupts whatever runs inside the ``with`` block after a time, where the system can: main thread, POSIX.

    Live, the time is that of the clock, since the loop waits. Otherwise it is CPU time, so that what becomes of a law
    does not depend on what else the machine does; who uses none is interrupted after ``HANGS`` on the clock.

    Code that swallows the interruption (``except:`` inside a loop) is interrupted again every 0.1 s, each time one
    more line after it was swallowed, until that hits a line outside its ``try``. Only a call into C that never comes
    back cannot be ended.
    """

    def __init__(self, seconds: float, *, live: bool) -> None:
        """Set the limit.

        Args:
            seconds: Time the block may take [s].
            live: On the clock, not in CPU time.
        """
        self._seconds, self._live = seconds, live
        self._cpu = 0.0
        self._armed = False
        self._previous: object = None
        self._rest = (0.0, 0.0)
        self._began = 0.0
        self._interruptions = 0
        self._trace: Any = None

    def __enter__(self) -> Self:
        self._armed = hasattr(signal, "setitimer") and threading.current_thread() is threading.main_thread()
        if self._armed:
            self._began, self._interruptions, self._trace = time.monotonic(), 0, sys.gettrace()
            self._cpu = time.thread_time()
            self._previous = _set_handler(signal.SIGALRM, self._interrupt)
            # Repeats, for a law that catches everything.
            self._rest = signal.setitimer(signal.ITIMER_REAL, self._seconds, 0.1)
        return self

    def __exit__(self, *exception: object) -> None:
        if not self._armed:
            return
        if self._interruptions > 0:
            sys.settrace(self._trace)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        _set_handler(signal.SIGALRM, self._previous)
        if self._rest[0] > 0.0:
            # Somebody else's alarm was running: give it what is left of it.
            left = max(1e-3, self._rest[0] - (time.monotonic() - self._began))
            signal.setitimer(signal.ITIMER_REAL, left, self._rest[1])

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        del number
        leaving = CallLimit.__exit__.__code__
        if frame is not None and frame.f_code is leaving:
            return
        used = time.monotonic() - self._began, time.thread_time() - self._cpu
        if not self._live and used[1] < self._seconds and used[0] < HANGS:
            return
        self._interruptions += 1
        lines = self._interruptions

        def after_some_lines(frame: FrameType, event: str, argument: object) -> TraceFunction | None:
            del argument
            nonlocal lines
            if frame.f_code is leaving:
                return None
            lines -= event == "line"
            if lines == 0:
                raise LawInterruptedError
            return after_some_lines

        sys.settrace(after_some_lines)
        while frame is not None and frame.f_code is not guarded_call.__code__:
            frame.f_trace = after_some_lines
            frame = frame.f_back
        raise LawInterruptedError


def guarded_call(
    law: ProtectionLaw, sensors: Sensors, command: Command, margins: Margins, *, dt: float, limit: float, live: bool
) -> GuardedAnswer:
    """Ask a law, whatever it does.

    Args:
        law: The law.
        command: The command it may limit.
        margins: Distances to the corridor.
        dt: Time since its last call [s].
        limit: Time after which the call is interrupted [s].
        live: The clock waits for the law: its time is that on the clock, else CPU time.
    """
    clock = time.perf_counter if live else time.thread_time
    began = clock()
    failure: Failure | None = None
    text = ""
    answer: object = None
    given = (_copy(sensors), _copy(command), _copy(margins))
    try:
        with Visit(), CallLimit(limit, live=live):
            answer = law.step(*given, dt)
    except LawInterruptedError:
        spent = f"took more than {limit:g} s" if live else f"used more than {limit:g} s of CPU time, or hung,"
        failure, text = "interrupted", f"{spent} in one call"
    except (KeyboardInterrupt, Terminated):
        raise  # from whoever runs rtsim
    except BaseException as error:  # noqa: BLE001 - a user's own code may raise anything
        failure, text = "raised", f"raised {words_of(error)}"
    duration = clock() - began
    if failure is None and duration > limit:
        # Where no alarm can be set the call is judged when it comes back.
        failure, text = "interrupted", f"took {duration:.2f} s in one call, more than {limit:g} s"
    if failure is None and given != (sensors, command, margins):
        failure, text = "wrong_answer", "changed what it was given; its command must be a new one"
    if failure is not None:
        return GuardedAnswer(None, (), failure, text, duration)
    return _checked(answer, command, duration)


def _copy(values: Values) -> Values:
    """A copy of its own of sensors, command or margins: ``dataclasses.replace`` takes ten times as long."""
    kind = type(values)
    return kind(*_FIELDS[kind](values))


def _checked(answer: object, pilot: Command, duration: float) -> GuardedAnswer:
    try:
        limited, interventions = cast("tuple[Command, list[Intervention]]", answer)
        command = Command.given(limited, pilot)
        listed = tuple(interventions)
    except (TypeError, ValueError, AttributeError):
        said = shown(answer)
        said = said if len(said) <= 80 else f"{said[:77]}..."
        text = f"answered {said} where (Command, list of Intervention) is asked for"
        return GuardedAnswer(None, (), "wrong_answer", text, duration)
    for item in listed:
        odd = _odd_intervention(item)
        if odd:
            return GuardedAnswer(None, (), "wrong_answer", f"gave a list of interventions that holds {odd}", duration)
    if not command.finite:
        return GuardedAnswer(None, (), "not_finite", f"gave a command that is not finite: {command}", duration)
    return GuardedAnswer(command, listed, None, "", duration)


def _odd_intervention(item: Any) -> str:
    """What is wrong with what should be an intervention; empty where nothing is."""
    if not isinstance(item, Intervention):
        return f"something else: {shown(item)}"
    if not isinstance(item.limit, str):
        return f"limit={shown(item.limit)}, which is no name"
    for name, allowed in (("channel", CHANNELS), ("kind", KINDS)):
        value: object = getattr(item, name)
        if not isinstance(value, str) or value not in allowed:
            return f"{name}={shown(value)} where one of {', '.join(allowed)} is asked for"
    for name in ("before", "after", "margin", "time_to_limit"):
        if not isinstance(getattr(item, name), Real):
            return f"{name}={shown(getattr(item, name))}, which is no number"
    return ""
