"""Where a recording goes: refused before the flight where it cannot; one flight each; only recordings are replaced.

Legend:
    record: The recording that was asked for, ``NAME.rrd``.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
from pathlib import Path
from typing import BinaryIO

from rtsim.errors import InputError, OutputError
from rtsim.outside import status_of
from rtsim.whole_file import check_writable

_MAGIC = b"RRF"
"""What every recording of Rerun begins with."""


def partial_name(record: Path) -> Path:
    """Where a recording grows until it is finished and renamed."""
    return record.with_name(f"{record.stem}.partial.rrd")


def check_recording(record: Path) -> None:
    """Refuse a recording that could not be written, before anything else is begun; nothing is left changed.

    Raises:
        InputError: Something that is no recording is there, or another flight records there.
        OutputError: It cannot be written.
    """
    claim(record).close()
    discard_empty(record)


def claim(record: Path) -> BinaryIO:
    """Take the place of a recording.

    Returns:
        The partial file; nobody else may record there until the last process that has it open has ended.

    Raises:
        InputError: Something that is no recording is there, or another flight records there.
        OutputError: It cannot be written.
    """
    partial = partial_name(record)
    check_writable(record)
    for place in (record, partial):
        if not _may_be_replaced(place):
            raise InputError("something that is no recording is here", file=str(place), mend="choose another --record")
    try:
        held = os.fdopen(os.open(partial, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666), "r+b", buffering=0)
    except OSError as failure:
        raise OutputError(f"{partial}: cannot be written: {failure.strerror}.") from failure
    with contextlib.suppress(BlockingIOError):
        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if _is_at(held, partial):
            return held
    held.close()
    raise InputError(
        "another flight is recording here", file=str(record), mend="wait for its end or choose another --record"
    )


def claim_next(record: Path, word: str, number: int) -> tuple[Path, BinaryIO]:
    """Take the next free place beside a recording.

    Args:
        word: What stands between name and number.
        number: The first to try.

    Returns:
        The place, and what ``claim`` gives.

    Raises:
        OutputError: Nothing more can be written there.
    """
    while True:
        place = record.with_stem(f"{record.stem}{word}{number}")
        try:
            return place, claim(place)
        except InputError:  # somebody else's
            number += 1


def discard_empty(record: Path) -> None:
    """Take away the partial file of a recording that nothing was written to."""
    with contextlib.suppress(OSError):
        there = status_of(partial_name(record))
        if there and there.st_size == 0:
            partial_name(record).unlink()


def _may_be_replaced(place: Path) -> bool:
    try:
        with place.open("rb") as file:
            return file.read(len(_MAGIC)) in {b"", _MAGIC}
    except FileNotFoundError:
        return True
    except OSError:
        return False


def _is_at(held: BinaryIO, place: Path) -> bool:
    """Whether an open file still has this name: a flight that ended meanwhile may have renamed it."""
    there = status_of(place)
    return there is not None and os.path.samestat(os.fstat(held.fileno()), there)
