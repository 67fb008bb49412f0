"""Calls a user's law so that nothing it does can stop a flight: exceptions, wrong answers, endless calls."""

from __future__ import annotations

import math
import signal
import threading
import time
from dataclasses import dataclass
from types import FrameType
from typing import Literal, Self, cast

from rtsim.command import Command, Intervention, Margins, ProtectionLaw, Sensors

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
    """Wall time of the call [s]."""


class CallLimit:
    """Interrupts whatever runs inside the ``with`` block after a time, where the system can: main thread, POSIX."""

    def __init__(self, seconds: float) -> None:
        """Set the limit.

        Args:
            seconds: Wall time the block may take [s].
        """
        self._seconds = seconds
        self._armed = False
        self._previous: object = None
        self._rest = (0.0, 0.0)
        self._began = 0.0

    def __enter__(self) -> Self:
        self._armed = hasattr(signal, "setitimer") and threading.current_thread() is threading.main_thread()
        if self._armed:
            self._began = time.monotonic()
            self._previous = signal.signal(signal.SIGALRM, self._interrupt)
            # Repeats, for a law that catches everything.
            self._rest = signal.setitimer(signal.ITIMER_REAL, self._seconds, 0.1)
        return self

    def __exit__(self, *exception: object) -> None:
        if not self._armed:
            return
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, self._previous)  # type: ignore[arg-type]
        if self._rest[0] > 0.0:
            # Somebody else's alarm was running: give it what is left of it.
            left = max(1e-3, self._rest[0] - (time.monotonic() - self._began))
            signal.setitimer(signal.ITIMER_REAL, left, self._rest[1])

    @staticmethod
    def _interrupt(number: int, frame: FrameType | None) -> None:
        del number, frame
        raise LawInterruptedError


def guarded_call(
    law: ProtectionLaw, sensors: Sensors, command: Command, margins: Margins, *, dt: float, limit: float
) -> GuardedAnswer:
    """Ask a law, whatever it does.

    Args:
        law: The law.
        sensors: What it may know.
        command: The command it may limit.
        margins: Distances to the corridor.
        dt: Time since its last call [s].
        limit: Wall time after which the call is interrupted [s].
    """
    began = time.perf_counter()
    failure: Failure | None = None
    text = ""
    answer: object = None
    try:
        with CallLimit(limit):
            answer = law.step(sensors, command, margins, dt)
    except LawInterruptedError:
        failure, text = "interrupted", f"took more than {limit:g} s in one call"
    except (Exception, SystemExit) as error:  # noqa: BLE001 - a user's own code may raise anything
        failure, text = "raised", f"raised {type(error).__name__}: {error}"
    duration = time.perf_counter() - began
    if failure is None and duration > limit:
        # Where no alarm can be set the call is judged when it comes back.
        failure, text = "interrupted", f"took {duration:.2f} s in one call, more than {limit:g} s"
    if failure is not None:
        return GuardedAnswer(None, (), failure, text, duration)
    return _checked(answer, duration)


def _checked(answer: object, duration: float) -> GuardedAnswer:
    try:
        limited, interventions = cast("tuple[Command, list[Intervention]]", answer)
        command = Command(float(limited.stick), float(limited.lever), float(limited.nacelle_rate))
        listed = tuple(interventions)
    except (TypeError, ValueError, AttributeError):
        shown = repr(answer)
        shown = shown if len(shown) <= 80 else f"{shown[:77]}..."
        text = f"answered {shown} where (Command, list of Intervention) is asked for"
        return GuardedAnswer(None, (), "wrong_answer", text, duration)
    if not all(isinstance(item, Intervention) for item in listed):
        text = "gave a list of interventions that holds something else"
        return GuardedAnswer(None, (), "wrong_answer", text, duration)
    if not math.isfinite(command.stick + command.lever + command.nacelle_rate):
        return GuardedAnswer(None, (), "not_finite", f"gave a command that is not finite: {command}", duration)
    return GuardedAnswer(command, listed, None, "", duration)
