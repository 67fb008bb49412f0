"""Where a log goes: refused before the flight where it cannot, locked while anybody writes, replaced on demand only.

Legend:
    path: The log.
    overwrite: Replace an earlier log of rtsim at this path.
"""

from __future__ import annotations

import fcntl
import os
import re
from pathlib import Path
from typing import BinaryIO

from rtsim.errors import InputError, OutputError
from rtsim.whole_file import check_writable
from telemetry.log.format import EVENTS_FILE

_OURS = re.compile(rf"{re.escape(EVENTS_FILE)}|part-\d{{6}}\.parquet|\.part-\d{{6}}\.parquet\.tmp")
"""Names of all files of a log; the last is of a part that was being written when its writer was killed."""


def check_log(path: str | os.PathLike[str], *, overwrite: bool) -> None:
    """Refuse a log that could not be written, before anything else is begun; nothing is changed.

    Raises:
        InputError: Something that is not to be replaced is there, or another flight writes there.
        OutputError: It cannot be written.
    """
    place = Path(path)
    if not os.path.lexists(place):
        check_writable(place)
        return
    if _old_log(place, overwrite=overwrite):
        with (place / EVENTS_FILE).open("rb") as events:
            _lock_or_refuse(events, place)
    check_writable(place, folder=True)


def claim_log(path: Path, *, overwrite: bool) -> BinaryIO:
    """Make the directory, empty but for the events file.

    Returns:
        The events file, locked; the lock is held until the last process that has it open has ended.

    Raises:
        InputError: Something that is not to be replaced is there, or another flight writes there.
        OutputError: It cannot be written.
    """
    try:
        try:
            path.mkdir()
        except FileExistsError:
            if _old_log(path, overwrite=overwrite):
                with (path / EVENTS_FILE).open("ab") as old:
                    _lock_or_refuse(old, path)
                    for entry in path.iterdir():
                        entry.unlink()
        events = (path / EVENTS_FILE).open("ab")
    except OSError as failure:
        raise OutputError(
            f"{path}: the log cannot be written here ({failure.strerror}); choose a directory that exists and is yours."
        ) from failure
    _lock_or_refuse(events, path)
    return events


def _old_log(path: Path, *, overwrite: bool) -> bool:
    """Whether a log is there that may be replaced; an empty directory is none, and anything else is refused."""
    entries = sorted(path.iterdir()) if path.is_dir() else []
    if path.is_dir() and not entries:
        return False
    foreign = [entry.name for entry in entries if not _OURS.fullmatch(entry.name) or not entry.is_file()]
    if foreign or path / EVENTS_FILE not in entries:
        which = f": {foreign[0]}" if foreign else ""
        raise InputError(f"something that is no rtsim log is here{which}", file=str(path), mend="choose another path")
    if not overwrite:
        raise InputError("there is a log here already", file=str(path), mend="choose another path or add --overwrite")
    return True


def _lock_or_refuse(events: BinaryIO, path: Path) -> None:
    try:
        fcntl.flock(events, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        events.close()
        raise InputError(
            "another flight is writing this log", file=str(path), mend="wait for its end or choose another path"
        ) from None
