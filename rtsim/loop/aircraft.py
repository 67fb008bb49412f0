"""The database of a flight's aircraft: one that was named, or that of a condition, built once and then kept."""

from __future__ import annotations

import fcntl
import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rtsim.aircraft.condition import SHIPPED, AircraftCondition, AircraftName
from rtsim.errors import InputError

if TYPE_CHECKING:
    from rtsim.lpv.database import Database

Listener = Callable[[str, float | None], None]
"""Told what is done, in words, and the share of the work done since the last call; None: a remark."""
_listeners: list[Listener] = []


def database_of(aircraft: AircraftName) -> Database:
    """Load an aircraft's database; that of a condition is built first where it is not kept yet.

    Args:
        aircraft: A file, empty for the shipped XV-15, or a condition of the XV-15.

    Raises:
        InputError: There is no such file, or it is no database that could be flown.
        OutputError: What was built cannot be kept.
        TrimError: The aircraft cannot be trimmed in this condition at all.
    """
    from rtsim.lpv.files.kept_databases import kept_file
    from rtsim.lpv.files.storage import load_database

    if not isinstance(aircraft, AircraftCondition) or aircraft == SHIPPED:
        return load_database(None if isinstance(aircraft, AircraftCondition) else aircraft or None)
    file = kept_file(aircraft)
    if file is not None:
        try:
            return load_database(aircraft)
        except InputError as error:  # a kept file is a convenience: what is damaged is made anew
            logging.getLogger(__name__).warning("%s It is built anew.", error)
            file.unlink(missing_ok=True)
    _build(aircraft)
    return load_database(aircraft)


def _build(condition: AircraftCondition) -> None:
    """Build and keep a database, unless another process does so meanwhile."""
    from rtsim.lpv.files.kept_databases import kept_file, place_for
    from rtsim.lpv.files.storage import save_database
    from rtsim.pilot.database import build_xv15

    place = place_for(condition)
    with _locked(place.with_suffix(".lock"), f"Another process builds the database for {condition}: waiting for it"):
        if kept_file(condition) is not None:
            return
        words = f"Building the database for {condition}: once, then it is kept"
        _tell(words, None)
        database = build_xv15(condition, jobs=os.cpu_count() or 1, progress=lambda share: _tell(words, share))
        save_database(database, place)


@contextmanager
def _locked(file: Path, waiting: str) -> Iterator[None]:
    """Hold a file's lock while the block runs; it ends with this process, however that ends.

    Args:
        waiting: What to say where somebody else has it.
    """
    with file.open("wb") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            _tell(waiting, None)
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _tell(words: str, share: float | None) -> None:
    for listener in _listeners:
        listener(words, share)
    if share is None and not _listeners:
        logging.getLogger(__name__).warning("%s.", words)


@contextmanager
def told(listener: Listener) -> Iterator[None]:
    """Tell somebody how far a database is while the block runs.

    Args:
        listener: Called as work is done; must be quick.
    """
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)
