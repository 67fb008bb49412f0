"""Gamepads and joysticks through SDL (pygame-ce, an optional extra)."""

from __future__ import annotations

import os
from typing import Any

from rtsim.errors import InputError
from telemetry.joystick.mapping import DeviceState


def gamepad_names() -> list[str]:
    """Names of the devices that are plugged in.

    Raises:
        InputError: pygame-ce is not installed.
    """
    pygame = _pygame()
    return [pygame.joystick.Joystick(number).get_name() for number in range(pygame.joystick.get_count())]


class Gamepad:
    """One gamepad or joystick."""

    def __init__(self, wanted: str | None = None) -> None:
        """Open it.

        Args:
            wanted: Its number, or a part of its name; None takes the first.

        Raises:
            InputError: There is none, or pygame-ce is not installed.
        """
        self._pygame = _pygame()
        names = gamepad_names()
        number = _choose(names, wanted)
        self._joystick = self._pygame.joystick.Joystick(number)
        self.name: str = names[number]
        """How it is called."""

    def read(self) -> DeviceState:
        """Its present state; never waits."""
        self._pygame.event.pump()
        joystick = self._joystick
        hat = joystick.get_hat(0) if joystick.get_numhats() else (0, 0)
        return DeviceState(
            tuple(joystick.get_axis(number) for number in range(joystick.get_numaxes())),
            frozenset(number for number in range(joystick.get_numbuttons()) if joystick.get_button(number)),
            (int(hat[0]), int(hat[1])),
        )

    @property
    def connected(self) -> bool:
        """Whether it is still plugged in."""
        self._pygame.event.pump()
        return bool(self._joystick.get_init()) and self._pygame.joystick.get_count() > 0

    def close(self) -> None:
        """Let it go."""
        self._joystick.quit()
        self._pygame.joystick.quit()
        self._pygame.display.quit()


def _choose(names: list[str], wanted: str | None) -> int:
    if not names:
        raise InputError(
            "no gamepad is plugged in", key="--device", mend="plug one in, or fly with the keyboard: add --keyboard"
        )
    if wanted is None:
        return 0
    if wanted.isdigit() and int(wanted) < len(names):
        return int(wanted)
    for number, name in enumerate(names):
        if wanted.lower() in name.lower():
            return number
    listed = ", ".join(f"{number}: {name}" for number, name in enumerate(names))
    raise InputError("there is no such device", key="--device", value=wanted, allowed=listed, mend="choose one")


def _pygame() -> Any:
    """The package, started without a window."""
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    os.environ.setdefault("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1")
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        import pygame
    except ModuleNotFoundError:
        raise InputError(
            "gamepads need the package pygame-ce",
            key="rtsim joystick",
            mend="install it with: pip install 'rtsim[gamepad]', or fly with the keyboard: add --keyboard",
        ) from None
    if not pygame.joystick.get_init():
        pygame.display.init()
        pygame.joystick.init()
    return pygame
