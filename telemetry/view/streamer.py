"""From rows to a Rerun recording: poses and instruments thirty times a second, curves ten times."""

from __future__ import annotations

import contextlib
import math
import time
import warnings
from datetime import datetime
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import rerun as rr

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN, SIGNAL_COUNT
from telemetry.log.corridor_outline import CorridorOutline
from telemetry.view.blueprint import blueprint
from telemetry.view.corridor import CorridorPlot
from telemetry.view.ground_map import GroundMap
from telemetry.view.instruments import Instruments
from telemetry.view.options import ViewOptions
from telemetry.view.plots import Plots, history_of, set_row_time
from telemetry.view.recording import claim_next, partial_name
from telemetry.view.scene import Scene

APPLICATION = "rtsim"
"""Application id of every recording."""
PLOT_PERIOD_S = 0.2
"""Curves are sent this often: a batch costs as much as a point [s]."""
FLUSH_PERIOD_S = 0.03
"""What is logged reaches the viewer after at most this long [s]."""
UNWATCHED_PERIOD_S = 1.0
"""Both periods where nobody watches: every chunk costs more than a kilobyte in the file [s]."""
SPLIT_S = 600.0
"""A recording that nobody watches goes on in another file after this long: Rerun takes memory for all of one [s]."""

_SERVER_MEMORY = "256MiB"


def is_whole(recording: Path) -> bool:
    """Whether a finished recording was written to its end; Rerun itself does not tell of a disk that is full.

    Args:
        recording: The file.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a file without its closing index is only warned of
        try:
            return bool(rr.chunk.RrdReader(str(recording)).recordings())
        except (OSError, RuntimeError, Warning):
            return False


class Streamer:
    """Keeps one recording per run of the flight; a reset begins the next, and so does the end of a long one."""

    def __init__(
        self, options: ViewOptions, *, outline: CorridorOutline | None, title: str, rate_hz: float, port: int | None
    ) -> None:
        """Open the first recording.

        Args:
            options: What to record and how often to draw.
            outline: The corridor in force.
            title: What the recording is called.
            rate_hz: Frames per second of flight.
            port: Port on 127.0.0.1 where viewers can have the flight; None for none.
        """
        self._options, self._outline, self._title, self._port = options, outline, title, port
        self._stride = max(1, round(rate_hz / options.plot_rate_hz))
        self._host: Any = None
        self._run = 0
        self._opened = 0.0
        self._files: list[tuple[Path, Path]] = []
        self._broken: list[Path] = []
        self._claims: list[BinaryIO] = []
        self._last_time = -math.inf
        self._pending: list[FloatArray] = []
        self._next_plots = 0.0
        self._recording: Any = None
        self._open()

    @property
    def url(self) -> str | None:
        """Where a viewer connects."""
        return None if self._port is None else f"rerun+http://127.0.0.1:{self._port}/proxy"

    @property
    def recording(self) -> Any:
        """The ``rerun.RecordingStream`` of the present run."""
        return self._recording

    def take(self, rows: FloatArray) -> None:
        """Show new rows.

        Args:
            rows: Full rows, oldest first.
        """
        backwards = np.flatnonzero(np.diff(rows[:, COLUMN.time_s], prepend=self._last_time) < 0.0)
        for piece in np.split(rows, backwards):
            if not len(piece):
                continue
            started = self._last_time > -math.inf
            full = self._port is None and started and time.monotonic() - self._opened > SPLIT_S
            if full or piece[0, COLUMN.time_s] < self._last_time:
                self._end_run()
                self._open()
            first = self._last_time == -math.inf
            self._last_time = float(piece[-1, COLUMN.time_s])
            self._plots.update_states(piece)
            self._pending.append(piece[piece[:, COLUMN.frame] % self._stride == 0])
            if first:
                self._draw(piece[0])  # so that the very beginning can be looked at, too
            self._draw(piece[-1])
        if time.monotonic() >= self._next_plots:
            self._next_plots = time.monotonic() + (UNWATCHED_PERIOD_S if self._port is None else PLOT_PERIOD_S)
            self._send_plots()

    def event(self, text: str, level: str) -> None:
        """Add a line to the event log at the current time of the flight.

        Args:
            text: What happened.
            level: ``info``, ``caution``, ``warning`` or ``exceedance``.
        """
        if self._last_time == -math.inf:
            self._recording.set_time("sim_time", duration=0.0)
        self._plots.event(text, level)

    def flush(self) -> None:
        """Send everything that was taken."""
        self._send_plots()
        self._recording.flush(timeout_sec=10.0)

    def close(self, *, linger_s: float = 0.0) -> list[Path]:
        """Send what is left and finish the files.

        Args:
            linger_s: How long to go on serving a viewer, so that it gets the last rows [s].

        Returns:
            Files that are not whole and therefore keep their partial name.
        """
        self._end_run()
        if linger_s > 0.0:
            time.sleep(linger_s)
        if self._host is not None:
            self._host.disconnect()
        self._finish_files()
        return self._broken

    def _open(self) -> None:
        """Begin a recording; the first also hosts the server through which all of them reach the viewer."""
        self._run += 1
        self._opened = time.monotonic()
        suffix = "" if self._run == 1 else f"-{self._run}"
        stamp = datetime.now().astimezone().strftime("%Y%m%d-%H%M%S")
        recording = rr.RecordingStream(
            APPLICATION,
            recording_id=f"run-{stamp}{suffix}",
            batcher_config=rr.ChunkBatcherConfig(
                flush_tick=UNWATCHED_PERIOD_S if self._port is None else FLUSH_PERIOD_S
            ),
        )
        sinks: list[Any] = []
        if self._port is not None and self._host is None:
            self._host = recording
            sinks.append(rr.GrpcServerSink("127.0.0.1", self._port, server_memory_limit=_SERVER_MEMORY))
        elif self._port is not None:
            sinks.append(rr.GrpcSink(self.url))
        if self._options.record is not None:
            final = self._options.record
            if suffix:  # the first is claimed by the flight
                final, claim = claim_next(final, "-", self._run)
                self._claims.append(claim)
            partial = partial_name(final)
            self._files.append((partial, final))
            sinks.append(rr.FileSink(str(partial)))
        recording.set_sinks(*sinks)
        recording.send_recording_name(self._title + (f", run {self._run}" if suffix else ""))
        self._recording = recording
        recording.set_time("sim_time", duration=0.0)
        self._scene = Scene(recording)
        self._corridor = CorridorPlot(recording, self._outline)
        self._instruments = Instruments(recording)
        self._map = GroundMap(recording)
        self._plots = Plots(recording)
        recording.send_blueprint(blueprint(self._options.layout, replay=self._options.replay))
        # What is seen until the first row comes, which overwrites it: a helicopter at rest.
        waiting = np.zeros(SIGNAL_COUNT)
        waiting[COLUMN.nacelle_deg], waiting[COLUMN.altitude_m] = 90.0, 100.0
        self._scene.update(waiting, trail=False)
        self._instruments.update(waiting)
        self._last_time = -math.inf

    def _draw(self, row: FloatArray) -> None:
        """Pose, instruments, corridor and map at one row."""
        signals = history_of(row)
        set_row_time(self._recording, signals)
        self._scene.update(signals)
        self._instruments.update(signals)
        self._corridor.update(signals)
        self._map.update(signals)

    def _end_run(self) -> None:
        self._send_plots()
        with contextlib.suppress(RuntimeError):  # a viewer that does not take it: what is written is written
            self._recording.flush(timeout_sec=1.0)
        if self._recording is not self._host:
            self._recording.disconnect()
            if self._host is None:
                self._finish_files()

    def _finish_files(self) -> None:
        """Give files that are whole their names."""
        for partial, final in self._files:
            if is_whole(partial):
                partial.replace(final)
            else:
                self._broken.append(partial)
        self._files.clear()
        for held in self._claims:
            held.close()
        self._claims.clear()

    def _send_plots(self) -> None:
        if self._pending:
            rows = np.concatenate(self._pending)
            self._pending = []
            self._plots.send_rows(rows)
