"""What to do about frames that are not finished in time."""

from __future__ import annotations

import re
from dataclasses import dataclass

from rtsim.errors import InputError


@dataclass(frozen=True, slots=True)
class OverrunPolicy:
    """Catch up for ever, or stop after a number of overruns.

    No policy ever skips a frame: deadlines stay on their absolute schedule, and late frames follow one another
    without a wait until the schedule is met again.
    """

    stop_after: int | None = None
    """Overruns after which the flight ends; None never ends it."""

    @classmethod
    def parse(cls, text: str) -> OverrunPolicy:
        """Read ``catch-up`` or ``stop:N``.

        Args:
            text: The policy as given on the command line.

        Raises:
            InputError: If it is neither.
        """
        if text == "catch-up":
            return cls()
        match = re.fullmatch(r"stop:(\d{1,9})", text)
        if match is None or int(match[1]) == 0:
            raise InputError(
                "is not an overrun policy",
                key="--overrun-policy",
                value=text,
                allowed="catch-up, or stop:N with N from 1",
                mend="write for example stop:10",
            )
        return cls(stop_after=int(match[1]))

    def __str__(self) -> str:
        return "catch-up" if self.stop_after is None else f"stop:{self.stop_after}"
