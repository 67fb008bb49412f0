"""The flight's end of the window: starts the process that sends to FlightGear, and pushes rows into its ring."""

from __future__ import annotations

import atexit
import contextlib
import subprocess
from collections.abc import Callable

from rtsim.arrays import FloatArray
from rtsim.processes import end_process, ending, start_process
from telemetry.exchange.ring import Ring
from telemetry.flightgear.config import WindowConfig

RING_ROWS = 256
"""Rows kept for the process: a second at 250 Hz; it shows the newest only."""
MOST_RESTARTS = 3
"""How often a process that died is started again."""
_ROWS_PER_WATCH = 64
_CLOSE_PATIENCE_S = 1.0


class FlightGearLink:
    """Shows one flight in FlightGear; nothing of it waits, and no failure of it reaches the flight."""

    def __init__(self, config: WindowConfig, *, on_message: Callable[[str], None] | None = None) -> None:
        """Start the process.

        Args:
            config: Where to, and where the flight began.
            on_message: Told in one sentence what became of the process.
        """
        self.config = config
        self.restarts = 0
        """How often the process had to be started again."""
        self._on_message = on_message
        self._ring = Ring(RING_ROWS)
        self._pushes = 0
        self._process: subprocess.Popen[bytes] | None = self._start()
        atexit.register(self.close)

    @property
    def process_id(self) -> int | None:
        """Number of the process that sends; None where there is none any more."""
        return self._process.pid if self._process is not None else None

    def push(self, row: FloatArray, timing: FloatArray) -> None:
        """Show one row; about a microsecond, never waits."""
        self._ring.push(row, timing)
        self._pushes += 1
        if self._pushes % _ROWS_PER_WATCH == 0:
            self.watch()

    def watch(self) -> None:
        """See whether the process lives, and start another where it does not; ``push`` does so four times a second."""
        process = self._process
        if process is None or process.poll() is None:
            return
        words = f"The process that sends to FlightGear ended unexpectedly ({ending(process)})"
        end_process(process)
        if self.restarts < MOST_RESTARTS:
            self.restarts += 1
            self._ring.skip_unread()
            self._process = self._start()
            self._tell(f"{words}; another goes on.")
        else:
            self._process = None
            self._tell(f"{words} for the {self.restarts + 1}th time; FlightGear stands still, the flight goes on.")

    def close(self) -> None:
        """Let the process send the last row and end."""
        atexit.unregister(self.close)
        process, self._process = self._process, None
        if process is not None:
            with contextlib.suppress(OSError):
                process.stdin.close()  # type: ignore[union-attr]  # a pipe
            end_process(process, patience_s=_CLOSE_PATIENCE_S)
        self._ring.close()

    def _start(self) -> subprocess.Popen[bytes]:
        descriptor = self._ring.descriptor
        process = start_process(
            "telemetry.flightgear.sender_process", str(descriptor), handed=(descriptor,), stdout=subprocess.DEVNULL
        )
        with contextlib.suppress(OSError):  # a process that died at once shows in `watch`
            process.stdin.write(self.config.to_json().encode() + b"\n")  # type: ignore[union-attr]  # a pipe
            process.stdin.flush()  # type: ignore[union-attr]
        return process

    def _tell(self, message: str) -> None:
        if self._on_message is not None:
            self._on_message(message)
