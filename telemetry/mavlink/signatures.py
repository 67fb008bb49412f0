"""Signed frames: each acts once, also over restarts of the vehicle and of the flight."""

from __future__ import annotations

import hashlib
import hmac
import json
from pathlib import Path

from rtsim.errors import OutputError
from rtsim.whole_file import write_whole
from telemetry.mavlink.framing import RADIO_STATUS, SIGNATURE_UNITS_PER_S, Frame, signature_time

WINDOW = 60 * SIGNATURE_UNITS_PER_S
"""How far a stream's first stamp may be behind our clock, and any stamp ahead of it [10 us]."""
_RESERVE = SIGNATURE_UNITS_PER_S
_MOST_STREAMS = 256


class SignatureCheck:
    """Accepts frames signed with one key, each newer than what came before on its stream.

    What came before is kept in a file, a second ahead of what was accepted, so that it need not be written for each
    frame and a process that is killed forgets nothing. Where it cannot be kept, only stamps from after the start count.
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
            self._write()

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
        oldest = self._started if self.trouble else now - WINDOW
        if stamp > now + WINDOW or stamp <= self._streams.get(stream, oldest - 1):
            return False
        self._streams[stream] = stamp
        if len(self._streams) > _MOST_STREAMS:  # what is older than the window is refused without being remembered
            self._streams = {name: last for name, last in self._streams.items() if last >= now - WINDOW}
        if self._file is not None and stamp > self._reserved.get(stream, 0):
            self._write(_RESERVE)
        return True

    def close(self) -> None:
        """Keep the stamps as they are."""
        self._write()

    def _read(self, kept: Path) -> dict[str, int]:
        try:
            streams = json.loads(kept.read_bytes())
            return {str(name): int(stamp) for name, stamp in streams.items()}
        except FileNotFoundError:
            return {}
        except (OSError, ValueError, TypeError, AttributeError):
            self.trouble = f"{kept} cannot be read"
            return {}

    def _write(self, ahead: int = 0) -> None:
        if self._file is None:
            return
        self._reserved = {name: stamp + ahead for name, stamp in self._streams.items()}
        try:
            write_whole(self._file, json.dumps(self._reserved))
        except OutputError as failure:
            self.trouble = str(failure)
