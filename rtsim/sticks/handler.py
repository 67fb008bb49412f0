"""Turns stick inputs into commands, frame by frame: pure, deterministic, and without a jump when input comes and goes.

The age of the input is an argument: the handler knows no clock. A value that is followed is applied unchanged in the
frame that reads it; only when the source of a control changes (input lost, input back, another pilot before) does what
was applied fade into what is now wanted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

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


class _Fade:
    """Keeps one control continuous when its source changes."""

    __slots__ = ("_elapsed", "_fastest", "_offset", "_time", "value")

    def __init__(self, value: float, fastest: float) -> None:
        self.value = value
        self._fastest = fastest
        self._offset, self._elapsed, self._time = 0.0, 0.0, 1.0

    def follow(self, target: float, dt: float, restart_in: float | None) -> float:
        """The control for this frame; ``restart_in`` is the time [s] of a fade that begins now."""
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
    """One person's hands on stick, lever and nacelle switch."""

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
        self._stick = _Fade(start.stick, STICK_FADE_RATE)
        self._lever = _Fade(start.lever, LEVER_FADE_RATE)
        self._stick_held = self._lever_held = False
        self._target = math.nan
        self._axis_angle = math.nan
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

        Sticks that are live are followed at once: what then differs from the acting controls is faded by the pilot
        aids. Where no stick is live, the lever stays as it is.

        Args:
            acting: Controls that acted last.
        """
        self._lever = _Fade(acting.lever, LEVER_FADE_RATE)
        self._stick = _Fade(0.0, STICK_FADE_RATE)
        self._stick_held = self._lever_held = True
        self._stop_nacelles()  # what was asked of them before another pilot flew is over
        self.state = INPUT_NONE if self.state == INPUT_NONE else INPUT_LIVE

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
        self._follow_state(held=stick_held or lever_held)
        if stick_held and sticks.trim:
            moved = self.trim + sticks.trim * settings.trim_rate * dt
            self.trim = min(max(moved, -LARGEST_TRIM), LARGEST_TRIM)

        wanted = shaped(settings, sticks.stick) if stick_held else situation.trim_stick
        wanted = min(max(wanted + self.trim, -1.0), 1.0)
        restart = None
        if stick_held != self._stick_held:
            restart = settings.blend_time if stick_held else settings.ramp_time
        stick = self._stick.follow(wanted, dt, restart)

        wanted = min(max(sticks.lever, 0.0), 1.0) if lever_held else self._lever.value
        restart = settings.blend_time if lever_held != self._lever_held else None
        lever = self._lever.follow(wanted, dt, restart)
        self._stick_held, self._lever_held = stick_held, lever_held

        rate = self._nacelle_rate(sticks, fresh=fresh, situation=situation, dt=dt)
        return Command(stick, lever, rate)

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

    def _nacelle_rate(self, sticks: StickInput, *, fresh: bool, situation: StickSituation, dt: float) -> float:
        """Rate of the command angle: the switch first, then an angle to go to, then a conversion [rad/s]."""
        pressed = sticks.nacelle_switch if fresh else 0
        self.nacelle_switch = pressed
        if fresh:
            self._follow_axis(sticks.nacelle_angle)
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

    def _follow_axis(self, angle: float) -> None:
        """An axis commands when it appears or moves; at rest it leaves the switch alone."""
        if not math.isfinite(angle):
            self._axis_angle = math.nan
        elif not abs(angle - self._axis_angle) <= _NEW_ANGLE:
            self._axis_angle = angle
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
