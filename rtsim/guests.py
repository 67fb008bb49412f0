"""A user's own code runs as a guest: whatever it says or changes around it, the house is as it was when it leaves.

Legend:
    error: What was raised.
    value: Anything.
    text: Text from outside.
"""

from __future__ import annotations

import os
import re
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Any, Self, TypeVar

from rtsim.errors import Terminated

Answer = TypeVar("Answer")

LONGEST_WORDS = 300
"""Characters of a guest's text that people are shown."""
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]+")
_KEPT_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_handler_of: Any = getattr(signal.getsignal, "__wrapped__", signal.getsignal)
_set_handler: Any = getattr(signal.signal, "__wrapped__", signal.signal)


class Visit:
    """The current folder, the standard streams and the handlers of Ctrl-C and SIGTERM are put back at the end."""

    __slots__ = ("_folder", "_handlers", "_streams")

    def __enter__(self) -> Self:
        self._streams = (sys.stdout, sys.stderr)
        self._handlers = [_handler_of(number) for number in _KEPT_SIGNALS]
        try:
            self._folder: str | None = os.getcwd()  # noqa: PTH109 - a Path takes ten times as long, 50 times a second
        except OSError:  # it is gone
            self._folder = None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        sys.stdout, sys.stderr = self._streams
        for number, handler in zip(_KEPT_SIGNALS, self._handlers, strict=True):
            if _handler_of(number) is not handler and handler is not None:
                with suppress(ValueError):  # not in the main thread, where nobody can have changed them
                    _set_handler(number, handler)
        if self._folder is not None:
            with suppress(OSError):
                if os.getcwd() != self._folder:  # noqa: PTH109
                    os.chdir(self._folder)


class GuestError(Exception):
    """A guest raised something; the words say what, readably."""


def visited(function: Callable[..., Answer], *given: Any) -> Answer:
    """Call a guest.

    Args:
        function: What is called.
        given: Its arguments.

    Raises:
        GuestError: It raised anything whatever, but for what ends rtsim itself.
    """
    try:
        with Visit():
            return function(*given)
    except (KeyboardInterrupt, Terminated):
        raise  # from whoever runs rtsim
    except BaseException as error:
        raise GuestError(words_of(error)) from error


def words_of(error: BaseException) -> str:
    """An error for people, on one line, whatever its own ``str`` does."""
    try:
        said = readable(str(error))
    except Exception:  # noqa: BLE001 - a user's own code may raise anything
        said = ""
    return f"{type(error).__name__}: {said}" if said else type(error).__name__


def shown(value: object) -> str:
    """A value for people, on one line, whatever its own ``repr`` does."""
    try:
        return readable(repr(value))
    except Exception:  # noqa: BLE001 - a user's own code may raise anything
        return f"a {type(value).__name__}"


def readable(text: str) -> str:
    """Text from outside as terminals and reports take it: one line, nothing that steers them, not too long."""
    text = _CONTROL.sub(" ", text).strip()
    return text if len(text) <= LONGEST_WORDS else f"{text[: LONGEST_WORDS - 3]}..."
