"""The flight's end: starts the MAVLink process, pushes rows, reads sticks and requests, says what acts."""

from __future__ import annotations

import atexit
import contextlib
import dataclasses
import math
import subprocess
import time
from array import array
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.command import StickInput
from rtsim.errors import OutputError
from rtsim.processes import end_process, ending, start_process
from telemetry.exchange.ring import Ring
from telemetry.mavlink.config import MavlinkConfig, read_signing_key
from telemetry.mavlink.exchange import (
    ACCEPTED,
    ALIVE,
    DISCARDED,
    FAULTS,
    HEARTBEAT,
    PEERS,
    PORT,
    READY,
    RECEIVED,
    SENT,
    STOP,
    Exchange,
    Feedback,
    Request,
)

RING_ROWS = 256
"""Rows kept for the MAVLink process: one second at 250 Hz."""
_WATCH_PERIOD_S = 0.5
_MOST_RESTARTS = 3
_CLOSE_PATIENCE_S = 1.5
_HANG_S = 5.0


@dataclass(frozen=True, slots=True)
class InputAges:
    """How old stick values were in the frame that first used them: from their arrival at this machine."""

    count: int
    """Stick values used."""
    p50_ms: float
    """Median [ms]."""
    p99_ms: float
    """99th percentile [ms]."""
    max_ms: float
    """Largest [ms]."""


class MavlinkInput:
    """Sticks and requests as the flight sees them; reading costs a few microseconds and never waits."""

    def __init__(self, exchange: Exchange) -> None:
        """Connect.

        Args:
            exchange: Shared memory to the MAVLink process.
        """
        self._exchange = exchange
        self._version = -1
        self._sticks = StickInput()
        self._age_ns = array("q")

    def read(self) -> StickInput:
        """The newest stick input; one with ``sequence`` 0 before the first."""
        version = self._exchange.stick_version
        if version != self._version:
            sticks = self._exchange.read_sticks()
            if sticks is not None:
                if sticks.sequence != self._sticks.sequence:
                    self._age_ns.append(time.monotonic_ns() - sticks.received_ns)
                self._sticks, self._version = sticks, version
        return self._sticks

    def age(self) -> float:
        """Time since the newest stick input arrived at this machine [s]; infinite before the first."""
        received = self._sticks.received_ns
        return (time.monotonic_ns() - received) * 1e-9 if received else math.inf

    @property
    def first_use_age(self) -> float:
        """Age the newest stick input had in the frame that first read it [s]; 0 before the first."""
        return self._age_ns[-1] * 1e-9 if self._age_ns else 0.0

    def requests(self) -> list[Request]:
        """What ground stations asked since the last call, in order."""
        return self._exchange.take_requests()

    def ages(self) -> InputAges | None:
        """Summary of all stick inputs used so far; None where there were none."""
        if not self._age_ns:
            return None
        milliseconds = np.asarray(self._age_ns, dtype=np.float64) * 1e-6
        p50, p99 = np.percentile(milliseconds, (50.0, 99.0))
        return InputAges(len(milliseconds), float(p50), float(p99), float(milliseconds.max()))


class MavlinkLink:
    """The whole connection of one flight to its ground stations."""

    def __init__(self, config: MavlinkConfig) -> None:
        """Start the MAVLink process; it gets ready in the background.

        Args:
            config: Settings of the vehicle.

        Raises:
            InputError: The signing key is wrong.
        """
        self.config = config
        if config.signing_key_file:
            read_signing_key(config.signing_key_file)  # a wrong key is told here, not by a process in the background
        self.failure: OutputError | None = None
        """Why there is no MAVLink any more, once that is so; the flight itself goes on."""
        self.on_note: Callable[[str], object] | None = None
        """Told what the MAVLink process finds worth an event of the flight."""
        self.restarts = 0
        """How often the process had to be started again."""
        self._ring = Ring(RING_ROWS)
        self._exchange = Exchange()
        self.input = MavlinkInput(self._exchange)
        """Sticks and requests."""
        self._closed = False
        self._watched = self._life_sign_at = time.monotonic()
        self._life_sign = 0
        self._process = self._start()
        atexit.register(self.close)

    @property
    def port(self) -> int:
        """UDP port the vehicle receives on; 0 until it is ready."""
        return 0 if self._closed else int(self._exchange.header[PORT])

    @property
    def ready(self) -> bool:
        """Whether the vehicle is on the air."""
        return not self._closed and bool(self._exchange.header[READY])

    def wait_ready(self, timeout_s: float = 5.0) -> bool:
        """Wait until the vehicle is on the air.

        Args:
            timeout_s: Longest wait [s].

        Returns:
            Whether it is.

        Raises:
            OutputError: It cannot be, and why.
        """
        deadline = time.monotonic() + timeout_s
        while not self.ready and time.monotonic() < deadline:
            if self._process.poll() is not None:
                self._fail()
            if self.failure is not None:
                raise self.failure
            time.sleep(0.005)
        return self.ready

    def push(self, row: FloatArray, timing: FloatArray) -> None:
        """Show a frame; about a microsecond, never waits."""
        self._ring.push(row, timing)

    def report(self, feedback: Feedback) -> None:
        """Say what the sticks do in this frame; about two microseconds, never waits.

        Args:
            feedback: What acts.
        """
        self._exchange.write_feedback(feedback)
        self._exchange.header[ALIVE] += 1

    def say(self, text: str, *, severity: int = 6) -> None:
        """Show a text at every ground station.

        Args:
            text: At most 50 ASCII characters are shown.
            severity: MAV_SEVERITY: 2 critical, 4 warning, 6 information.
        """
        self._exchange.put_text(severity, text)

    def watch(self) -> None:
        """Look after the process, at most twice a second; one that died or hangs is started again."""
        now = time.monotonic()
        if not self._closed:
            self._exchange.header[ALIVE] += 1
        if self._closed or self.failure is not None or now - self._watched < _WATCH_PERIOD_S:
            return
        self._watched = now
        for note in self._exchange.take_notes():
            self._note(note)
        life_sign = int(self._exchange.header[HEARTBEAT])
        if life_sign != self._life_sign or not self._exchange.header[READY]:
            self._life_sign, self._life_sign_at = life_sign, now
        if self._process.poll() is not None:
            self._replace(f"ended unexpectedly ({ending(self._process)})")
        elif now - self._life_sign_at > _HANG_S:
            self._process.kill()
            self._replace(f"did not move for {_HANG_S:.0f} s")

    def _replace(self, what: str) -> None:
        """Start another process, at the same port and with all that the last one knew, and say so."""
        if self.restarts >= _MOST_RESTARTS:
            self._fail(f"its process {what} for the {self.restarts + 1}th time; there is no MAVLink any more.")
            return
        end_process(self._process, patience_s=1.0)
        self.restarts += 1
        self._life_sign_at = time.monotonic()
        self._exchange.header[READY] = 0
        self._ring.skip_unread()
        self._process = self._start()
        self._note(f"The MAVLink process {what}; another goes on at port {self.port}")
        self.say("MAVLink process ended; another goes on", severity=4)

    def _note(self, text: str) -> None:
        if self.on_note is not None:
            self.on_note(text)

    def rest(self) -> None:
        """Say that nothing flies any more, so that nobody misses frames."""
        if not self._closed:
            self._exchange.header[ALIVE] = 0

    def counters(self) -> dict[str, int]:
        """What passed so far: ground stations, datagrams received and discarded, inputs used, messages sent."""
        if self._closed:
            return {}
        header = self._exchange.header
        names = {
            "peers": PEERS,
            "received": RECEIVED,
            "discarded": DISCARDED,
            "inputs": ACCEPTED,
            "sent": SENT,
            "faults": FAULTS,
        }
        return {name: int(header[word]) for name, word in names.items()} | {"restarts": self.restarts}

    def close(self) -> None:
        """Say good-bye to the ground stations and end the process; takes less than two seconds."""
        if self._closed:
            return
        self._exchange.header[STOP] = 1
        end_process(self._process, patience_s=_CLOSE_PATIENCE_S)
        self._closed = True
        atexit.unregister(self.close)
        self._ring.close()
        self._exchange.close()

    def _start(self) -> subprocess.Popen[bytes]:
        shared = (self._ring.descriptor, self._exchange.descriptor)
        process = start_process("telemetry.mavlink.vehicle_process", *map(str, shared), handed=shared)
        assert process.stdin is not None
        # The port that stations know stays the vehicle's.
        config = dataclasses.replace(self.config, bind_port=self.port or self.config.bind_port)
        with contextlib.suppress(OSError):  # a process that died at once shows in `watch`
            process.stdin.write(config.to_json().encode() + b"\n")
            process.stdin.flush()
        return process

    def _fail(self, otherwise: str = "its process ended unexpectedly.") -> None:
        """Keep the reason why there is no vehicle, and say it.

        Args:
            otherwise: The reason, where the process has not told one.
        """
        told = b""
        if self._process.stdout is not None and self._process.poll() is not None:
            told = self._process.stdout.read()
        self.failure = OutputError(f"MAVLink: {told.decode(errors='replace').strip() or otherwise}")
        self._note(str(self.failure))
