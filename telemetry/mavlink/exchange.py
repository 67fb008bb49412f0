"""Shared memory between the flight and its MAVLink process: sticks and requests in, feedback and texts out.

Nothing here waits. A value that is written whole and read often (sticks, feedback) lives in a sequence lock: the
writer makes the count odd, writes, makes it even; a reader that saw the count change keeps what it had and looks again
in the next frame. Things that happen once (requests, texts) go through a queue with one writer and one reader.
"""

from __future__ import annotations

import atexit
import struct
import threading
from multiprocessing.shared_memory import SharedMemory
from typing import NamedTuple, cast

from rtsim.command import StickInput
from rtsim.errors import InputError
from telemetry.ring import _attach_untracked

_MAGIC = 0x5254_5349_4D4D_4156
_WORD = 8
_HEADER_WORDS = 32
_STICK_COUNT = 12
_REQUEST = struct.Struct("<16s24sd")
_REQUEST_SLOTS = 256
_TEXT = struct.Struct("<B55s")
_TEXT_SLOTS = 64

MAGIC, STOP, READY, PORT, HEARTBEAT, PEERS, RECEIVED, DISCARDED, ACCEPTED, SENT, ARMED, FAULTS = range(12)
"""Words of the header: layout check, asked to stop, taking part, own UDP port, life sign, ground stations heard,
datagrams received, datagrams discarded (budget, whitelist, not MAVLink), stick inputs accepted, messages sent, armed,
faults caught."""


class Request(NamedTuple):
    """One discrete thing a ground station asked of the flight."""

    kind: str
    """``reset``, ``pilot``, ``aid``, ``nacelle``, ``transition``, ``parameter``, ``freeze``."""
    name: str = ""
    """Who shall fly, which aid, which parameter."""
    value: float = 0.0
    """On (1), off (0) or toggle (2) for an aid; an angle [rad] for ``nacelle``; 3 helicopter or 4 airplane for
    ``transition``; the value of a parameter."""


class Feedback(NamedTuple):
    """What the flight tells its MAVLink process about the sticks, once per frame."""

    stick: float = 0.0
    """Longitudinal stick that acts, after dead band, expo, blending and failsafe, -1 to 1."""
    lever: float = 0.0
    """Power lever that acts, 0 to 1."""
    lateral: float = 0.0
    """Lateral stick as shown, -1 to 1."""
    yaw: float = 0.0
    """Pedals as shown, -1 to 1."""
    nacelle_switch: float = 0.0
    """Nacelle switch that acts: -1, 0, 1."""
    nacelle_command: float = 0.0
    """Command angle of the conversion actuator [rad]."""
    input_state: float = 0.0
    """0 nobody has flown yet, 1 sticks live, 2 sticks lost."""
    age: float = 0.0
    """Age of the newest stick value in the frame that first used it [s]."""
    aids: float = 0.0
    """Pilot aids that are on, one bit each in the order of ``MavlinkConfig.aids``."""
    transition: float = 0.0
    """Transition under way: 0 none, 3 to helicopter, 4 to airplane."""
    ended: float = 0.0
    """1 once the flight is over."""


# Offsets in bytes; every part begins on a word.
_FEEDBACK_COUNT = len(Feedback._fields)
_STICK_AT = _WORD * _HEADER_WORDS
_FEEDBACK_AT = _STICK_AT + _WORD * (1 + _STICK_COUNT)
_REQUESTS_AT = _FEEDBACK_AT + _WORD * (1 + _FEEDBACK_COUNT)
_TEXTS_AT = _REQUESTS_AT + _WORD * 2 + _REQUEST_SLOTS * _REQUEST.size
_SIZE = _TEXTS_AT + _WORD * 2 + _TEXT_SLOTS * _TEXT.size


class SequenceLock:
    """A handful of float64 values, written whole by one side and read whole by the other."""

    def __init__(self, memory: SharedMemory, offset: int, count: int) -> None:
        """Lay it over shared memory.

        Args:
            memory: The shared memory.
            offset: Where it begins [bytes].
            count: How many values.
        """
        buffer = memory.buf
        assert buffer is not None
        # Two readings of the count around a copy show a torn read.
        self._count = buffer[offset : offset + _WORD].cast("q")
        self._values = buffer[offset + _WORD : offset + _WORD * (1 + count)].cast("d")
        self._pack = struct.Struct(f"={count}d").pack_into
        self._fence = threading.Lock()

    def write(self, values: tuple[float, ...]) -> None:
        """Publish new values.

        Args:
            values: As many as the lock holds.
        """
        count = self._count[0] + (self._count[0] & 1)  # a writer that died half-way left it odd
        self._count[0] = count + 1
        with self._fence:  # orders the stores, also off x86
            pass
        self._pack(self._values, 0, *values)
        with self._fence:
            pass
        self._count[0] = count + 2

    @property
    def version(self) -> int:
        """Changes with every write."""
        return self._count[0]

    def read(self) -> list[float] | None:
        """The values, or None while they are being written; call again in the next frame then."""
        before = self._count[0]
        if before & 1:
            return None
        values = cast("list[float]", self._values.tolist())
        return values if self._count[0] == before else None

    def release(self) -> None:
        """Let the shared memory go."""
        self._values.release()
        self._count.release()


class Queue:
    """Fixed-size records from one writer to one reader; a full queue refuses."""

    def __init__(self, memory: SharedMemory, offset: int, *, record: struct.Struct, slots: int) -> None:
        """Lay it over shared memory.

        Args:
            memory: The shared memory.
            offset: Where it begins [bytes].
            record: Layout of a record.
            slots: How many records fit.
        """
        buffer = memory.buf
        assert buffer is not None
        self._ends = buffer[offset : offset + 2 * _WORD].cast("q")
        first = offset + 2 * _WORD
        self._buffer = buffer[first : first + slots * record.size]
        self._record, self._slots = record, slots
        self._fence = threading.Lock()

    def put(self, *values: object) -> bool:
        """Append a record.

        Args:
            *values: What the record's layout takes.

        Returns:
            False where the reader is so far behind that there is no room.
        """
        written, taken = self._ends[0], self._ends[1]
        if written - taken >= self._slots:
            return False
        self._record.pack_into(self._buffer, (written % self._slots) * self._record.size, *values)
        with self._fence:
            pass
        self._ends[0] = written + 1
        return True

    def take(self) -> list[tuple[object, ...]]:
        """Everything that was put since; an empty list costs a fraction of a microsecond."""
        written, taken = self._ends[0], self._ends[1]
        if written == taken:
            return []
        records = [
            self._record.unpack_from(self._buffer, (number % self._slots) * self._record.size)
            for number in range(taken, written)
        ]
        self._ends[1] = written
        return records

    def release(self) -> None:
        """Let the shared memory go."""
        self._buffer.release()
        self._ends.release()


class Exchange:
    """The whole shared memory, from either side."""

    def __init__(self, name: str | None = None) -> None:
        """Create it, or attach to one.

        Args:
            name: Name of an existing one; None creates it, and removes it at ``close``.

        Raises:
            InputError: There is none of that name, or it has another layout.
        """
        self._owns = name is None
        if name is None:
            self._memory = SharedMemory(create=True, size=_SIZE)
            assert self._memory.buf is not None
            self._memory.buf[:_SIZE] = bytes(_SIZE)
        else:
            try:
                self._memory = _attach_untracked(name)
            except (FileNotFoundError, ValueError) as failure:
                raise InputError("there is no exchange of this name", key="exchange", value=name) from failure
        assert self._memory.buf is not None
        self.header = self._memory.buf[: _WORD * _HEADER_WORDS].cast("q")
        """Flags and counters, see the constants of this module."""
        if self._owns:
            self.header[MAGIC] = _MAGIC
        elif self.header[MAGIC] != _MAGIC:
            self.header.release()
            self._memory.close()
            raise InputError("this shared memory is no exchange of this version", key="exchange", value=name)
        self._stick = SequenceLock(self._memory, _STICK_AT, _STICK_COUNT)
        self._feedback = SequenceLock(self._memory, _FEEDBACK_AT, _FEEDBACK_COUNT)
        self._requests = Queue(self._memory, _REQUESTS_AT, record=_REQUEST, slots=_REQUEST_SLOTS)
        self._texts = Queue(self._memory, _TEXTS_AT, record=_TEXT, slots=_TEXT_SLOTS)
        self._open = True
        if self._owns:
            atexit.register(self.close)

    @property
    def name(self) -> str:
        """Name under which the other side attaches."""
        return self._memory.name

    @property
    def stick_version(self) -> int:
        """Changes whenever a stick input was written."""
        return self._stick.version

    def write_sticks(self, sticks: StickInput) -> None:
        """Publish a stick input.

        Args:
            sticks: What the sticks say; ``stick_valid`` and ``lever_valid`` travel as bits.
        """
        valid = int(sticks.stick_valid) | int(sticks.lever_valid) << 1
        self._stick.write(
            (
                float(sticks.sequence),
                float(sticks.received_ns),
                sticks.stick,
                sticks.lever,
                sticks.lateral,
                sticks.yaw,
                float(valid),
                float(sticks.nacelle_switch),
                sticks.nacelle_angle,
                float(sticks.trim),
                float(sticks.buttons),
                float(sticks.owner),
            )
        )

    def read_sticks(self) -> StickInput | None:
        """The newest stick input, or None while it is being written."""
        values = self._stick.read()
        if values is None:
            return None
        sequence, received, stick, lever, lateral, yaw, valid, switch, angle, trim, buttons, owner = values
        bits = int(valid)
        return StickInput(
            int(sequence),
            int(received),
            stick,
            lever,
            lateral,
            yaw,
            bool(bits & 1),
            bool(bits & 2),
            int(switch),
            angle,
            int(trim),
            int(buttons),
            int(owner),
        )

    def write_feedback(self, feedback: Feedback) -> None:
        """Publish what acts.

        Args:
            feedback: The frame's feedback.
        """
        self._feedback.write(feedback)

    def read_feedback(self) -> Feedback | None:
        """The newest feedback, or None while it is being written."""
        values = self._feedback.read()
        return None if values is None else Feedback(*values)

    def put_request(self, request: Request) -> bool:
        """Ask the flight for something.

        Args:
            request: What is asked.

        Returns:
            Whether there was room.
        """
        return self._requests.put(request.kind.encode(), request.name.encode(), float(request.value))

    def take_requests(self) -> list[Request]:
        """Everything asked since the last look."""
        return [_request(record) for record in self._requests.take()]

    def put_text(self, severity: int, text: str) -> bool:
        """Hand a STATUSTEXT to the MAVLink process.

        Args:
            severity: MAV_SEVERITY, 0 emergency to 7 debug.
            text: What is shown; cut to 50 ASCII characters.

        Returns:
            Whether there was room.
        """
        return self._texts.put(severity, text.encode("ascii", "replace")[:50])

    def take_texts(self) -> list[tuple[int, str]]:
        """Severity and text of everything said since the last look."""
        return [(int(record[0]), _text(record[1])) for record in self._texts.take()]  # type: ignore[call-overload]

    def close(self) -> None:
        """Detach; the side that created it removes it."""
        if not self._open:
            return
        self._open = False
        for part in (self._stick, self._feedback, self._requests, self._texts):
            part.release()
        self.header.release()
        self._memory.close()
        if self._owns:
            atexit.unregister(self.close)
            self._memory.unlink()


def _text(raw: object) -> str:
    assert isinstance(raw, bytes)
    return raw.rstrip(b"\0").decode("ascii", "replace")


def _request(record: tuple[object, ...]) -> Request:
    kind, name, value = record
    assert isinstance(value, float)
    return Request(_text(kind), _text(name), value)
