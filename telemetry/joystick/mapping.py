"""From a device's axes and buttons to MANUAL_CONTROL: pure, so that it can be tested without a device."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from telemetry.joystick.stick_map import DeviceAxis, GamepadMap, LeverAxis
from telemetry.mavlink.pilot_input import STANDARD_BUTTONS

LEVER_BUTTON_RATE = 0.15
"""Lever travel per second while a lever button is held."""


@dataclass(frozen=True, slots=True)
class DeviceState:
    """What a device says at one moment."""

    axes: tuple[float, ...] = ()
    """Its axes, -1 to 1 each."""
    buttons: frozenset[int] = frozenset()
    """Numbers of the buttons held."""
    hat: tuple[int, int] = (0, 0)
    """First hat (the cross): right and up positive."""
    lever_steps: float = 0.0
    """Lever travel asked for by keys since the last look."""


class Device(Protocol):
    """Something to fly with."""

    @property
    def name(self) -> str:
        """How it is called."""
        ...

    def read(self) -> DeviceState:
        """Its present state; never waits."""
        ...

    def close(self) -> None:
        """Let it go."""
        ...


@dataclass(frozen=True, slots=True)
class Controls:
    """What is sent: sticks, and what was pressed just now."""

    stick: float = 0.0
    """Forward positive, -1 to 1."""
    lateral: float = 0.0
    """Right positive, -1 to 1."""
    lever: float = 0.5
    """0 to 1."""
    yaw: float = 0.0
    """Right positive, -1 to 1."""
    buttons: int = 0
    """Bits of MANUAL_CONTROL."""
    pressed: frozenset[str] = field(default_factory=frozenset)
    """Functions whose button went down since the last look, for what is no bit: ``arm``, ``reset``."""

    def manual_control(self) -> tuple[int, int, int, int, int, int]:
        """x, y, z, r, buttons and buttons2 of MANUAL_CONTROL."""
        return (
            _thousandths(self.stick),
            _thousandths(self.lateral),
            _thousandths(self.lever),
            _thousandths(self.yaw),
            self.buttons & 0xFFFF,
            self.buttons >> 16,
        )


class Mapper:
    """Turns device states into controls; remembers the lever where the device has none that stays."""

    def __init__(self, stick_map: GamepadMap, *, lever: float = 0.5) -> None:
        """Begin.

        Args:
            stick_map: Which axis and button does what.
            lever: Power lever to begin with.
        """
        self.stick_map = stick_map
        self.lever = lever
        """Power lever now, 0 to 1."""
        self.lever_rest_s = 0.0
        """How long nobody has moved it [s]."""
        self._held: frozenset[str] = frozenset()

    def controls(self, state: DeviceState, dt: float) -> Controls:
        """Controls for a device state.

        Args:
            state: The device now.
            dt: Time since the last call [s].
        """
        axes = self.stick_map.axes
        held = self._functions_held(state)
        pressed, self._held = held - self._held, held
        self._move_lever(axes.lever, state, held, dt)
        bits = sum(1 << bit for function, bit in STANDARD_BUTTONS.items() if function in held)
        return Controls(
            stick=axis_value(axes.stick, state),
            lateral=axis_value(axes.lateral, state),
            lever=self.lever,
            yaw=axis_value(axes.yaw, state),
            buttons=bits,
            pressed=frozenset(pressed),
        )

    def _functions_held(self, state: DeviceState) -> frozenset[str]:
        held: set[str] = {function for function, number in self.stick_map.buttons.items() if number in state.buttons}
        right, up = state.hat
        directions = {"right": right > 0, "left": right < 0, "up": up > 0, "down": up < 0}
        held |= {function for direction, function in self.stick_map.hat_buttons.items() if directions[direction]}
        return frozenset(held)

    def _move_lever(self, axis: LeverAxis | None, state: DeviceState, held: frozenset[str], dt: float) -> None:
        before = self.lever
        if axis is not None and axis.index < len(state.axes):
            value = axis_value(axis, state)
            if axis.mode == "absolute":
                self.lever = 0.5 * (1.0 + value)
            else:
                self.lever += axis.rate_per_s * value * dt
        self.lever += state.lever_steps
        self.lever += LEVER_BUTTON_RATE * dt * (("lever_up" in held) - ("lever_down" in held))
        self.lever = min(max(self.lever, 0.0), 1.0)
        self.lever_rest_s = self.lever_rest_s + dt if self.lever == before else 0.0


def axis_value(axis: DeviceAxis | None, state: DeviceState) -> float:
    """Value of a mapped axis after reversal, dead band and expo; 0 where there is none.

    Args:
        axis: The map's axis.
        state: The device.
    """
    if axis is None or axis.index >= len(state.axes):
        return 0.0
    value = state.axes[axis.index]
    if not math.isfinite(value):
        return 0.0
    value = min(max(-value if axis.reverse else value, -1.0), 1.0)
    size = abs(value)
    if size <= axis.dead_band:
        return 0.0
    size = (size - axis.dead_band) / (1.0 - axis.dead_band)
    return math.copysign((1.0 - axis.expo) * size + axis.expo * size**3, value)


def function_words() -> Mapping[str, str]:
    """What each function does, for people."""
    return {
        "nacelle_forward": "nacelles to the airplane",
        "nacelle_aft": "nacelles to the helicopter",
        "rate_damping": "rate damping (SAS) on or off",
        "attitude_retention": "attitude retention on or off",
        "freeze": "freeze the flight, or go on",
        "pilot": "hand over: virtual pilot, you, held",
        "trim_forward": "trim nose down",
        "trim_aft": "trim nose up",
        "trim_left": "trim the stick to the left",
        "trim_right": "trim the stick to the right",
        "automatic_flaps": "automatic flaps on or off",
        "flaps_up": "flaps up one setting",
        "flaps_down": "flaps down one setting",
        "governor": "rotor-speed governor on or off",
        "arm": "arm or disarm",
        "reset": "back to the start",
        "lever_up": "more power",
        "lever_down": "less power",
    }


def _thousandths(value: float) -> int:
    return round(1000.0 * min(max(value, -1.0), 1.0))
