"""Starts Rerun's viewer as its own process: on the loopback interface, bounded in memory, without usage statistics."""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
import tempfile
from importlib.util import find_spec
from pathlib import Path

from telemetry.view.options import ViewOptions

_temporary: list[Path] = []


class Viewer:
    """A viewer window, in a session of its own, so that Ctrl-C in the terminal does not close it."""

    def __init__(self, options: ViewOptions, source: str) -> None:
        """Start it.

        Args:
            options: Memory limit and command.
            source: Where the flight is to be had: a URL, or the path of a recording.

        Raises:
            OSError: There is no viewer to start.
        """
        environment = {**quiet_environment(), "RERUN_APP_ONLY": "true"}  # as the SDK does for its own viewers
        if options.viewer_command is not None:
            command = [*options.viewer_command, source]
        else:
            binary = _binary()
            # The configuration directory is rtsim's own: the user's choice for other uses of Rerun stays untouched.
            subprocess.run(
                [binary, "analytics", "disable"], env=environment, timeout=10, capture_output=True, check=False
            )
            way = ["--expect-data-soon", "--connect", source] if "://" in source else [source]
            command = [binary, "--bind", "127.0.0.1", "--port", "auto", "--memory-limit", options.memory_limit, *way]
        self._process = subprocess.Popen(
            command,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    @property
    def pid(self) -> int:
        """Its process number, and that of its process group."""
        return self._process.pid

    def ended(self) -> int | None:
        """Its exit code once it has ended, None while it runs."""
        return self._process.poll()

    def close(self) -> None:
        """Close the window."""
        self._process.terminate()
        try:
            self._process.wait(1.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait(1.0)


def quiet_environment() -> dict[str, str]:
    """An environment in which Rerun keeps its configuration, and its consent to statistics, apart from the user's."""
    return {**os.environ, "XDG_CONFIG_HOME": str(_configuration())}


def remove_temporary() -> None:
    """Leave no directory behind that was made because there was no place for one."""
    for directory in _temporary:
        shutil.rmtree(directory, ignore_errors=True)


@functools.cache
def _configuration() -> Path:
    """A directory of rtsim's own, or one for the time of this process."""
    try:
        cache = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
        directory = Path(cache) / "rtsim" / "viewer"
        directory.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # RuntimeError: there is no home
        directory = Path(tempfile.mkdtemp(prefix="rtsim-viewer-"))
        _temporary.append(directory)
    return directory


def _binary() -> str:
    """The viewer itself; the ``rerun`` command is a Python wrapper that would leave it behind when ended."""
    package = find_spec("rerun_cli")
    if package is None or not package.submodule_search_locations:
        raise FileNotFoundError("the package rerun_cli is missing")
    name = "rerun.exe" if os.name == "nt" else "rerun"
    binary = Path(next(iter(package.submodule_search_locations))) / name
    if not binary.is_file():
        raise FileNotFoundError(f"{binary} is missing")
    return str(binary)
