"""Turns stick inputs into commands, frame by frame: pure, deterministic, and without a jump when input comes and goes.

The age of the input is an argument: the handler knows no clock. Every control is taken over softly, whatever brought
another hand to it (a first input, input that is back, another owner, message or pilot before): it stays where it is
until its hand moves through it, and goes along by as much as the hand moves away from it. So nothing moves that nobody
moved. Once taken, a control is where the hand is, unchanged, in the frame that reads it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from rtsim.command import Command, StickInput
from rtsim.nacelle.nacelle_kernels import NacelleTables, switch_rate_limit
from rtsim.nacelle.switch import NacelleSwitch, load_nacelle_tables
from rtsim.sticks.settings import StickSettings, shaped
from rtsim.sticks.transition import TO_AIRPLANE, TO_HELICOPTER, TransitionSchedule

INPUT_NONE, INPUT_LIVE, INPUT_LOST = 0, 1, 2
"""Nobody has flown yet; sticks are followed; sticks were followed and are silent."""
LARGEST_TRIM = 0.5
"""Largest offset of the stick trim [half travels]."""
STICK_FADE_RATE, LEVER_FADE_RATE = 5.0, 2.5
"""A fade moves no control faster than 1 % of its travel in 4 ms [1/s]."""
_ELSEWHERE = 0.02
"""A hand that is further from its control than this is worth a word."""
_SAME_ANGLE = 1e-9
_NEW_ANGLE = math.radians(0.05)


@dataclass(frozen=True, slots=True)
class StickSituation:
    """What the handler needs to know of the aircraft in a frame."""

    airspeed: float
    """Airspeed [m/s]."""
    nacelle_command: float
    """Command angle of the conversion actuator [rad]."""
    trim_stick: float = 0.0
    """Stick that trims the aircraft with the hands off: 0 while the bias schedule is on."""


class _Hand(NamedTuple):
    """A hand on a control."""

    place: float
    """Where it has the control."""
    source: tuple[int, int]
    """Whose hand it is, and by which message; another one takes over anew."""
    came_from: float
    """Where it was before it was first heard."""


class _Control:
    """One control: taken over softly by a hand, and continuous when its source changes."""

    __slots__ = (
        "_along",
        "_blends",
        "_elapsed",
        "_fastest",
        "_furthest",
        "_offset",
        "_rest",
        "_source",
        "_taken",
        "_time",
        "value",
    )

    def __init__(self, value: float, fastest: float) -> None:
        self.value = self._rest = value
        self._fastest = fastest
        self._offset, self._elapsed, self._time = 0.0, 0.0, 1.0
        self._source: tuple[int, int] | None = None
        self._taken = self._blends = False
        self._along, self._furthest = 0.0, 0.0

    @property
    def held(self) -> bool:
        """Whether a hand is on it."""
        return self._source is not None

    @property
    def waits(self) -> bool:
        """Whether a hand is on it that is elsewhere and has not taken it yet."""
        away = abs(self._furthest - self._rest - self._along)
        return self.held and not self._taken and away > _ELSEWHERE

    def blend(self) -> None:
        """Fade from here to where its hand has it in the coming frame."""
        self._blends = True

    def step(self, hand: _Hand | None, dt: float, *, settings: StickSettings, rest: float | None, trim: float) -> float:
        """The control for this frame.

        Args:
            hand: The hand on it; None where there is none.
            settings: Times of the fades.
            rest: Where it goes without a hand; None stays.
            trim: Added to it.
        """
        restart = settings.blend_time if self._blends else None
        self._blends = False
        source = None if hand is None else hand.source
        if source != self._source:
            if self._taken or self._along:
                restart = settings.ramp_time
            self._source, self._taken, self._along = source, False, 0.0
            self._rest = self.value
            self._furthest = 0.0 if hand is None else hand.came_from
        if rest is not None:
            self._rest = rest
        if hand is not None and not self._taken and self._meets(hand.place):
            self._taken, restart = True, settings.blend_time
        target = hand.place if hand is not None and self._taken else self._rest + self._along
        return self._fade(min(max(target + trim, -1.0), 1.0), dt, restart)

    def _meets(self, place: float) -> bool:
        """Whether the hand met the control or moved through it; moving away takes it along."""
        here, before = place - self._rest - self._along, self._furthest - self._rest - self._along
        if here * before <= 0.0:
            return True
        if abs(here) > abs(before):
            self._along += place - self._furthest
            self._furthest = place
        return False

    def _fade(self, target: float, dt: float, restart_in: float | None) -> float:
        """Go to a target; ``restart_in`` is the time [s] of a fade that begins now."""
        if restart_in is not None:
            self._offset = self.value - target
            self._time = max(restart_in, abs(self._offset) / self._fastest)
            self._elapsed = 0.0
        if self._offset:
            self._elapsed += dt
            left = 1.0 - self._elapsed / self._time
            if left > 0.0:
                self.value = target + self._offset * left
                return self.value
            self._offset = 0.0
        self.value = target
        return target


class StickHandler:
    """One person's hands on stick, lever and nacelle switch, and the feet on the pedals."""

    def __init__(
        self,
        settings: StickSettings,
        *,
        start: Command,
        schedule: TransitionSchedule | None = None,
        tables: NacelleTables | None = None,
    ) -> None:
        """Begin with the controls as they are.

        Args:
            settings: Shaping and times.
            start: Controls at the start; the lever stays there until somebody moves it.
            schedule: Conversion by command; None refuses it.
            tables: The nacelles; None takes the XV-15's.
        """
        self._tables = load_nacelle_tables() if tables is None else tables
        self._schedule = schedule
        self._switch = NacelleSwitch(tables=self._tables)
        self.settings = settings
        self.state = INPUT_NONE
        """INPUT_NONE, INPUT_LIVE or INPUT_LOST."""
        self.nacelle_switch = 0
        """The switch as it acts: -1 forward, 0, 1 aft."""
        self.transition = 0
        """Conversion by command under way: 0 none, TO_HELICOPTER, TO_AIRPLANE."""
        self.trim = 0.0
        """Offset set by the trim buttons [half travels]."""
        self.lateral_trim = 0.0
        """The same of the lateral stick."""
        self._stick = _Control(start.stick, STICK_FADE_RATE)
        self._lever = _Control(start.lever, LEVER_FADE_RATE)
        self._lateral = _Control(start.lateral_stick, STICK_FADE_RATE)
        self._pedal = _Control(start.pedal, STICK_FADE_RATE)
        self._stream = 0
        self._target = math.nan
        self._owners: dict[int, int] = {}
        self._axis_angles: dict[tuple[int, int], float] = {}
        self.change(settings)
        # The kernels load now, not in a frame.
        self._limit(0.0)
        self._switch.step(0, command_angle=0.0, dt=0.004)

    @property
    def stick(self) -> float:
        """Longitudinal stick of the last frame."""
        return self._stick.value

    @property
    def lever(self) -> float:
        """Power lever of the last frame."""
        return self._lever.value

    @property
    def lateral_stick(self) -> float:
        """Lateral stick of the last frame."""
        return self._lateral.value

    @property
    def pedal(self) -> float:
        """Pedals of the last frame."""
        return self._pedal.value

    @property
    def waiting(self) -> int:
        """Controls whose hand is elsewhere and has not taken them yet: 1 stick, 2 lever, 4 lateral stick, 8 pedals."""
        controls = (self._stick, self._lever, self._lateral, self._pedal)
        return sum(control.waits << bit for bit, control in enumerate(controls))

    def change(self, settings: StickSettings) -> None:
        """Take other settings from the next frame on.

        Args:
            settings: The new ones.
        """
        self.settings = settings
        self._switch.tables = self._tables._replace(
            switch_rate=min(self._tables.switch_rate, settings.nacelle_rate),
            slow_rate_forward=min(self._tables.slow_rate_forward, settings.nacelle_rate),
            slow_rate_aft=min(self._tables.slow_rate_aft, settings.nacelle_rate),
        )

    def engage(self, acting: Command) -> None:
        """Take the controls over from another pilot.

        The lever stays as it is, stick and pedals are at their trim until the hands take them; what then differs from
        the acting controls fades in the flight.

        Args:
            acting: Controls that acted last.
        """
        self._lever = _Control(acting.lever, LEVER_FADE_RATE)
        self._stick, self._lateral, self._pedal = (_Control(0.0, STICK_FADE_RATE) for _ in range(3))
        self._stream = 0
        self._stop_nacelles()  # what was asked of them before another pilot flew is over
        self.state = INPUT_NONE if self.state == INPUT_NONE else INPUT_LIVE

    def go_on(self) -> None:
        """The flight goes on after it stood still: what the hands moved meanwhile fades in."""
        for control in (self._stick, self._lever, self._lateral, self._pedal):
            control.blend()

    def go_to(self, angle: float) -> None:
        """Send the nacelles to an angle at the switch's rate.

        Args:
            angle: Nacelle angle [rad]; it is limited to the travel.
        """
        self.transition = 0
        self._target = min(max(angle, self._tables.forward_stop), self._tables.aft_stop)

    def start_transition(self, direction: int) -> bool:
        """Begin a conversion by command.

        Args:
            direction: ``TO_HELICOPTER`` or ``TO_AIRPLANE``.

        Returns:
            Whether there is a schedule to follow.
        """
        if self._schedule is None or direction not in {TO_HELICOPTER, TO_AIRPLANE}:
            return False
        self._target = math.nan
        self.transition = direction
        return True

    def step(self, sticks: StickInput, *, age: float, situation: StickSituation, dt: float) -> Command:
        """Give this frame's command.

        Args:
            sticks: The newest stick input.
            age: Time since it arrived [s].
            situation: The aircraft.
        """
        settings = self.settings
        fresh = sticks.sequence > 0 and age <= settings.loss_time
        stick_held, lever_held = fresh and sticks.stick_valid, fresh and sticks.lever_valid
        lateral_held, pedal_held = fresh and sticks.lateral_valid, fresh and sticks.yaw_valid
        self._follow_state(held=fresh and sticks.held)
        stream = max(sticks.stream, 1) if fresh else 0
        goes_on, self._stream = stream == self._stream, stream
        if stick_held and sticks.trim:
            self.trim = self._trimmed(self.trim, sticks.trim, dt)
        if lateral_held and sticks.lateral_trim:
            self.lateral_trim = self._trimmed(self.lateral_trim, sticks.lateral_trim, dt)

        hand = self._sprung(sticks, self._stick, sticks.stick, bit=1, held=stick_held, goes_on=goes_on)
        stick = self._stick.step(hand, dt, settings=settings, rest=situation.trim_stick, trim=self.trim)
        hand = self._sprung(sticks, self._lateral, sticks.lateral, bit=8, held=lateral_held, goes_on=goes_on)
        lateral = self._lateral.step(hand, dt, settings=settings, rest=0.0, trim=self.lateral_trim)
        hand = self._sprung(sticks, self._pedal, sticks.yaw, bit=16, held=pedal_held, goes_on=goes_on)
        pedal = self._pedal.step(hand, dt, settings=settings, rest=0.0, trim=0.0)
        place = min(max(sticks.lever, 0.0), 1.0)
        hand = _Hand(place, (stream, sticks.overridden & 2), place) if lever_held else None
        lever = self._lever.step(hand, dt, settings=settings, rest=None, trim=0.0)

        rate = self._nacelle_rate(sticks, fresh=fresh, goes_on=goes_on, situation=situation, dt=dt)
        return Command(stick, lever, rate, lateral, pedal)

    def _trimmed(self, trim: float, direction: int, dt: float) -> float:
        """A trim after a frame with its button held."""
        return min(max(trim + direction * self.settings.trim_rate * dt, -LARGEST_TRIM), LARGEST_TRIM)

    def _sprung(
        self, sticks: StickInput, control: _Control, deflection: float, *, bit: int, held: bool, goes_on: bool
    ) -> _Hand | None:
        """The hand on a control that springs back to its centre, by its bit in ``StickInput.overridden``."""
        if not held:
            return None
        place = shaped(self.settings, deflection)
        # A stick that its owner never had, and that appears among inputs that go on, comes from its centre.
        before = 0.0 if goes_on and not control.held and self._owners.get(bit) != sticks.owner else place
        self._owners[bit] = sticks.owner
        return _Hand(place, (self._stream, sticks.overridden & bit), before)

    def _follow_state(self, *, held: bool) -> None:
        if held:
            self.state = INPUT_LIVE
        elif self.state == INPUT_LIVE:
            self.state = INPUT_LOST
            self._stop_nacelles()

    def _stop_nacelles(self) -> None:
        """The nacelles stop where they are, whoever set them moving."""
        self._target, self.transition = math.nan, 0
        self._switch.state[:] = 0.0

    def _nacelle_rate(
        self, sticks: StickInput, *, fresh: bool, goes_on: bool, situation: StickSituation, dt: float
    ) -> float:
        """Rate of the command angle: the switch first, then an angle to go to, then a conversion [rad/s]."""
        pressed = sticks.nacelle_switch if fresh else 0
        self.nacelle_switch = pressed
        if fresh:
            self._follow_axis(sticks.nacelle_angle, (sticks.owner, sticks.overridden & 4), goes_on=goes_on)
        if pressed:
            self._target, self.transition = math.nan, 0
        angle = situation.nacelle_command
        if self.settings.detents:
            rate = self._switch.step(pressed, command_angle=angle, dt=dt)
            if rate or pressed:
                return rate
        elif pressed:
            return pressed * self._limit(angle)
        if math.isfinite(self._target):
            if abs(self._target - angle) <= _SAME_ANGLE:
                self._target = math.nan
                return 0.0
            return self._towards(self._target, angle, dt)
        if self.transition and self._schedule is not None:
            return self._transition_rate(self._schedule, situation, dt)
        return 0.0

    def _follow_axis(self, angle: float, source: tuple[int, int], *, goes_on: bool) -> None:
        """An axis commands when it moves, or appears among inputs that go on; at rest it leaves the switch alone.

        An axis that comes back where it was, by the same owner and message, has not moved.
        """
        if not math.isfinite(angle):
            return
        if not goes_on:
            self._axis_angles[source] = angle
        elif not abs(angle - self._axis_angles.get(source, math.nan)) <= _NEW_ANGLE:
            self._axis_angles[source] = angle
            self.go_to(angle)

    def _transition_rate(self, schedule: TransitionSchedule, situation: StickSituation, dt: float) -> float:
        angle = situation.nacelle_command
        wanted = schedule.target(self.transition, situation.airspeed)
        if self.transition == TO_AIRPLANE:
            wanted, end = min(wanted, angle), self._tables.forward_stop
        else:
            wanted, end = max(wanted, angle), schedule.aft_angle[0]
        if abs(angle - end) <= _SAME_ANGLE:
            self.transition = 0
            return 0.0
        return self._towards(wanted, angle, dt)

    def _towards(self, target: float, angle: float, dt: float) -> float:
        limit = self._limit(angle)
        return min(max((target - angle) / dt, -limit), limit)

    def _limit(self, angle: float) -> float:
        """Rate of the switch here, slow near the stops [rad/s]."""
        return float(switch_rate_limit(self._switch.tables, angle))
