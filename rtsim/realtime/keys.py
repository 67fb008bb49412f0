"""Keys of the terminal as the hand on a flight; the terminal is put back on every way out."""

from __future__ import annotations

import atexit
import os
import select
import sys
import termios
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

from rtsim.realtime.control import FlightControl
from rtsim.terminal import in_foreground, take_keys

KEY_HELP = (
    "Keys: space pause, . one frame, + - speed, 0 reset, p pilot, o override protection, t rate damping, "
    "h attitude retention, u automatic flaps, v b flaps down up, g rotor-speed governor, q quit"
)
"""What the keys do, for the user."""
AID_KEYS = {
    "t": "rate_damping",
    "h": "attitude_retention",
    "u": "automatic_flaps",
    "g": "governor",
}
FLAP_KEYS = {"v": 1, "b": -1}
POLL_S = 0.1
"""How long the reading thread waits at a time [s]; a waiting thread costs the loop nothing."""


def press(control: FlightControl, key: str) -> None:
    """Do what a key means; other keys mean nothing.

    Args:
        control: The flight.
        key: One character.
    """
    if key == " ":
        control.toggle_pause()
    elif key == ".":
        control.step()
    elif key in {"+", "="}:
        control.faster()
    elif key in {"-", "_"}:
        control.slower()
    elif key == "0":
        control.reset()
    elif key == "p":
        control.set_pilot("next")
    elif key == "o":
        control.override_protection()
    elif key in AID_KEYS:
        control.switch_aid(AID_KEYS[key])
    elif key in FLAP_KEYS:
        control.step_flaps(FLAP_KEYS[key])
    elif key == "q":
        control.stop("stopped by the key q")


class KeyReader:
    """Reads keys from the terminal while the ``with`` block runs; does nothing where stdin is no terminal."""

    def __init__(
        self, control: FlightControl, *, descriptor: int | None = None, on_help: Callable[[], None] | None = None
    ) -> None:
        """Prepare; the terminal is not touched before the block begins.

        Args:
            control: The flight the keys act on.
            descriptor: The terminal; None takes standard input.
            on_help: Called for the key ``?``.
        """
        self._control, self._on_help = control, on_help
        self._descriptor = _standard_input() if descriptor is None else descriptor
        self._saved: list[Any] | None = None
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def active(self) -> bool:
        """Whether keys are being read."""
        return self._thread is not None

    def __enter__(self) -> Self:
        if self._descriptor >= 0 and os.isatty(self._descriptor) and in_foreground(self._descriptor):
            self._saved = termios.tcgetattr(self._descriptor)
            atexit.register(self._restore)
            take_keys(self._descriptor)
            self._thread = threading.Thread(target=self._read, name="keys", daemon=True)
            self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.set()
        if self._thread is not None:
            self._thread.join(timeout=1.0)
            self._thread = None
        self._restore()

    def _restore(self) -> None:
        saved, self._saved = self._saved, None
        if saved is not None:
            atexit.unregister(self._restore)
            if in_foreground(self._descriptor):
                termios.tcsetattr(self._descriptor, termios.TCSADRAIN, saved)

    def _read(self) -> None:
        while not self._closing.is_set():
            ready, _, _ = select.select([self._descriptor], [], [], POLL_S)
            take_keys(self._descriptor)
            # A job in the background that touched its terminal would be stopped by the kernel, flight and all.
            if not ready or not in_foreground(self._descriptor):
                if ready:
                    self._closing.wait(POLL_S)
                continue
            try:
                text = os.read(self._descriptor, 32).decode(errors="ignore")
            except OSError:
                return
            if not text:
                return
            for key in text:
                if key == "?" and self._on_help is not None:
                    self._on_help()
                press(self._control, key)


def _standard_input() -> int:
    try:
        return sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):
        return -1
