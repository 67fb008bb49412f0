"""The flight's end of the Rerun view: rows into a ring, orders into a pipe, and a watch on the process behind them.

Rerun itself runs in ``telemetry.view.worker``. A view that cannot start, whose viewer is missing, closed or frozen,
or that crashes, is told in one sentence; the flight neither waits for it nor ends with it.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

from rtsim.arrays import FloatArray
from rtsim.errors import OutputError
from rtsim.outside import status_of
from rtsim.processes import end_process, ending, processor_ticks, start_process
from telemetry.exchange.ring import Ring
from telemetry.log.corridor_outline import CorridorOutline
from telemetry.view.options import ViewOptions
from telemetry.view.recording import claim, claim_next, discard_empty, partial_name

GIVEN_UP = 3
"""Exit code of a worker that has told why it cannot go on: starting it again would not help."""
START_TIMEOUT_S = 30.0
"""A view that is not ready after this long is given up [s]."""

_ROWS_PER_WATCH = 64
_LONGEST_THOUGHT_S = 120.0
"""How long a view that is to close may use the processor without anything to show for it [s]."""


class RerunView:
    """Shows one flight."""

    def __init__(
        self,
        options: ViewOptions,
        *,
        corridor: CorridorOutline | None = None,
        title: str = "rtsim",
        rate_hz: float = 250.0,
        on_message: Callable[[str], None] | None = None,
    ) -> None:
        """Start the view; it becomes ready by itself, see ``wait_ready``.

        Args:
            options: What to show and record.
            corridor: Boundaries to draw.
            title: What the recording is called.
            rate_hz: Frames per second of flight.
            on_message: Called with one sentence whenever something about the view must be told.

        Raises:
            InputError: Something that is not to be replaced is where the recording is to be.
            OutputError: The recording cannot be written where it was asked for.
        """
        self.failure: OutputError | None = None
        """Why the recording is incomplete, if it is."""
        self.messages: list[str] = []
        """Every sentence told so far."""
        self._options, self._on_message = options, on_message
        self._configuration = {
            "corridor": corridor.to_dict() if corridor else None,
            "title": title,
            "rate_hz": rate_hz,
        }
        self._claims = [claim(options.record)] if options.record is not None else []
        self._record = options.record
        self._began_unix_s = time.time()
        self._ring = Ring()
        self._pushes = 0
        self._starts = 0
        self._closed = False
        self._process: subprocess.Popen[bytes] | None = None
        self._stderr: Any = None
        self._ready, self._answers_left = False, b""
        self._viewer_pid: int | None = None
        self._beat, self._beat_time = 0, time.monotonic()
        self._start()

    @property
    def dropped(self) -> int:
        """Rows so far that the view was too slow to take."""
        return self._ring.dropped

    @property
    def backlog(self) -> int:
        """Rows pushed that the view has not taken yet; a flight at full speed waits while there are many."""
        return self._ring.written - self._ring.consumed

    @property
    def alive(self) -> bool:
        """Whether something is showing or recording the flight."""
        return self._process is not None

    @property
    def ready(self) -> bool:
        """Whether the view has finished its preparations."""
        self._read_answers()
        return self._ready

    def wait_ready(self, timeout_s: float) -> bool:
        """Give the view time to prepare before the first frame, so that its start does not disturb the loop.

        Args:
            timeout_s: Longest wait [s].

        Returns:
            Whether it is ready; the flight can begin in any case.
        """
        deadline = time.monotonic() + timeout_s
        while not self.ready and self.alive and time.monotonic() < deadline:
            time.sleep(0.01)
            self.watch()
        return self._ready

    def push(self, row: FloatArray, timing: FloatArray) -> None:
        """Show one row; never waits."""
        self._ring.push(row, timing)
        self._pushes += 1
        if self._pushes % _ROWS_PER_WATCH == 0:
            self.watch()

    def event(self, text: str, level: str = "info") -> None:
        """Add a line to the event log; never waits.

        Args:
            text: What happened.
            level: ``info``, ``caution``, ``warning`` or ``exceedance``.
        """
        self._order({"event": text, "level": level})

    def watch(self) -> None:
        """See whether the view still lives, and end it where it does not; ``push`` does so four times a second."""
        if self._process is None:
            return
        self._read_answers()
        now = time.monotonic()
        beat = self._ring.heartbeat
        if beat != self._beat:
            self._beat, self._beat_time = beat, now
        patience = self._options.stall_timeout_s if self._ready else START_TIMEOUT_S
        code = self._process.poll()
        if code == GIVEN_UP:
            self._end_process()
            self._note_incomplete("the view could not go on")
        elif code is not None:
            self._recover(f"The view ended unexpectedly ({ending(self._process)}{self._last_words()})")
        elif now - self._beat_time > patience:
            self._recover(f"The view did not move for {patience:.0f} s" if self._ready else "The view did not start")

    def close(self, timeout_s: float = 20.0) -> None:
        """Finish recording and view, however long that takes while it gets on.

        Args:
            timeout_s: After this without any sign of progress the view is ended as it is [s].
        """
        if self._closed:
            return
        self._closed = True
        try:
            if self._process is not None:
                self._finish_process(self._process, timeout_s)
        finally:
            if self._process is not None:
                self._end_process()
            self._ring.close()
            for held in self._claims:
                held.close()
        if self._options.record is not None:
            discard_empty(self._options.record)
        if self._record is not None:
            discard_empty(self._record)
            if self.failure is not None:
                self.failure = OutputError(f"{str(self.failure).rstrip('.')}; {self._what_there_is()}.")

    def _finish_process(self, process: subprocess.Popen[bytes], timeout_s: float) -> None:
        """Ask the view to end and wait for that; one that gets nowhere is ended."""
        self._order({"close": True})
        with contextlib.suppress(OSError):
            process.stdin.close()  # type: ignore[union-attr]  # a pipe
        signs, ticks = self._signs_of_progress(), 0
        moved = wrote = time.monotonic()
        while process.poll() is None and (now := time.monotonic()) < moved + timeout_s:
            self._read_answers()
            if (newest := self._signs_of_progress()) != signs:
                signs, moved, wrote = newest, now, now
            elif (used := processor_ticks(process.pid)) != ticks and now < wrote + _LONGEST_THOUGHT_S:
                ticks, moved = used, now
            time.sleep(0.005)
        self._read_answers()
        if process.poll() is None:
            self._end_process()
            self._tell(f"The view did not get on with closing for {timeout_s:.0f} s and was ended.")
            self._note_incomplete("the view did not close in time")
        else:
            if process.returncode not in {0, GIVEN_UP}:
                self._tell(f"The view ended unexpectedly ({ending(process)}{self._last_words()}).")
            if process.returncode:
                self._note_incomplete("the view ended in flight")
            end_process(process)
            self._stderr.close()
            self._process = None

    def _signs_of_progress(self) -> tuple[object, ...]:
        """What changes while the view works: rows taken, bytes written, files finished."""
        places = (self._record, partial_name(self._record)) if self._record is not None else ()
        sizes = [there.st_size if (there := status_of(place)) else -1 for place in places]
        return (self._ring.consumed, self._ring.heartbeat, *sizes)

    def _start(self) -> None:
        """Start the worker and send it the configuration."""
        self._starts += 1
        self._ready, self._answers_left, self._viewer_pid = False, b"", None
        self._beat, self._beat_time = self._ring.heartbeat, time.monotonic()
        options = self._options
        if self._starts > 1 and options.record is not None:
            self._record, held = claim_next(options.record, "-again", self._starts)
            self._claims.append(held)
            options = replace(options, record=self._record)
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115  # as long as the process
        handed = [self._ring.descriptor, *(held.fileno() for held in self._claims)]  # claims last as long as the worker
        process = start_process("telemetry.view.worker", handed=handed, stderr=self._stderr)
        self._process = process
        assert process.stdin is not None
        assert process.stdout is not None
        os.set_blocking(process.stdin.fileno(), False)
        os.set_blocking(process.stdout.fileno(), False)
        values = asdict(options) | {"record": str(options.record) if options.record else None}
        self._order({"options": values, "ring": self._ring.descriptor, **self._configuration})

    def _order(self, order: dict[str, Any]) -> None:
        """Send one line; a pipe that is full because nobody reads it loses it."""
        if self._process is None:
            return
        with contextlib.suppress(OSError):
            os.write(self._process.stdin.fileno(), json.dumps(order).encode() + b"\n")  # type: ignore[union-attr]

    def _read_answers(self) -> None:
        if self._process is None or self._process.stdout is None:
            return
        try:
            data = os.read(self._process.stdout.fileno(), 1 << 16)
        except OSError:
            return
        self._answers_left += data
        while b"\n" in self._answers_left:
            line, self._answers_left = self._answers_left.split(b"\n", 1)
            try:
                answer = json.loads(line)
            except ValueError:
                continue  # something Rerun printed
            if isinstance(answer, dict):
                self._take_answer(answer)

    def _take_answer(self, answer: dict[str, Any]) -> None:
        if answer.get("ready"):
            self._ready, self._beat_time = True, time.monotonic()
        if "viewer" in answer:
            self._viewer_pid = answer["viewer"]
        if "message" in answer:
            self._tell(answer["message"])
        if "failure" in answer and self.failure is None:
            self.failure = OutputError(answer["failure"])
            self._tell(answer["failure"])

    def _recover(self, what: str) -> None:
        """End a view that is stuck or gone; start another as often as the options allow."""
        self._end_process()
        self._note_incomplete("the view stopped in flight")
        if self._starts <= self._options.restarts:
            self._ring.skip_unread()
            self._start()
            self._tell(f"{what}; it was started again. The flight goes on.")
        else:
            self._tell(f"{what} and was given up. The flight goes on without it.")

    def _note_incomplete(self, why: str) -> None:
        if self._options.record is not None and self.failure is None:
            self.failure = OutputError(f"{self._options.record}: the recording is incomplete because {why}.")

    def _what_there_is(self) -> str:
        """Every file of a recording that failed, in words."""
        record = self._options.record
        assert record is not None
        written = [
            place.name
            for place in record.parent.glob("*.rrd")
            if place.name.startswith((f"{record.stem}.", f"{record.stem}-"))
            and (there := status_of(place))
            and there.st_size
            and there.st_mtime > self._began_unix_s - 1.0  # a file system may keep whole seconds
        ]
        return f"what was recorded is in {', '.join(sorted(written))}" if written else "nothing was written"

    def _end_process(self) -> None:
        """Kill worker and viewer; neither could be asked."""
        process = self._process
        assert process is not None
        end_process(process)
        if self._viewer_pid is not None:
            with contextlib.suppress(OSError):
                os.killpg(self._viewer_pid, signal.SIGKILL)
        self._stderr.close()
        self._process = None

    def _last_words(self) -> str:
        """The last line the worker wrote to its stderr, for a message."""
        self._stderr.seek(0)
        lines = [line.strip() for line in self._stderr.read().decode(errors="replace").splitlines() if line.strip()]
        return f": {lines[-1][:200]}" if lines else ""

    def _tell(self, message: str) -> None:
        self.messages.append(message)
        if self._on_message is not None:
            self._on_message(message)
