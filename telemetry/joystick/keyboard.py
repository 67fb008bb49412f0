"""The terminal's keyboard as a device: keys that repeat while held, so each press lasts a moment.

A terminal tells presses and repeats but no releases. Stick keys therefore deflect for a moment and spring back, the
lever moves in small steps and stays, and the nacelle keys work while they are held down.
"""

from __future__ import annotations

import atexit
import os
import select
import sys
import termios
import time
from typing import Any

from rtsim.errors import InputError
from rtsim.terminal import in_foreground, take_keys
from telemetry.joystick.mapping import DeviceState
from telemetry.joystick.stick_map import DeviceAxes, DeviceAxis, GamepadMap

DEFLECTION = 0.35
"""Deflection of a stick key."""
LEVER_STEP = 0.01
"""Lever travel of one key press."""
_FIRST_PRESS_S, _REPEAT_S = 0.45, 0.12
"""How long a key counts as held after its first press (until repeats begin), and after a repeat [s]."""
_STICK_PRESS_S = 0.15
_AXIS_KEYS = {"w": (0, 1.0), "s": (0, -1.0), "d": (1, 1.0), "a": (1, -1.0), "e": (2, 1.0), "q": (2, -1.0)}
_ARROWS = {
    "\x1b[A": "w",
    "\x1b[B": "s",
    "\x1b[C": "d",
    "\x1b[D": "a",
    "\x1bOA": "w",
    "\x1bOB": "s",
    "\x1bOC": "d",
    "\x1bOD": "a",
}
_LEVER_KEYS = {"r": LEVER_STEP, "f": -LEVER_STEP, "R": 5 * LEVER_STEP, "F": -5 * LEVER_STEP}
_HELD_KEYS = {"m": 5, "n": 4}
_ONCE_KEYS = {
    "t": 6,
    " ": 7,
    "h": 8,
    "p": 9,
    "+": 11,
    "-": 12,
    "o": 13,
    "0": 14,
    "u": 15,
    "v": 16,
    "b": 17,
    "g": 18,
    ",": 19,
    ".": 20,
}
KEY_HELP = (
    ("w s, up down", "stick forward and back"),
    ("a d, left right", "stick left and right"),
    ("q e", "pedals left and right"),
    ("r f, R F", "power lever up and down, small and large steps"),
    ("m, n", "hold: nacelles to the airplane, to the helicopter"),
    ("+ -, comma stop", "trim nose down, up, stick to the left, to the right"),
    ("t, h", "rate damping, attitude retention on or off"),
    ("v b", "flaps down, up one setting (0, 20, 40, 75 deg)"),
    ("u, g", "automatic flaps, rotor-speed governor on or off"),
    ("p", "hand over: virtual pilot, you, held"),
    ("space, 0", "freeze or go on, back to the start"),
    ("o", "arm or disarm"),
    ("x, ctrl-c", "end"),
)
"""Keys and what they do."""
KEYBOARD_MAP = GamepadMap(
    kind="gamepad",
    name="Keyboard",
    axes=DeviceAxes(
        stick=DeviceAxis(index=0, dead_band=0.0),
        lateral=DeviceAxis(index=1, dead_band=0.0),
        yaw=DeviceAxis(index=2, dead_band=0.0),
    ),
    buttons={
        "nacelle_aft": 4,
        "nacelle_forward": 5,
        "rate_damping": 6,
        "freeze": 7,
        "attitude_retention": 8,
        "pilot": 9,
        "trim_forward": 11,
        "trim_aft": 12,
        "arm": 13,
        "reset": 14,
        "automatic_flaps": 15,
        "flaps_down": 16,
        "flaps_up": 17,
        "governor": 18,
        "trim_left": 19,
        "trim_right": 20,
    },
)
"""The keyboard in terms of a gamepad."""


class Keyboard:
    """Keys of the terminal; the terminal is put back on every way out."""

    name = "Keyboard"

    def __init__(self, descriptor: int | None = None) -> None:
        """Take the terminal.

        Args:
            descriptor: The terminal; None takes standard input.

        Raises:
            InputError: There is no terminal.
        """
        self._descriptor = sys.stdin.fileno() if descriptor is None else descriptor
        if not os.isatty(self._descriptor):
            raise InputError(
                "the keyboard needs a terminal", key="--keyboard", mend="run it in a terminal, not through a pipe"
            )
        self._saved: list[Any] | None = termios.tcgetattr(self._descriptor)
        atexit.register(self.close)
        take_keys(self._descriptor, foreign=True)
        self._until: dict[str, float] = {}
        self._lever = 0.0
        self.finished = False
        """The end key was pressed."""

    def read(self) -> DeviceState:
        """Keys as axes and buttons; never waits."""
        now = time.monotonic()
        for key in self._keys():
            self._press(key, now)
        axes = [0.0, 0.0, 0.0]
        for key, (axis, sign) in _AXIS_KEYS.items():
            if self._until.get(key, 0.0) > now:
                axes[axis] += sign * DEFLECTION
        buttons = {**_HELD_KEYS, **_ONCE_KEYS}
        lever, self._lever = self._lever, 0.0
        return DeviceState(
            tuple(axes),
            frozenset(bit for key, bit in buttons.items() if self._until.get(key, 0.0) > now),
            lever_steps=lever,
        )

    def close(self) -> None:
        """Put the terminal back."""
        saved, self._saved = self._saved, None
        if saved is not None:
            atexit.unregister(self.close)
            if in_foreground(self._descriptor, foreign=True):
                termios.tcsetattr(self._descriptor, termios.TCSADRAIN, saved)

    def _keys(self) -> list[str]:
        """Keys since the last look, arrows as their letters."""
        take_keys(self._descriptor, foreign=True)
        if not in_foreground(self._descriptor, foreign=True) or not select.select([self._descriptor], [], [], 0.0)[0]:
            return []
        text = os.read(self._descriptor, 256).decode(errors="ignore")
        for sequence, letter in _ARROWS.items():
            text = text.replace(sequence, letter)
        return list(text)

    def _press(self, key: str, now: float) -> None:
        if key in {"x", "\x03", "\x04", ""}:
            self.finished = True
        elif key in _LEVER_KEYS:
            self._lever += _LEVER_KEYS[key]
        elif key in _AXIS_KEYS:
            self._until[key] = now + _STICK_PRESS_S
        elif key in _HELD_KEYS:
            repeated = self._until.get(key, 0.0) > now
            self._until[key] = now + (_REPEAT_S if repeated else _FIRST_PRESS_S)
        elif key in _ONCE_KEYS:
            self._until[key] = now + _REPEAT_S
