"""Helper processes: all of them are started here, in one way, and told of in the same words when they die.

A helper imports nothing from the current folder, whatever lies there; it has a session of its own, since Ctrl-C is for
the command, which then ends it in order; and it has few threads. It ends when the process that started it does, however
that one ended: most read the end of their stdin, the others call ``end_with_parent``. Nothing that it shares has a name
(memory, sockets, locked files are handed down), so nothing is left behind where all are killed at once. One that hangs
is told from one that works by its processor time (``Stillness``) and treated as one that died.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

ROOT = Path(__file__).resolve().parents[1]
"""The folder that holds this package and those above it."""
_KEPT = frozenset({"PYTHONPATH", "PYTHONHOME", "PYTHONPYCACHEPREFIX", "PYTHONDONTWRITEBYTECODE", "PYTHONHASHSEED"})
"""Of Python's own variables, those that a helper is given: the others are for the user's programs."""
_LONGEST_LOOK_S = 1.0
"""What one look at a helper adds to its stillness at most [s]: this process may have been stopped together with it."""
_hung: weakref.WeakKeyDictionary[subprocess.Popen[Any], float] = weakref.WeakKeyDictionary()
"""Helpers that were ended since they did nothing, and for how long they had [s]."""


def start_process(
    module: str,
    *arguments: str,
    handed: Sequence[int] = (),
    stdin: int | IO[bytes] | None = subprocess.PIPE,
    stdout: int | IO[bytes] | None = subprocess.PIPE,
    stderr: int | IO[bytes] | None = None,
    variables: Mapping[str, str] | None = None,
) -> subprocess.Popen[bytes]:
    """Start a module of this project as a helper.

    Args:
        module: Its full name.
        *arguments: Its command line.
        handed: File descriptors that it is given, under the same numbers.
        stdin: As ``subprocess`` has it.
        stdout: As ``subprocess`` has it.
        stderr: As ``subprocess`` has it.
        variables: More variables of its environment.

    Returns:
        The process.
    """
    return subprocess.Popen(
        [sys.executable, "-P", "-m", module, *arguments],
        env={**safe_environment(), **(variables or {})},
        stdin=stdin,
        stdout=stdout,
        stderr=stderr,
        pass_fds=tuple(handed),
        start_new_session=True,
    )


def safe_environment() -> dict[str, str]:
    """An environment that finds this very package, also in a source tree, and nothing in the current folder."""
    environment = {name: value for name, value in os.environ.items() if name in _KEPT or not name.startswith("PYTHON")}
    given = [entry for entry in environment.get("PYTHONPATH", "").split(os.pathsep) if entry]
    paths = [str(ROOT), *(str(Path(entry).absolute()) for entry in given if not is_here(entry))]
    environment["PYTHONPATH"] = os.pathsep.join(dict.fromkeys(paths))
    # A helper beside a 250 Hz loop must not spread numpy's or Arrow's thread pools over its cores.
    threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "ARROW_NUM_THREADS": "1"}
    return environment | threads | {"PYTHONSAFEPATH": "1"}


def is_here(entry: str) -> bool:
    """Whether an entry of a search path is the current folder.

    Args:
        entry: The entry; an empty one is.
    """
    try:
        return os.path.realpath(entry or os.curdir) == str(Path.cwd())
    except OSError:  # the current folder is gone
        return not entry


def end_with_parent() -> None:
    """End this helper as soon as its stdin ends, whatever it is doing."""

    def watch() -> None:
        try:
            while os.read(0, 1 << 12):
                pass
        finally:
            os._exit(1)

    threading.Thread(target=watch, name="parent", daemon=True).start()


def lower_priority() -> None:
    """Let the flight go first: nice 5 for the calling process."""
    if hasattr(os, "nice"):
        os.nice(5)


def ending(process: subprocess.Popen[Any]) -> str:
    """How a process ended, in words.

    Args:
        process: One that has ended.
    """
    code = process.poll()
    if process in _hung:
        return f"it did nothing for {_hung[process]:.0f} s and was ended"
    if code is not None and code < 0:
        try:
            return f"ended by {signal.Signals(-code).name}"
        except ValueError:
            return f"ended by signal {-code}"
    return f"exit code {code}"


def processor_ticks(number: int) -> int:
    """Processor time that a process and its ended children have used [ticks]; 0 where the system does not tell.

    Args:
        number: Its process id.
    """
    return _look_at(number)[1]


def _look_at(number: int) -> tuple[str, int]:
    """State of a process (one letter, as in ``ps``) and its processor time [ticks]."""
    try:
        words = Path(f"/proc/{number}/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
        return words[0], sum(map(int, words[11:15]))
    except (OSError, ValueError, IndexError):
        return "", 0


class Stillness:
    """How long a helper that has something to do has done nothing: it is stopped, or waits for what never comes."""

    def __init__(self, process: subprocess.Popen[Any]) -> None:
        """Begin to look.

        Args:
            process: The helper.
        """
        self._process, self._ticks = process, 0
        self.reset()

    def reset(self) -> None:
        """The helper showed that it lives, or has nothing to do."""
        self._still_s, self._looked = 0.0, time.monotonic()

    def end_after(self, limit_s: float) -> bool:
        """Look at the helper; end it where it has used no processor time for so long.

        Args:
            limit_s: How long it may do nothing [s].

        Returns:
            Whether it was ended: it is to be treated as one that died.
        """
        now = time.monotonic()
        state, ticks = _look_at(self._process.pid)
        if ticks != self._ticks or state in {"", "Z", "X", "R", "D"}:  # it has ended, or waits for a core or a disk
            self._ticks, self._still_s = ticks, 0.0
        else:
            self._still_s += min(now - self._looked, _LONGEST_LOOK_S)
        self._looked = now
        if self._still_s < limit_s:
            return False
        _hung[self._process] = self._still_s
        self._process.kill()
        return True


def end_process(process: subprocess.Popen[Any], *, patience_s: float = 0.0) -> None:
    """End a process that was asked to, or could not be asked, and close its pipes.

    Args:
        process: The process.
        patience_s: How long it may take to end by itself [s].
    """
    try:
        process.wait(patience_s)
    except subprocess.TimeoutExpired:
        process.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):  # one that waits for a dead disk cannot even be killed
            process.wait(0.5)
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with contextlib.suppress(OSError):  # nobody reads it any more
                stream.close()
