"""The hand on a running flight: pause, step, warp, reset, switch pilot, stop; from any thread or signal handler."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from rtsim.errors import InputError

if TYPE_CHECKING:
    from rtsim.loop.simulation import Disturbance

Action = Literal[
    "pause",
    "resume",
    "toggle-pause",
    "step",
    "speed",
    "faster",
    "slower",
    "reset",
    "pilot",
    "override",
    "aid",
    "flaps",
    "step-flaps",
    "throttle",
    "rotor-speed",
    "disturb",
    "stop",
]

WARP_STEPS = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
"""Speeds that the keys ``+`` and ``-`` walk through, in multiples of real time."""
PILOT_CHOICES = ("mocm", "external", "hold", "next")
"""Whom the controls may be handed to."""
SPEED_RANGE = (0.001, 1000.0)
"""Speeds a flight may be paced at, in multiples of real time."""


@dataclass(frozen=True, slots=True)
class ControlRequest:
    """One thing asked of the executive; it is served before the next frame."""

    action: Action
    number: float = 0.0
    """Frames to step, the new speed, a flap angle [rad] or step, a throttle trim."""
    text: str = ""
    """Who shall fly, which aid, or why to stop."""
    on: bool | None = None
    """Whether an aid shall be on; None switches it over."""
    change: Disturbance | None = None
    """What shall happen to the air or the aircraft."""


class FlightControl:
    """Requests to a running flight.

    Every method may be called from any thread and from signal handlers: it only appends to a queue, which the
    executive empties between two frames. The attributes tell what the executive is doing.
    """

    def __init__(self) -> None:
        self.requests: deque[ControlRequest] = deque()
        """What has been asked and not served yet."""
        self.paused = False
        """Whether the flight stands still."""
        self.poll: Callable[[], None] | None = None
        """Called every few milliseconds while the flight stands still, so that whoever asks from outside is heard."""
        self.speed = 1.0
        """Speed asked for, in multiples of real time; infinite while it is not paced."""
        self.behind_s = 0.0
        """How far the last frame began behind its schedule [s]."""

    def pause(self) -> None:
        """Stand still after the frame that is being flown."""
        self.requests.append(ControlRequest("pause"))

    def resume(self) -> None:
        """Go on after a pause."""
        self.requests.append(ControlRequest("resume"))

    def toggle_pause(self) -> None:
        """Pause, or go on."""
        self.requests.append(ControlRequest("toggle-pause"))

    def step(self, frames: int = 1) -> None:
        """Fly a number of frames at the present speed, then pause.

        Args:
            frames: How many, at least 1.
        """
        if frames < 1:
            raise InputError("must be at least 1", key="frames", value=frames, mend="give a whole number from 1")
        self.requests.append(ControlRequest("step", number=frames))

    def set_speed(self, speed: float) -> None:
        """Change the speed of the flight.

        Args:
            speed: Multiple of real time, 0.001 to 1000, or infinity for as fast as possible.
        """
        self.requests.append(ControlRequest("speed", number=checked_speed(speed)))

    def faster(self) -> None:
        """Take the next higher warp step."""
        self.requests.append(ControlRequest("faster"))

    def slower(self) -> None:
        """Take the next lower warp step."""
        self.requests.append(ControlRequest("slower"))

    def reset(self) -> None:
        """Put the aircraft back to its start; the flight goes on from there."""
        self.requests.append(ControlRequest("reset"))

    def set_pilot(self, pilot: str = "next") -> None:
        """Hand the controls over.

        Args:
            pilot: ``mocm``, ``external`` or ``hold``, or ``next`` for the next one that is available. One that this
                flight does not have is refused by an event; the flight goes on.

        Raises:
            InputError: There is no such pilot in any flight.
        """
        if pilot not in PILOT_CHOICES:
            raise InputError(
                "is not a pilot", key="pilot", value=pilot, allowed=", ".join(PILOT_CHOICES), mend="choose one"
            )
        self.requests.append(ControlRequest("pilot", text=pilot))

    def override_protection(self) -> None:
        """Take the authority from the protection law, which goes on watching, or give it back."""
        self.requests.append(ControlRequest("override"))

    def switch_aid(self, name: str, *, on: bool | None = None) -> None:
        """Switch a pilot aid; one that there is not, or that this flight needs, is refused by an event.

        Args:
            name: One of ``rtsim.aids.design.SWITCHES``.
            on: On or off; None switches it over.
        """
        self.requests.append(ControlRequest("aid", text=name, on=on))

    def set_flaps(self, angle: float) -> None:
        """Send the flaps to a setting; they no longer follow their schedule.

        Args:
            angle: Flap deflection [rad]; one outside the travel is refused by an event.
        """
        self.requests.append(ControlRequest("flaps", number=angle))

    def step_flaps(self, step: int) -> None:
        """Send the flaps to the next published setting.

        Args:
            step: 1 down (more flap), -1 up.
        """
        self.requests.append(ControlRequest("step-flaps", number=step))

    def trim_throttle(self, share: float) -> None:
        """Trim the throttle, which acts while the rotor-speed governor is off.

        Args:
            share: Engine power to add, as a share of full power; one out of range is refused by an event.
        """
        self.requests.append(ControlRequest("throttle", number=share))

    def set_rotor_speed(self, speed: float) -> None:
        """Give the governor another rotor speed to hold.

        Args:
            speed: Rotor speed [rad/s]; one out of range, or off the downstop, is refused by an event.
        """
        self.requests.append(ControlRequest("rotor-speed", number=speed))

    def disturb(self, change: Disturbance) -> None:
        """Change the air, or let something fail or mend.

        Args:
            change: A gust, another severity of the turbulence, or a failure with whether it begins or ends.
        """
        self.requests.append(ControlRequest("disturb", change=change))

    def stop(self, reason: str = "stopped by the user") -> None:
        """End the flight cleanly after the frame that is being flown.

        Args:
            reason: Why, as a sentence without full stop; it becomes the end reason.
        """
        self.requests.append(ControlRequest("stop", text=reason))


def checked_speed(speed: float) -> float:
    """Refuse a speed that cannot be flown.

    Args:
        speed: Multiple of real time; infinity means not paced.

    Returns:
        The speed.
    """
    low, high = SPEED_RANGE
    try:
        number = float(speed)
    except (TypeError, ValueError):  # from Python, where nothing but a type checker would tell
        number = math.nan
    if not (low <= number <= high or number == math.inf):
        raise InputError(
            "is out of range",
            key="--speed",
            value=speed,
            allowed=f"{low:g} to {high:g} times real time, or max",
            mend="choose a value in this range",
        )
    return number


def neighbouring_warp(speed: float, *, upwards: bool) -> float:
    """The next warp step.

    Args:
        speed: The present speed.
        upwards: Whether to go faster.
    """
    if upwards:
        return next((step for step in WARP_STEPS if step > speed * 1.001), WARP_STEPS[-1])
    return next((step for step in reversed(WARP_STEPS) if step < speed / 1.001), WARP_STEPS[0])
