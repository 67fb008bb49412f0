"""Signed frames: each acts once, also over restarts of the vehicle and of the flight."""

from __future__ import annotations

import fcntl
import hashlib
import hmac
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rtsim.errors import OutputError
from rtsim.whole_file import write_whole
from telemetry.mavlink.framing import RADIO_STATUS, SIGNATURE_UNITS_PER_S, Frame, signature_time

WINDOW = 60 * SIGNATURE_UNITS_PER_S
"""How far a stamp may be behind our clock or ahead of it [10 us]."""
_RESERVE = SIGNATURE_UNITS_PER_S
_MOST_STREAMS = 256


class SignatureCheck:
    """Accepts frames signed with one key, each newer than what came before on its stream.

    What came before is kept in a file, a second ahead of what was accepted, so that it need not be written for each
    frame and a process that is killed forgets nothing. Flights side by side keep one file, in which no stamp is ever
    lowered. Where it cannot be kept, only stamps from after the start count.
    """

    def __init__(self, key: bytes, kept: Path | None = None) -> None:
        """Begin with the streams of earlier flights.

        Args:
            key: The shared key, 32 bytes.
            kept: Where the newest stamps are kept; None keeps none.
        """
        self._key, self._file = key, kept
        self._started = signature_time()
        self._streams: dict[str, int] = {}
        self._reserved: dict[str, int] = {}
        self.trouble = ""
        """Why the stamps cannot be kept, once that is so."""
        if kept is not None:
            self._streams = self._read(kept)
            self._reserved = dict(self._streams)
            self._write(kept)

    def accepts(self, frame: Frame) -> bool:
        """Whether a frame may act.

        Args:
            frame: A frame with a right checksum.
        """
        if frame.message_id == RADIO_STATUS:
            return True
        if not frame.signed:
            return False
        raw = frame.raw
        wanted = hashlib.sha256(self._key + raw[:-6]).digest()[:6]
        if not hmac.compare_digest(wanted, raw[-6:]):
            return False
        stamp, now = int.from_bytes(raw[-12:-6], "little"), signature_time()
        stream = f"{frame.system_id}/{frame.component_id}/{raw[-13]}"
        newest = self._streams.get(stream, self._started - 1 if self.trouble else 0)
        if abs(stamp - now) > WINDOW or stamp <= newest:
            return False
        self._streams[stream] = stamp
        self._streams = _few(self._streams, now)
        if self._file is not None and stamp > self._reserved.get(stream, 0):
            self._reserved[stream] = stamp + _RESERVE
            self._reserved = _few(self._reserved, now)
            self._write(self._file)
        return True

    def _read(self, kept: Path) -> dict[str, int]:
        try:
            streams = json.loads(kept.read_bytes())
            return {str(name): int(stamp) for name, stamp in streams.items()}
        except FileNotFoundError:
            return {}
        except (OSError, ValueError, TypeError, AttributeError):
            self.trouble = f"{kept} cannot be read"
            return {}

    def _write(self, kept: Path) -> None:
        """Raise what the file holds to our stamps."""
        try:
            with _locked(kept):
                streams = self._read(kept)
                for name, stamp in self._reserved.items():
                    streams[name] = max(stamp, streams.get(name, 0))
                write_whole(kept, json.dumps(_few(streams, signature_time())))
        except OutputError as failure:
            self.trouble = str(failure)
        except OSError as failure:
            self.trouble = f"{kept}: cannot be locked: {failure.strerror}"


@contextmanager
def _locked(kept: Path) -> Iterator[None]:
    """Let nobody else change the file; the lock lies beside it, since the file itself is replaced."""
    lock = os.open(f"{kept}.lock", os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
    finally:
        os.close(lock)


def _few(streams: dict[str, int], now: int) -> dict[str, int]:
    """Forget old streams where there are many: what is older than the window is refused without being remembered."""
    if len(streams) <= _MOST_STREAMS:
        return streams
    return {name: last for name, last in streams.items() if last >= now - WINDOW}
