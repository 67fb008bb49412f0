"""Sticks over MAVLink: MANUAL_CONTROL and RC_CHANNELS_OVERRIDE become one ``StickInput``; one pilot at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
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
    "trim_left": 16,
    "trim_right": 17,
}
"""Button number of each function; from 16 on they are those of ``buttons2``."""
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
_RELEASE, _IGNORE = 0, 65535
_CHANNEL_BITS = {"stick": 1, "lever": 2, "nacelle": 4, "lateral": 8, "yaw": 16}
_Said = dict[str, tuple[float, int]]
"""What one message said, and when, by control."""


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

    def hand_to(self, pilot: PilotId, now: float) -> None:
        """Make somebody the owner, as of now.

        Args:
            pilot: Who.
        """
        self.owner, self._last = pilot, now

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
        # The two messages are two sources, and neither touches what the other said: value and time by control.
        self._manual: _Said = {}
        self._override: _Said = {}
        self.held_down = 0
        """Buttons of the newest MANUAL_CONTROL."""
        self._stream = 0

    def forget(self, *, buttons: bool) -> None:
        """Let every axis count as nobody's until it is heard again.

        Args:
            buttons: Whether the buttons are forgotten too, so that one held by the next pilot counts as pressed.
        """
        self._manual.clear()
        self._override.clear()
        self._stream = 0
        if buttons:
            self.held_down = 0

    def manual_control(
        self, message: Any, *, received_ns: int, pilot: PilotId, bipolar: bool, lasts_ns: int
    ) -> list[str]:
        """Take a MANUAL_CONTROL.

        Args:
            message: The message.
            received_ns: When it arrived, monotonic [ns].
            pilot: Who sent it.
            bipolar: Whether z runs from -1000 to 1000.
            lasts_ns: How long what was said counts [ns].

        Returns:
            Functions of ``EDGE_BUTTONS`` whose button went down.
        """
        buttons = (message.buttons & 0xFFFF) | (message.buttons2 & 0xFFFF) << 16
        held = {function: buttons >> number & 1 for function, number in self._buttons.items()}
        given = {control: self._manual_axis(message, control) for control in ("stick", "lateral", "yaw", "nacelle")}
        given["lever"] = self._manual_lever(message, bipolar=bipolar)
        for control, value in given.items():
            if value is not None:  # an axis without a good value keeps its last one, for as long as that counts
                self._manual[control] = value, received_ns
        if not self._carried(message, "nacelle"):
            self._manual.pop("nacelle", None)
        self._manual["switch"] = held["nacelle_aft"] - held["nacelle_forward"], received_ns
        self._manual["trim"] = held["trim_forward"] - held["trim_aft"], received_ns
        self._manual["lateral_trim"] = held["trim_right"] - held["trim_left"], received_ns
        self._manual["buttons"] = buttons, received_ns
        pressed, self.held_down = buttons & ~self.held_down, buttons
        self._merge(received_ns=received_ns, pilot=pilot, lasts_ns=lasts_ns)
        return [function for function in EDGE_BUTTONS if pressed >> self._buttons[function] & 1]

    def gives_back(self, message: Any) -> bool:
        """Whether an RC_CHANNELS_OVERRIDE releases a channel that one before it set.

        Args:
            message: The message.
        """
        return any(raw == _RELEASE and control in self._override for control, raw in _channels(message))

    def override(self, message: Any, *, received_ns: int, pilot: PilotId, lasts_ns: int) -> None:
        """Take an RC_CHANNELS_OVERRIDE: what it does not carry it leaves alone.

        Args:
            message: The message.
            received_ns: When it arrived, monotonic [ns].
            pilot: Who sent it.
            lasts_ns: How long what was said counts [ns].
        """
        for control, raw in _channels(message):
            value = _pwm(raw)
            if value is not None:
                self._override[control] = _OVERRIDDEN[control](value), received_ns
            elif raw == _RELEASE:
                self._override.pop(control, None)
            elif raw != _IGNORE:
                self.ignored_axes += 1
        self._merge(received_ns=received_ns, pilot=pilot, lasts_ns=lasts_ns)

    def _merge(self, *, received_ns: int, pilot: PilotId, lasts_ns: int) -> None:
        """Make one input of what both messages said lately; a channel that is overridden counts before an axis."""
        self._stream = self._stream or received_ns
        values: dict[str, float] = {}
        heard: list[int] = []
        overridden = 0
        for said in (self._manual, self._override):
            for control, (_, when) in said.items():
                value = _live(said, control, received_ns, lasts_ns)
                if value is not None:
                    values[control] = value
                    heard.append(when)
                    if said is self._override:
                        overridden |= _CHANNEL_BITS.get(control, 0)
        self.sticks = StickInput(
            sequence=self.sticks.sequence + 1,
            received_ns=max(heard, default=self.sticks.received_ns),
            stick=values.get("stick", 0.0),
            lever=values.get("lever", 0.0),
            lateral=values.get("lateral", 0.0),
            yaw=values.get("yaw", 0.0),
            stick_valid="stick" in values,
            lever_valid="lever" in values,
            nacelle_switch=int(values.get("switch", 0)),
            nacelle_angle=deg(45.0 * (1.0 + values.get("nacelle", math.nan))),
            trim=int(values.get("trim", 0)),
            buttons=int(values.get("buttons", 0)),
            owner=pilot.number,
            stream=self._stream,
            overridden=overridden,
            lateral_valid="lateral" in values,
            yaw_valid="yaw" in values,
            lateral_trim=int(values.get("lateral_trim", 0)),
        )

    def _carried(self, message: Any, control: str) -> bool:
        """Whether a message has the axis of a control, with a good value or a bad one."""
        place, _ = self._axes.get(control, (-1, 1.0))
        return 0 <= place < 4 or (place >= 4 and bool(message.enabled_extensions >> (place - 4) & 1))

    def _manual_axis(self, message: Any, control: str) -> float | None:
        """Value of a control between -1 and 1, or None where the message has no good one."""
        if not self._carried(message, control):
            return None
        place, sign = self._axes[control]
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


def carries(message: Any) -> bool:
    """Whether an RC_CHANNELS_OVERRIDE sets any channel that means something here.

    Args:
        message: The message.
    """
    return any(_pwm(raw) is not None for _, raw in _channels(message))


def _channels(message: Any) -> list[tuple[str, int]]:
    """Controls and pulse widths of the channels that mean something here."""
    return [(control, int(getattr(message, f"chan{number}_raw"))) for number, control in enumerate(_OVERRIDDEN, 1)]


def _live(said: _Said, control: str, now_ns: int, lasts_ns: int) -> float | None:
    """What was said about a control, unless that was too long ago."""
    value, when = said.get(control, (0.0, -lasts_ns - 1))
    return value if now_ns - when <= lasts_ns else None


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


def _switch(value: float) -> int:
    """The nacelle switch of a channel: low aft, high forward."""
    return 1 if value < -0.4 else -1 if value > 0.4 else 0


_OVERRIDDEN: Mapping[str, Callable[[float], float]] = {
    "lateral": float,
    "stick": lambda value: -value,  # low is forward
    "lever": lambda value: 0.5 * (1.0 + value),
    "yaw": float,
    "switch": _switch,
    "nacelle": float,
}
"""What channels 1 to 6 of RC_CHANNELS_OVERRIDE are, and how a position from -1 to 1 is meant."""
