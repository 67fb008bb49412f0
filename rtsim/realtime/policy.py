"""What to do about frames that are not finished in time."""

from __future__ import annotations

import re
from dataclasses import dataclass

from rtsim.errors import InputError

BACKLOG_S = 0.25
"""A backlog that may be dropped is dropped when it is longer than this [s]."""


@dataclass(frozen=True, slots=True)
class OverrunPolicy:
    """Catch up for ever, drop what is late, or stop after a number of overruns.

    No policy ever skips a frame. Deadlines stay on their absolute schedule, and late frames follow one another
    without a wait until the schedule is met again; who flies by hand would then fly faster than life, so that a
    schedule which drops its backlog begins anew instead.
    """

    stop_after: int | None = None
    """Overruns after which the flight ends; None never ends it."""
    drops: bool = False
    """Whether the schedule begins anew when it is more than ``BACKLOG_S`` behind."""

    @classmethod
    def parse(cls, text: str) -> OverrunPolicy:
        """Read ``catch-up``, ``drop`` or ``stop:N``.

        Args:
            text: The policy as given on the command line.

        Raises:
            InputError: If it is none of them.
        """
        if text in {"catch-up", "drop"}:
            return cls(drops=text == "drop")
        match = re.fullmatch(r"stop:(\d{1,9})", text)
        if match is None or int(match[1]) == 0:
            raise InputError(
                "is not an overrun policy",
                key="--overrun-policy",
                value=text,
                allowed="catch-up, drop, or stop:N with N from 1",
                mend="write for example stop:10",
            )
        return cls(stop_after=int(match[1]))

    def __str__(self) -> str:
        if self.drops:
            return "drop"
        return "catch-up" if self.stop_after is None else f"stop:{self.stop_after}"
