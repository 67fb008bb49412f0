"""Shared memory between the flight and its MAVLink process: sticks, requests and notes in, feedback and texts out.

Nothing here waits; how, says ``shared_memory``.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from rtsim.command import StickInput
from rtsim.errors import InputError
from telemetry.exchange.shared_memory import WORD, Kept, Queue, SequenceLock, SharedMemory

_MAGIC = 0x5254_5349_4D4D_4156
_HEADER_WORDS = 32
_STICK_COUNT = 15
_REQUEST = struct.Struct("<16s24sd")
_REQUEST_SLOTS = 256
_TEXT = struct.Struct("<B55s")
_TEXT_SLOTS = 64
_NOTE = struct.Struct("<120s")
_NOTE_SLOTS = 32
_KEPT_BYTES = 1 << 15

MAGIC, STOP, READY, PORT, HEARTBEAT, PEERS, RECEIVED, DISCARDED, ACCEPTED, SENT, ARMED, FAULTS, ALIVE = range(13)
"""Words of the header: layout check, asked to stop, taking part, own UDP port, life sign, ground stations heard,
datagrams received, datagrams discarded (budget, whitelist, not MAVLink), stick inputs accepted, messages sent, armed,
faults caught, life sign of the flight (0 while nothing flies)."""


class Request(NamedTuple):
    """One discrete thing a ground station asked of the flight."""

    kind: str
    """``reset``, ``pilot``, ``aid``, ``flaps``, ``throttle``, ``nacelle``, ``transition``, ``parameter`` or
    ``freeze``."""
    name: str = ""
    """Who shall fly, which aid, which parameter; ``up`` or ``down`` for ``flaps`` to the next setting."""
    value: float = 0.0
    """On (1), off (0) or toggle (2) for an aid; an angle [rad] for ``nacelle`` and ``flaps``; a share of full power for
    ``throttle``; 3 helicopter or 4 airplane for ``transition``; the value of a parameter."""


class Feedback(NamedTuple):
    """What the flight tells its MAVLink process about the sticks, once per frame."""

    stick: float = 0.0
    """Longitudinal stick that acts, after dead band, expo, blending and failsafe, -1 to 1."""
    lever: float = 0.0
    """Power lever that acts, 0 to 1."""
    lateral: float = 0.0
    """Lateral stick that acts, -1 to 1."""
    yaw: float = 0.0
    """Pedals that act, -1 to 1."""
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
    waiting: float = 0.0
    """Controls that stay where they are until their hand moves through them: 1 the stick, 2 the lever, 4 the lateral
    stick, 8 the pedals."""


# Offsets in bytes; every part begins on a word.
_FEEDBACK_COUNT = len(Feedback._fields)
_STICK_AT = WORD * _HEADER_WORDS
_FEEDBACK_AT = _STICK_AT + WORD * (1 + _STICK_COUNT)
_REQUESTS_AT = _FEEDBACK_AT + WORD * (1 + _FEEDBACK_COUNT)
_TEXTS_AT = _REQUESTS_AT + WORD * 2 + _REQUEST_SLOTS * _REQUEST.size
_NOTES_AT = _TEXTS_AT + WORD * 2 + _TEXT_SLOTS * _TEXT.size
_KEPT_AT = _NOTES_AT + WORD * 2 + _NOTE_SLOTS * _NOTE.size
_SIZE = _KEPT_AT + WORD * 3 + 2 * _KEPT_BYTES


class Exchange:
    """The whole shared memory, from either side."""

    def __init__(self, descriptor: int | None = None) -> None:
        """Make it, or attach to one.

        Args:
            descriptor: ``descriptor`` of an existing one, handed to this process; None makes one.

        Raises:
            InputError: There is none, or it has another layout.
        """
        if descriptor is None:
            self._memory = SharedMemory(_SIZE)
        else:
            try:
                self._memory = SharedMemory(descriptor=descriptor)
            except (OSError, ValueError) as failure:
                raise InputError("there is no such exchange", key="exchange", value=descriptor) from failure
        self.header = self._memory.buf[: WORD * _HEADER_WORDS].cast("q")
        """Flags and counters, see the constants of this module."""
        if descriptor is None:
            self.header[MAGIC] = _MAGIC
        elif self.header[MAGIC] != _MAGIC:
            self.header.release()
            self._memory.close()
            raise InputError("this shared memory is no exchange of this version", key="exchange", value=descriptor)
        self._stick = SequenceLock(self._memory, _STICK_AT, _STICK_COUNT)
        self._feedback = SequenceLock(self._memory, _FEEDBACK_AT, _FEEDBACK_COUNT)
        self._requests = Queue(self._memory, _REQUESTS_AT, record=_REQUEST, slots=_REQUEST_SLOTS)
        self._texts = Queue(self._memory, _TEXTS_AT, record=_TEXT, slots=_TEXT_SLOTS)
        self._notes = Queue(self._memory, _NOTES_AT, record=_NOTE, slots=_NOTE_SLOTS)
        self.kept = Kept(self._memory, _KEPT_AT, size=_KEPT_BYTES)
        """What the MAVLink process would need if it were started again."""
        self._open = True

    @property
    def descriptor(self) -> int:
        """What the other side attaches to; its process must be handed it."""
        return self._memory.descriptor

    @property
    def stick_version(self) -> int:
        """Changes whenever a stick input was written."""
        return self._stick.version

    def write_sticks(self, sticks: StickInput) -> None:
        """Publish a stick input.

        Args:
            sticks: What the sticks say; whether each is valid travels as a bit.
        """
        held = (sticks.stick_valid, sticks.lever_valid, sticks.lateral_valid, sticks.yaw_valid)
        valid = sum(flag << bit for bit, flag in enumerate(held))
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
                float(sticks.stream),
                float(sticks.overridden),
                float(sticks.lateral_trim),
            )
        )

    def read_sticks(self) -> StickInput | None:
        """The newest stick input, or None while it is being written."""
        values = self._stick.read()
        if values is None:
            return None
        sequence, received, stick, lever, lateral, yaw, valid, switch, angle, *whole, lateral_trim = values
        bits = int(valid)
        trim, buttons, owner, stream, overridden = map(int, whole)
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
            trim,
            buttons,
            owner,
            stream,
            overridden,
            bool(bits & 4),
            bool(bits & 8),
            int(lateral_trim),
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

    def put_note(self, text: str) -> bool:
        """Tell the flight something worth an event.

        Args:
            text: One line; cut to 120 ASCII characters.

        Returns:
            Whether there was room.
        """
        return self._notes.put(text.encode("ascii", "replace")[:120])

    def take_notes(self) -> list[str]:
        """Everything the MAVLink process has told since the last look."""
        return [_text(record[0]) for record in self._notes.take()]

    def close(self) -> None:
        """Let the shared memory go."""
        if not self._open:
            return
        self._open = False
        for part in (self._stick, self._feedback, self._requests, self._texts, self._notes, self.kept):
            part.release()
        self.header.release()
        self._memory.close()


def _text(raw: object) -> str:
    assert isinstance(raw, bytes)
    return raw.rstrip(b"\0").decode("ascii", "replace")


def _request(record: tuple[object, ...]) -> Request:
    kind, name, value = record
    assert isinstance(value, float)
    return Request(_text(kind), _text(name), value)
