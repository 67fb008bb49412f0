"""A chain of laws in one flight: asked 50 times a second in order, held in between, each guarded.

Priority is the order: the last law has the last word, and the record says who changed what. A channel that the chain
left as it was follows the pilot in every frame; one that it changed keeps the limited value until the next decision.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from rtsim.aircraft.profile import AircraftProfile
from rtsim.command import CHANNELS, Command, Intervention, Margins, ProtectionLaw, Sensors
from rtsim.errors import InputError
from rtsim.guests import words_of
from rtsim.protection.guard import Failure, GuardedAnswer, guarded_call
from rtsim.protection.laws import LawSpec
from rtsim.protection.limits import LIMIT_KINDS, frames_per_decision

BATCH_LIMIT = 1.0
"""CPU time of one call after which a law is ended in a batch [s]."""
LIVE_LIMIT = 0.25
"""Time on the clock after which it is in a live flight, where the loop waits meanwhile [s]."""
OTHER_REASON = float(len(LIMIT_KINDS) + 1)
"""Recorded reason of an intervention whose limit is none of ``LIMIT_KINDS``."""
RANGES = ((-1.0, 1.0), (0.0, 1.0), (-math.inf, math.inf), (-1.0, 1.0), (-1.0, 1.0))
"""What the channels can be; the nacelles' own rate limits act later."""
_NO_REASONS = (0.0,) * len(CHANNELS)
EventKind = Literal["raised", "not_finite", "wrong_answer", "interrupted", "skipped", "global_state", "out_of_range"]


@dataclass(frozen=True, slots=True)
class LawEvent:
    """Something a law did besides its work."""

    frame: int
    """Frame in which."""
    law: str
    """Name of the law."""
    kind: EventKind
    """What."""
    text: str
    """A sentence for people."""
    ended: bool
    """The law acts no more in this flight."""


@dataclass(frozen=True, slots=True)
class ChainedIntervention:
    """An intervention and the law that made it."""

    frame: int
    """Frame in which."""
    law: str
    """Name of the law."""
    intervention: Intervention
    """What it did."""


@dataclass(frozen=True, slots=True)
class ChainSnapshot:
    """All state of a chain; the laws are deep copies."""

    laws: tuple[ProtectionLaw | None, ...]
    """The laws; None where one has ended."""
    waiting: tuple[int, ...]
    """Calls still to be skipped."""
    held: tuple[float | None, ...]
    """Limited values held until the next decision."""
    reasons: tuple[float, ...]
    """Their reasons."""
    calls: tuple[int, ...]
    """Calls remembered so far."""
    clipped: tuple[bool, ...]
    """Laws that were told to have asked for too much."""


@dataclass(frozen=True, slots=True)
class _Call:
    """One call as it was made, to make it again."""

    sensors: Sensors
    command: Command
    margins: Margins
    answer: Command


class LawChain:
    """The laws of one flight."""

    def __init__(
        self,
        laws: Sequence[LawSpec],
        *,
        dt: float,
        live: bool = False,
        on_event: Callable[[LawEvent], None] | None = None,
        remember: bool = False,
        profile: AircraftProfile | None = None,
    ) -> None:
        """Make a fresh instance of every law.

        Args:
            laws: The laws in the order in which they act.
            live: The flight runs against the clock: calls that took too long are followed by skipped ones. A batch
                never skips, so that its commands do not depend on the machine.
            on_event: Told about every event.
            remember: Keep all calls, for ``unrepeatable``.

        Raises:
            InputError: A law cannot be made.
        """
        self.every = frames_per_decision(profile, dt=dt)
        self.period = self.every * dt
        self.events: list[LawEvent] = []
        """What happened besides limiting."""
        self.slow_calls = 0
        """Calls so far that took longer than the time between two of them: live on the clock, else in CPU time."""
        self.interventions: tuple[ChainedIntervention, ...] = ()
        """What the laws say they did in the last decision."""
        self.live, self.on_event, self.remember = live, on_event, remember
        self.reasons: tuple[float, ...] = _NO_REASONS
        """Number of the limit that changed each channel; ``OTHER_REASON`` for a law's own limits."""
        self._specs = tuple(laws)
        self._laws: list[ProtectionLaw | None] = []
        self._waiting: list[int] = []
        self._calls: list[list[_Call]] = []
        self._clipped: list[bool] = []
        self._held: list[float | None] = [None] * len(CHANNELS)
        self.reset()

    def reset(self) -> None:
        """Begin a flight: a fresh instance of every law, nothing held."""
        self._laws = [spec.make() for spec in self._specs]
        self._waiting = [0] * len(self._specs)
        self._calls = [[] for _ in self._specs]
        self._clipped = [False] * len(self._specs)
        self._held = [None] * len(CHANNELS)
        self.interventions, self.reasons = (), _NO_REASONS

    def snapshot(self) -> ChainSnapshot:
        """Copy all state.

        Raises:
            InputError: A law cannot be copied.
        """
        calls = tuple(len(calls) for calls in self._calls)
        return ChainSnapshot(
            self._copied(self._laws), tuple(self._waiting), tuple(self._held), self.reasons, calls, tuple(self._clipped)
        )

    def restore(self, snapshot: ChainSnapshot) -> None:
        """Go back to a snapshot.

        Args:
            snapshot: From ``snapshot`` of a chain of the same laws.
        """
        self._laws = list(self._copied(snapshot.laws))
        self._waiting, self._held, self.reasons = list(snapshot.waiting), list(snapshot.held), snapshot.reasons
        self._clipped = list(snapshot.clipped)
        for calls, count in zip(self._calls, snapshot.calls, strict=True):
            del calls[count:]

    def _copied(self, laws: Sequence[ProtectionLaw | None]) -> tuple[ProtectionLaw | None, ...]:
        copies = []
        for law, spec in zip(laws, self._specs, strict=True):
            try:
                copies.append(copy.deepcopy(law))
            except Exception as error:
                raise InputError(
                    f"the law cannot be copied: {words_of(error)}",
                    key="--protection",
                    value=spec.name,
                    mend="keep plain values, arrays and objects that copy.deepcopy can copy",
                ) from error
        return tuple(copies)

    def end(self, name: str) -> None:
        """End a law, as a live flight that is replayed ended it.

        Args:
            name: The law.
        """
        for place, spec in enumerate(self._specs):
            if spec.name == name:
                self._laws[place] = None

    def skip(self, name: str) -> None:
        """Skip a law's next call, as a live flight that is replayed skipped it.

        Args:
            name: The law.
        """
        for place, spec in enumerate(self._specs):
            if spec.name == name:
                self._waiting[place] = 1

    def due(self, frame: int) -> bool:
        """Whether the laws decide in this frame, and so need sensors and margins.

        Args:
            frame: Number of the frame.
        """
        return frame % self.every == 0

    def decide(self, frame: int, sensors: Sensors, command: Command, margins: Margins) -> None:
        """Ask every law in turn.

        Args:
            frame: Number of the frame.
            command: The command before protection.
            margins: Distances to the corridor's boundaries.
        """
        limited = command
        noted: list[ChainedIntervention] = []
        for place, spec in enumerate(self._specs):
            answer = self._ask(frame, place, sensors, limited, margins)
            if answer is None or answer.command is None:
                continue
            limited = answer.command
            noted += [ChainedIntervention(frame, spec.name, item) for item in answer.interventions]
        self.interventions = tuple(noted)
        pairs = zip(command.values, limited.values, strict=True)
        self._held = [None if after == before else after for before, after in pairs]
        self.reasons = tuple(
            _reason(channel, noted) if held is not None else 0.0
            for channel, held in zip(CHANNELS, self._held, strict=True)
        )

    @property
    def held(self) -> tuple[float, ...]:
        """What was decided last: limited channels (NaN: the pilot's), and the reasons; ``rtsim.loop.data.HELD``."""
        return (*(math.nan if value is None else value for value in self._held), *self.reasons)

    def unrepeatable(self) -> list[LawEvent]:
        """Make all calls again with fresh instances and name the laws that answer otherwise.

        A law whose answers depend on anything but what it is given and its own instance (module variables, class
        variables, clocks, random numbers without a seed) makes a flight that cannot be repeated.

        Returns:
            One event for each such law.
        """
        found = []
        for place, spec in enumerate(self._specs):
            if spec.built_in or not self._calls[place]:
                continue
            fresh = spec.make()
            for number, call in enumerate(self._calls[place]):
                again = guarded_call(
                    fresh, call.sensors, call.command, call.margins, dt=self.period, limit=BATCH_LIMIT, live=False
                )
                if again.command != call.answer:
                    text = (
                        f"the law {spec.name} keeps state outside its instance: asked again with the same values, its "
                        f"call number {number} (time {call.sensors.time:.2f} s) answered "
                        f"{again.command if again.command is not None else again.text} instead of {call.answer}"
                    )
                    frame = round(call.sensors.time / self.period) * self.every
                    found.append(LawEvent(frame, spec.name, "global_state", text, False))
                    break
        for event in found:
            self._tell(event)
        return found

    def _ask(
        self, frame: int, place: int, sensors: Sensors, command: Command, margins: Margins
    ) -> GuardedAnswer | None:
        law, name = self._laws[place], self._specs[place].name
        if law is None:
            return None
        if self._waiting[place] > 0:
            self._waiting[place] -= 1
            text = f"the law {name} was skipped: its last call took too long"
            self._tell(LawEvent(frame, name, "skipped", text, False))
            return None
        limit = LIVE_LIMIT if self.live else BATCH_LIMIT
        answer = guarded_call(law, sensors, command, margins, dt=self.period, limit=limit, live=self.live)
        if answer.failure is not None:
            self._laws[place] = None
            self._fail(frame, name, answer.failure, answer.text)
            return None
        self.slow_calls += answer.duration > self.period
        if self.live and answer.duration > self.period:
            self._waiting[place] = math.ceil(answer.duration / self.period) - 1
        if answer.command is not None:
            answer = self._in_range(frame, place, answer, answer.command)
        if self.remember and answer.command is not None:
            self._calls[place].append(_Call(sensors, command, margins, answer.command))
        return answer

    def _in_range(self, frame: int, place: int, answer: GuardedAnswer, command: Command) -> GuardedAnswer:
        """Clip what no control can do, and say so once in a flight."""
        given = command.values
        clipped = tuple(min(max(value, low), high) for value, (low, high) in zip(given, RANGES, strict=True))
        if clipped == given:
            return answer
        if not self._clipped[place]:
            self._clipped[place] = True
            name = self._specs[place].name
            beyond = [
                item for item in zip(CHANNELS, given, RANGES, strict=True) if not item[2][0] <= item[1] <= item[2][1]
            ]
            asked = " and ".join(f"{channel.replace('_', ' ')} {value:g}" for channel, value, _ in beyond)
            ranges = " and ".join(f"{low:g} to {high:g}" for *_, (low, high) in beyond)
            text = f"the law {name} asks for {asked}; clipped to {ranges}"
            self._tell(LawEvent(frame, name, "out_of_range", text, False))
        return replace(answer, command=Command(*clipped))

    def _fail(self, frame: int, name: str, kind: Failure, text: str) -> None:
        sentence = f"the law {name} {text}; the flight goes on without it"
        self._tell(LawEvent(frame, name, kind, sentence, True))

    def _tell(self, event: LawEvent) -> None:
        self.events.append(event)
        if self.on_event is not None:
            self.on_event(event)


def _reason(channel: str, noted: Sequence[ChainedIntervention]) -> float:
    """Number of the limit that had the last word on a channel."""
    limits = [item.intervention.limit for item in noted if item.intervention.channel == channel]
    if not limits or limits[-1] not in LIMIT_KINDS:
        return OTHER_REASON
    return 1.0 + LIMIT_KINDS.index(limits[-1])


def compiled_law(laws: Sequence[LawSpec]) -> str | None:
    """Name of the built-in law that a chain amounts to, or None where laws in Python have to be called.

    Args:
        laws: The chain.
    """
    if not laws:
        return "off"
    return laws[0].name if len(laws) == 1 and laws[0].built_in else None
