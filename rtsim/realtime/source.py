"""What is flown, as those who pace it and those who switch it from outside see it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from rtsim.arrays import FloatArray

if TYPE_CHECKING:
    from rtsim.loop.simulation import Disturbance


class SwitchedFlight(Protocol):
    """A flight in which somebody outside hands over and switches; what cannot be done is told and changes nothing."""

    def switch_pilot(self, pilot: str) -> None:
        """Hand the controls over.

        Args:
            pilot: A mode's name, or ``next``.
        """
        ...

    def switch_aid(self, name: str, *, on: bool | None) -> None:
        """Switch a pilot aid.

        Args:
            name: The aid.
            on: On or off; None switches it over.
        """
        ...

    def set_flaps(self, angle: float) -> None:
        """Send the flaps to a setting.

        Args:
            angle: Flap deflection [rad].
        """
        ...

    def step_flaps(self, step: int) -> None:
        """Send the flaps to the next published setting.

        Args:
            step: 1 down, -1 up.
        """
        ...

    def trim_throttle(self, share: float) -> None:
        """Trim the throttle.

        Args:
            share: Engine power to add with the governor off, as a share of full power.
        """
        ...

    def set_rotor_speed(self, speed: float) -> None:
        """Give the governor another rotor speed to hold.

        Args:
            speed: Rotor speed [rad/s].
        """
        ...


class FrameSource(SwitchedFlight, Protocol):
    """What is flown: a simulation with everything that acts on it."""

    @property
    def dt(self) -> float:
        """Length of a frame [s]."""
        ...

    @property
    def finished(self) -> bool:
        """Whether there is no further frame to fly."""
        ...

    @property
    def end_reason(self) -> str:
        """Why it is finished, as a sentence without full stop."""
        ...

    def step(self) -> FloatArray:
        """Fly one frame.

        Returns:
            Its row, shape (SIGNAL_COUNT,); it may be overwritten by the next call.
        """
        ...

    def run(self, frames: int) -> FloatArray:
        """Fly several frames at once.

        Args:
            frames: How many at most, at least 1.

        Returns:
            Their rows, shape (flown, SIGNAL_COUNT); fewer than asked where something happens in between.
        """
        ...

    def reset(self) -> None:
        """Put the aircraft back to its start."""
        ...

    def override_protection(self) -> None:
        """Take the authority from the protection law, or give it back."""
        ...

    def disturb(self, change: Disturbance) -> None:
        """Change the air, or let something fail or mend.

        Args:
            change: What happens.
        """
        ...
