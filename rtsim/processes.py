"""Helper processes: all of them are started here, in one way, and told of in the same words when they die.

A helper imports nothing from the current folder, whatever lies there; it has a session of its own, since Ctrl-C is for
the command, which then ends it in order; and it has few threads. It ends when the process that started it does, however
that one ended: most read the end of their stdin, the others call ``end_with_parent``. Nothing that it shares has a name
(memory, sockets, locked files are handed down), so nothing is left behind where all are killed at once.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

ROOT = Path(__file__).resolve().parents[1]
"""The folder that holds this package and those above it."""
_KEPT = frozenset({"PYTHONPATH", "PYTHONHOME", "PYTHONPYCACHEPREFIX", "PYTHONDONTWRITEBYTECODE", "PYTHONHASHSEED"})
"""Of Python's own variables, those that a helper is given: the others are for the user's programs."""


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
    if code is not None and code < 0:
        try:
            return f"ended by {signal.Signals(-code).name}"
        except ValueError:
            return f"ended by signal {-code}"
    return f"exit code {code}"


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
