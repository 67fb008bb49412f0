"""The process that shows a flight: ``python -m telemetry.view.worker``, with its orders on stdin.

The first line is the configuration, every further one an event or the order to close; it ends when stdin does. It
answers on stdout with lines of JSON. Rows come through the ring. Nothing it does can hold up the flight.
"""

from __future__ import annotations

import json
import os
import select
import shutil
import signal
import socket
import time
import traceback
from pathlib import Path
from typing import Any

from rtsim.errors import RtsimError
from rtsim.processes import lower_priority
from telemetry.exchange.ring import RingReader
from telemetry.log.corridor_outline import CorridorOutline
from telemetry.view.options import ViewOptions
from telemetry.view.view import GIVEN_UP
from telemetry.view.viewer import Viewer, quiet_environment, remove_temporary

_SMALLEST_FREE_BYTES = 4 << 20
_VIEWER_START_S = 15.0


class Worker:
    """Streamer, viewer and orders of one flight."""

    def __init__(self, configuration: dict[str, Any]) -> None:
        """Start everything.

        Args:
            configuration: Options, ring, corridor, title and rate, as ``RerunView`` sends them.
        """
        from telemetry.view.streamer import Streamer

        options = dict(configuration["options"])
        options["record"] = Path(options["record"]) if options["record"] else None
        options["viewer_command"] = tuple(options["viewer_command"]) if options["viewer_command"] else None
        self._options = ViewOptions(**options)
        outline = configuration["corridor"]
        self._reader = RingReader(configuration["ring"])
        port = _free_port() if self._options.viewer else None
        self._streamer = Streamer(
            self._options,
            outline=CorridorOutline.from_dict(outline) if outline else None,
            title=configuration["title"],
            rate_hz=configuration["rate_hz"],
            port=port,
        )
        self._viewer: Viewer | None = None
        self._viewer_started = time.monotonic()
        self._next_check = 0.0
        self._orders = bytearray()
        if self._streamer.url is not None:
            self._start_viewer(self._streamer.url)
        _tell({"ready": True, "url": self._streamer.url})

    def run(self) -> None:
        """Show rows until told to close, or until the flight's process is gone."""
        period = 1.0 / self._options.pictures_per_second
        open_end = True
        while open_end:
            started = time.monotonic()
            # Orders are received before the rows are and followed after: an event stands behind the rows it follows.
            open_end = self._receive_orders()
            rows = self._reader.read()
            if len(rows):
                self._streamer.take(rows)
            if self._follow_orders():
                break
            if started >= self._next_check:
                self._next_check = started + 0.5
                self._check()
            time.sleep(max(0.001, started + period - time.monotonic()))
        watched = self._viewer is not None and self._viewer.ended() is None
        if self._streamer.close(linger_s=0.4 if watched else 0.0):
            why = "it could not be written to its end (is the disk full?)"
            _tell({"failure": f"{self._options.record}: the recording is incomplete because {why}."})
        if self._viewer is not None and self._options.close_viewer:
            self._viewer.close()

    def _receive_orders(self) -> bool:
        """Read stdin as far as it goes; False once its other end is closed."""
        while select.select([0], [], [], 0.0)[0]:
            received = os.read(0, 1 << 16)
            if not received:
                return False
            self._orders += received
        return True

    def _follow_orders(self) -> bool:
        """Do what was received; True once that includes closing."""
        while b"\n" in self._orders:
            line, self._orders = self._orders.split(b"\n", 1)
            order = json.loads(line)
            if "event" in order:
                self._streamer.event(order["event"], order["level"])
            if order.get("close"):
                return True
        return False

    def _start_viewer(self, url: str) -> None:
        try:
            self._viewer = Viewer(self._options, url)
        except (OSError, ValueError) as failure:
            _tell({"message": f"The viewer cannot be started ({failure}); the flight goes on without it."})
        else:
            _tell({"viewer": self._viewer.pid})

    def _check(self) -> None:
        """Twice a second: is the viewer still there, is there room for the recording."""
        if self._viewer is not None:
            code = self._viewer.ended()
            if code is not None:
                self._viewer = None
                early = time.monotonic() - self._viewer_started < _VIEWER_START_S and code != 0
                words = f"could not show its window (exit code {code})" if early else "was closed"
                _tell({"viewer": None, "message": f"The viewer {words}; the flight goes on without it."})
        record = self._options.record
        if record is not None and shutil.disk_usage(record.resolve().parent).free < _SMALLEST_FREE_BYTES:
            _tell({"failure": f"{record}: the recording is incomplete because no space is left on the device."})


def main() -> int:
    """Serve one flight."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    lower_priority()
    os.environ.update(quiet_environment())
    configuration = json.loads(_first_line())
    try:
        worker = Worker(configuration)
        worker.run()
    except (ImportError, OSError, RuntimeError, RtsimError) as failure:
        _tell({"message": f"The view ended ({failure}); the flight goes on without it."})
        return GIVEN_UP
    return 0


def _first_line() -> bytes:
    """The first line of stdin, and not a byte more."""
    line = bytearray()
    while not line.endswith(b"\n"):
        byte = os.read(0, 1)
        if not byte:
            break
        line += byte
    return bytes(line)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _tell(message: dict[str, Any]) -> None:
    """Answer to the flight's process, which may be gone."""
    try:
        os.write(1, json.dumps(message).encode() + b"\n")
    except OSError:
        return


if __name__ == "__main__":
    try:
        CODE = main()
    except BaseException:  # noqa: BLE001  # the flight reads the last line of the traceback
        traceback.print_exc()
        CODE = 1
    remove_temporary()
    # Rerun's own shutdown can wait for a viewer that does not answer; everything is finished here.
    os._exit(CODE)
