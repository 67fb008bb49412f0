"""Sticks over MAVLink: MANUAL_CONTROL and RC_CHANNELS_OVERRIDE become one ``StickInput``; one pilot at a time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rtsim.command import StickInput
from rtsim.errors import InputError
from rtsim.units import deg
from telemetry.mavlink.peers import Address

FIELD_ORDER = ("x", "y", "z", "r", "s", "t", "aux1", "aux2", "aux3", "aux4", "aux5", "aux6")
"""Axes of MANUAL_CONTROL; from ``s`` on each has a bit in ``enabled_extensions``."""
STANDARD_AXES: dict[str, str] = {"stick": "x", "lateral": "y", "lever": "z", "yaw": "r", "nacelle": "aux1"}
"""Axis behind each control."""
STANDARD_BUTTONS: dict[str, int] = {
    "nacelle_aft": 4,
    "nacelle_forward": 5,
    "rate_damping": 6,
    "freeze": 7,
    "attitude_retention": 8,
    "pilot": 9,
    "automatic_flaps": 10,
    "trim_forward": 11,
    "trim_aft": 12,
    "flaps_up": 13,
    "flaps_down": 14,
    "governor": 15,
}
"""Button number of each function."""
EDGE_BUTTONS = (
    "rate_damping",
    "freeze",
    "attitude_retention",
    "pilot",
    "automatic_flaps",
    "flaps_up",
    "flaps_down",
    "governor",
)
"""Functions that act once when their button goes down; the others act while it is held."""
_IGNORE = 65535


@dataclass(frozen=True, slots=True)
class PilotId:
    """Who sends sticks: two programs with the same ids differ by address."""

    system_id: int
    component_id: int
    address: Address

    @property
    def number(self) -> int:
        """As one number: 256 * system + component."""
        return self.system_id << 8 | self.component_id

    def __str__(self) -> str:
        return f"{self.system_id}/{self.component_id}"


class OwnerLock:
    """The first allowed pilot holds the sticks until it has been silent for a while."""

    def __init__(self, whitelist: tuple[int, ...]) -> None:
        """Begin with nobody.

        Args:
            whitelist: System ids that may fly.
        """
        self._whitelist = frozenset(whitelist)
        self.owner: PilotId | None = None
        """Who holds the sticks."""
        self._last = -math.inf

    def allowed(self, system_id: int) -> bool:
        """Whether a system may fly and change things.

        Args:
            system_id: Its MAVLink system id.
        """
        return system_id in self._whitelist

    def claim(self, pilot: PilotId, now: float, *, release_after: float) -> bool:
        """Whether this pilot's input counts; it takes the sticks where they are free.

        Args:
            pilot: Who sends.
            release_after: Silence after which the sticks are free [s].
        """
        if not self.allowed(pilot.system_id):
            return False
        if self.owner != pilot:
            if self.owner is not None and now - self._last <= release_after:
                return False
            self.owner = pilot
        self._last = now
        return True

    def release_if_silent(self, now: float, *, release_after: float) -> bool:
        """Free the sticks of a silent owner.

        Args:
            release_after: Silence after which they are free [s].

        Returns:
            Whether they were freed just now.
        """
        if self.owner is None or now - self._last <= release_after:
            return False
        self.owner = None
        return True


class StickReader:
    """Keeps the last good value of every axis and makes stick inputs of what arrives."""

    def __init__(self, axes: Mapping[str, str], buttons: Mapping[str, int]) -> None:
        """Take the map.

        Args:
            axes: MANUAL_CONTROL axis behind each control, a leading ``-`` reverses; missing controls are standard.
            buttons: Button number of each function; missing functions are standard.

        Raises:
            InputError: The map names an axis, control or function that does not exist.
        """
        self._axes = {
            control: _axis(control, source) for control, source in {**STANDARD_AXES, **axes}.items() if source
        }
        unknown = set(buttons) - set(STANDARD_BUTTONS)
        if unknown:
            raise InputError(
                "is no button function", key=f"buttons.{min(unknown)}", allowed=", ".join(STANDARD_BUTTONS)
            )
        self._buttons = {**STANDARD_BUTTONS, **buttons}
        self.sticks = StickInput()
        """The newest input."""
        self.ignored_axes = 0
        """Axis values that were out of range or marked invalid."""

    def function_held(self, function: str) -> bool:
        """Whether the button of a function is down.

        Args:
            function: One of ``STANDARD_BUTTONS``.
        """
        return bool(self.sticks.buttons >> self._buttons[function] & 1)

    def forget(self, *, buttons: bool) -> None:
        """Let every axis count as nobody's until it is heard again.

        Args:
            buttons: Whether the buttons are forgotten too, so that one held by the next pilot counts as pressed.
        """
        old = self.sticks
        self.sticks = StickInput(
            sequence=old.sequence, received_ns=old.received_ns, buttons=0 if buttons else old.buttons
        )

    def manual_control(self, message: Any, *, received_ns: int, pilot: PilotId, bipolar: bool) -> list[str]:
        """Take a MANUAL_CONTROL.

        Args:
            message: The message.
            received_ns: When it arrived, monotonic [ns].
            pilot: Who sent it.
            bipolar: Whether z runs from -1000 to 1000.

        Returns:
            Functions of ``EDGE_BUTTONS`` whose button went down.
        """
        old = self.sticks
        stick = self._manual_axis(message, "stick")
        lateral = self._manual_axis(message, "lateral")
        yaw = self._manual_axis(message, "yaw")
        lever = self._manual_lever(message, bipolar=bipolar)
        nacelle = self._manual_axis(message, "nacelle")
        buttons = (message.buttons & 0xFFFF) | (message.buttons2 & 0xFFFF) << 16
        self.sticks = replace_input(
            old,
            received_ns=received_ns,
            stick=old.stick if stick is None else stick,
            lateral=old.lateral if lateral is None else lateral,
            yaw=old.yaw if yaw is None else yaw,
            lever=old.lever if lever is None else lever,
            stick_valid=stick is not None or old.stick_valid,
            lever_valid=lever is not None or old.lever_valid,
            nacelle_angle=math.nan if nacelle is None else deg(45.0 * (1.0 + nacelle)),
            buttons=buttons,
            owner=pilot.number,
        )
        aft, forward = self.function_held("nacelle_aft"), self.function_held("nacelle_forward")
        trim = int(self.function_held("trim_forward")) - int(self.function_held("trim_aft"))
        self.sticks = self.sticks._replace(nacelle_switch=int(aft) - int(forward), trim=trim)
        pressed = buttons & ~old.buttons
        return [function for function in EDGE_BUTTONS if pressed >> self._buttons[function] & 1]

    def override(self, message: Any, *, received_ns: int, pilot: PilotId) -> None:
        """Take an RC_CHANNELS_OVERRIDE: roll, pitch (low PWM is stick forward), lever, yaw, nacelle switch, nacelle.

        Args:
            message: The message.
            received_ns: When it arrived, monotonic [ns].
            pilot: Who sent it.
        """
        old = self.sticks
        raw = [int(getattr(message, f"chan{number}_raw")) for number in range(1, 7)]
        roll, pitch, throttle, pedals, switch, nacelle = map(_pwm, raw)
        released = {number: value == 0 for number, value in enumerate(raw, start=1)}
        self.ignored_axes += sum(value not in {0, _IGNORE} and _pwm(value) is None for value in raw)
        self.sticks = replace_input(
            old,
            received_ns=received_ns,
            stick=old.stick if pitch is None else -pitch,
            lateral=_kept(old.lateral, roll, released=released[1]),
            yaw=_kept(old.yaw, pedals, released=released[4]),
            lever=old.lever if throttle is None else 0.5 * (1.0 + throttle),
            stick_valid=pitch is not None or (old.stick_valid and not released[2]),
            lever_valid=throttle is not None or (old.lever_valid and not released[3]),
            nacelle_switch=_kept_switch(old.nacelle_switch, switch, released=released[5]),
            nacelle_angle=_kept_angle(old.nacelle_angle, nacelle, released=released[6]),
            trim=0,
            buttons=0,
            owner=pilot.number,
        )

    def _manual_axis(self, message: Any, control: str) -> float | None:
        """Value of a control between -1 and 1, or None where the message has no good one."""
        source = self._axes.get(control)
        if source is None:
            return None
        place, sign = source
        if place >= 4 and not message.enabled_extensions >> (place - 4) & 1:
            return None
        raw = int(getattr(message, FIELD_ORDER[place]))
        if not -1000 <= raw <= 1000:
            self.ignored_axes += 1
            return None
        return sign * raw / 1000.0

    def _manual_lever(self, message: Any, *, bipolar: bool) -> float | None:
        source = self._axes.get("lever")
        if source is None:
            return None
        value = self._manual_axis(message, "lever")
        if value is None:
            return None
        place, sign = source
        if place != 2 or bipolar:
            return 0.5 * (1.0 + value)
        value *= sign
        if value < 0.0:  # the range is agreed on, never guessed from a sign
            self.ignored_axes += 1
            return None
        return value if sign > 0.0 else 1.0 - value


def replace_input(old: StickInput, **changes: Any) -> StickInput:
    """The next input after another one.

    Args:
        old: The one before.
        **changes: Fields that differ.
    """
    return old._replace(sequence=old.sequence + 1, **changes)


def _axis(control: str, source: str) -> tuple[int, float]:
    if control not in STANDARD_AXES:
        raise InputError("is no control", key=f"axes.{control}", allowed=", ".join(STANDARD_AXES))
    name = source.removeprefix("-")
    if name not in FIELD_ORDER:
        raise InputError(
            "is no axis of MANUAL_CONTROL", key=f"axes.{control}", value=source, allowed=", ".join(FIELD_ORDER)
        )
    return FIELD_ORDER.index(name), -1.0 if source.startswith("-") else 1.0


def _pwm(raw: int) -> float | None:
    """A pulse width as -1 to 1; None where it is no stick position."""
    if not 800 <= raw <= 2200:
        return None
    return min(max((raw - 1500) / 500.0, -1.0), 1.0)


def _kept(old: float, new: float | None, *, released: bool) -> float:
    """A shown axis: new where given, centred where released, else as it was."""
    if new is not None:
        return new
    return 0.0 if released else old


def _kept_switch(old: int, new: float | None, *, released: bool) -> int:
    if new is None:
        return 0 if released else old
    return 1 if new < -0.4 else -1 if new > 0.4 else 0


def _kept_angle(old: float, new: float | None, *, released: bool) -> float:
    if new is None:
        return math.nan if released else old
    return deg(45.0 * (1.0 + new))
