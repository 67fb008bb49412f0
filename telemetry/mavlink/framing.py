"""Cuts datagrams into MAVLink frames and checks each one, without any state that outlives a datagram.

A parser that remembers the end of one datagram lets a truncated frame eat the next heartbeat, so here every datagram
stands alone. Work per datagram is bounded: no crafted bytes can keep the loop searching.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import all as dialect

MARKER_V1, MARKER_V2 = 0xFE, 0xFD
FLAG_SIGNED = 0x01
SIGNATURE_LENGTH = 13
RADIO_STATUS = 109
"""The one message that a radio, which has no key, may send unsigned."""
LARGEST_DATAGRAM = 2048
"""Longer datagrams are cut, as no MAVLink link sends them [bytes]."""
_MOST_FRAMES, _MOST_FAILURES = 128, 16
SIGNATURE_UNITS_PER_S = 100_000
_SIGNATURE_EPOCH_S = 1_420_070_400  # 2015-01-01 UTC
_CRC_EXTRA: dict[int, int] = {number: message.crc_extra for number, message in dialect.mavlink_map.items()}
_checksum = dialect.x25crc


class Frame(NamedTuple):
    """One frame whose checksum is right."""

    message_id: int
    """MAVLink message id."""
    system_id: int
    """Sender's system id."""
    component_id: int
    """Sender's component id."""
    raw: bytes
    """The whole frame, from marker to checksum or signature."""
    signed: bool
    """Whether it carries a signature (not yet checked)."""


def frames(datagram: bytes) -> Iterator[Frame]:
    """Every valid frame of a datagram.

    Args:
        datagram: What was received.

    Yields:
        Frames with a right checksum; whatever else is there is stepped over.
    """
    at, end, failures, found = 0, len(datagram), 0, 0
    while at < end and failures < _MOST_FAILURES and found < _MOST_FRAMES:
        frame = _frame_at(datagram, at, end)
        if frame is not None:
            at += len(frame.raw)
            found += 1
            yield frame
            continue
        failures += 1
        following = [place for place in (datagram.find(b"\xfd", at + 1), datagram.find(b"\xfe", at + 1)) if place > 0]
        if not following:
            return
        at = min(following)


def _frame_at(data: bytes, at: int, end: int) -> Frame | None:
    """The frame that begins here, if one does."""
    rest = end - at
    marker = data[at]
    signed = False
    if marker == MARKER_V2 and rest >= 12:
        flags = data[at + 2]
        if flags & ~FLAG_SIGNED:
            return None  # a frame with flags we do not know must be discarded
        signed = bool(flags & FLAG_SIGNED)
        header = 10
        number = data[at + 7] | data[at + 8] << 8 | data[at + 9] << 16
        sender = data[at + 5], data[at + 6]
    elif marker == MARKER_V1 and rest >= 8:
        header, number, sender = 6, data[at + 5], (data[at + 3], data[at + 4])
    else:
        return None
    checked = at + header + data[at + 1]
    length = header + data[at + 1] + 2 + (SIGNATURE_LENGTH if signed else 0)
    extra = _CRC_EXTRA.get(number)
    if length > rest or extra is None:
        return None
    crc = _checksum(data[at + 1 : checked] + bytes((extra,))).crc
    if crc != data[checked] | data[checked + 1] << 8:
        return None
    return Frame(number, sender[0], sender[1], data[at : at + length], signed)


def decode(frame: Frame, decoder: Any) -> Any | None:
    """Turn a frame into a pymavlink message.

    Args:
        frame: A valid frame.
        decoder: A ``MAVLink`` object without signing.

    Returns:
        The message, or None where its payload cannot be unpacked.
    """
    try:
        return decoder.decode(bytearray(frame.raw))
    except (dialect.MAVError, struct.error, ValueError, IndexError, KeyError, TypeError):
        return None


def signature_time() -> int:
    """Now, on the scale of signatures: units of 10 us since 2015."""
    return int((time.time() - _SIGNATURE_EPOCH_S) * SIGNATURE_UNITS_PER_S)
