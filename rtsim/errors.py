"""Errors a user can cause, each with one clear sentence and its exit code (``docs/commands.md``)."""

from __future__ import annotations

import signal
from collections.abc import Iterable

EXIT_EXPECTATION_FAILED = 1
EXIT_BAD_INPUT = 2
EXIT_OVERRUN = 3
EXIT_OUTPUT_FAILED = 4
LONGEST_VALUE = 300
"""Of a longer value only the beginning is shown [characters]."""


class Terminated(SystemExit):
    """A signal asked for the end: unwinds like Ctrl-C, so that files are closed, and ends with 128 + its number."""

    def __init__(self, signal_number: int = signal.SIGTERM) -> None:
        """Choose the exit code.

        Args:
            signal_number: The signal.
        """
        super().__init__(128 + signal_number)


class RtsimError(Exception):
    """Base of every error whose message is meant for the user; the command prints it without traceback."""

    exit_code = EXIT_BAD_INPUT


class InputError(RtsimError):
    """Something the user gave is wrong: the message names file, key, value, allowed range and mend."""

    exit_code = EXIT_BAD_INPUT

    def __init__(
        self,
        problem: str,
        *,
        file: str | None = None,
        key: str | None = None,
        value: object = None,
        allowed: str | None = None,
        mend: str | None = None,
    ) -> None:
        """Compose the sentence.

        Args:
            problem: What is wrong, in a few words without full stop.
            key: The key, option or argument, spelled as the user spells it.
            value: The offending value (shown with ``repr``); None leaves it out.
            allowed: The allowed range or choices, in words.
            mend: What to do about it, as an imperative.
        """
        self.problem, self.file, self.key = problem, file, key
        self.value, self.allowed, self.mend = value, allowed, mend
        where = ": ".join(_printable(part) for part in (file, key) if part)
        text = f"{where}: {problem}" if where else problem
        if value is not None:
            text += f" (got {_shown(value)})"
        if allowed:
            text += f"; allowed: {allowed}"
        if mend:
            text += f"; {mend}"
        super().__init__(text if text.endswith("?") else text + ".")


def _printable(text: str) -> str:
    """Without what would move a terminal's cursor or end the line."""
    return "".join(sign if sign.isprintable() else repr(sign)[1:-1] for sign in text)


def _shown(value: object) -> str:
    """A value in one line that can be read."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # a number of thousands of digits, a list in a list in a list
        return f"a {type(value).__name__}"
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}..."


class OutputError(RtsimError):
    """A file or socket failed while the flight itself was sound."""

    exit_code = EXIT_OUTPUT_FAILED


class OverrunStop(RtsimError):
    """The overrun policy ``stop:N`` ended a real-time flight."""

    exit_code = EXIT_OVERRUN


class TrimError(InputError):
    """No trim was found; the message names the residual that did not close."""


def closest(word: str, choices: Iterable[str]) -> list[str]:
    """Choices ordered by likeness to a word, the likeliest first.

    Args:
        word: What the user wrote.
        choices: What could have been meant.
    """
    import difflib

    def likeness(choice: str) -> float:
        return difflib.SequenceMatcher(None, word.lower(), choice.lower()).ratio()

    return sorted(choices, key=lambda choice: (-likeness(choice), choice))


def suggestion(word: str, choices: Iterable[str], *, otherwise: str) -> str:
    """An imperative that names the choice a user probably meant.

    Args:
        word: What the user wrote.
        choices: What could have been meant.
        otherwise: The imperative where nothing is similar.
    """
    import difflib

    similar = difflib.get_close_matches(word.lower(), list(choices), n=1, cutoff=0.5)
    return f"perhaps '{similar[0]}' is meant" if similar else otherwise
