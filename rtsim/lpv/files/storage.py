"""Reading and writing databases, whatever the file's format."""

from __future__ import annotations

import functools
import logging
import threading
from dataclasses import replace
from pathlib import Path

from rtsim.aircraft.condition import SHIPPED as SHIPPED_CONDITION
from rtsim.aircraft.condition import AircraftCondition
from rtsim.aircraft.profile import (
    OWN_SUFFIX,
    PARTS,
    PROFILE_ATTRIBUTE,
    AircraftProfile,
    parse_profile,
    read_profile,
    xv15_profile,
)
from rtsim.errors import InputError
from rtsim.kernels.kept import kept
from rtsim.lpv.database import Database
from rtsim.lpv.files.assemble import LARGEST_FILE
from rtsim.lpv.files.kept_databases import kept_file
from rtsim.lpv.files.mat import read_mat, write_mat
from rtsim.lpv.files.netcdf import SHIPPED, read_database, write_database
from rtsim.outside import regular_file, status_of

_LIBRARY = threading.Lock()
"""HDF5 bears one thread at a time."""


def load_database(path: str | Path | AircraftCondition | None = None) -> Database:
    """Read a database; without a path, the shipped one.

    Args:
        path: A NetCDF or MATLAB file (``.mat``) as written by ``save_database``; the layout is in docs/lpv.md. Its
            aircraft profile stands beside it (``NAME.profile.toml``) or in it; one that has none flies with the XV-15's
            parts, which is said once. Or a condition of the XV-15: what was built for it earlier and is kept
            (``rtsim.loop.aircraft.database_of`` builds it).

    Returns:
        The database, checked, its arrays read-only.

    Raises:
        InputError: The file is missing, not readable, or not a database the kernels could fly.
    """
    if isinstance(path, AircraftCondition):
        path = None if path == SHIPPED_CONDITION else _kept(path)
    missing = "run 'rtsim model build'" if path is None else "check the path"
    file = regular_file(SHIPPED if path is None else path, noun="database", largest=LARGEST_FILE, missing=missing)
    beside = file.with_name(file.stem + OWN_SUFFIX)
    return _read_once(file, _state(file), beside, _state(beside))


def _kept(condition: AircraftCondition) -> Path:
    file = kept_file(condition)
    if file is None:
        raise InputError(f"the database for {condition} is not built yet", key="database",
                         mend=f"run 'rtsim model build {condition.flags}' here")  # fmt: skip
    return file


def _state(file: Path) -> str | None:
    """What changes with a file; None where there is none."""
    stat = status_of(file)
    return None if stat is None else f"{stat.st_ino} {stat.st_size} {stat.st_mtime_ns} {stat.st_ctime_ns}"


@functools.lru_cache(maxsize=4)
def _read_once(file: Path, _modified: str | None, beside: Path, profile_modified: str | None) -> Database:
    """Keep what was read: its arrays are read-only, and a batch of flights asks for it again and again."""
    return _read(file, None if profile_modified is None else beside)


def _read(file: Path, beside: Path | None) -> Database:
    database = _parsed(file)
    inside = database.attributes.get(PROFILE_ATTRIBUTE)
    if beside is not None:
        return _with_profile(database, read_profile(beside))
    if inside is not None:
        return _with_profile(database, parse_profile(str(inside), file=f"{file} ({PROFILE_ATTRIBUTE})"))
    if file == SHIPPED or "cg_in" in database.attributes:  # built here: the XV-15 at some condition
        return _with_profile(database, xv15_profile())
    logging.getLogger(__name__).warning(
        "%s: has no aircraft profile: it flies with the XV-15's %s and %s.", file, ", ".join(PARTS[:-1]), PARTS[-1]
    )
    return database


def _parsed(file: Path) -> Database:
    """What a file says, checked; kept beside the kernels, since taking it apart is a third of a warm start."""

    def parse() -> Database:
        database = read_mat(file) if file.suffix.lower() == ".mat" else read_database(file)
        assert database.content_hash  # goes with it
        return database

    with _LIBRARY:
        database = kept("database", f"{file.resolve()} {_state(file)}".encode(), parse)
    database.freeze()
    return database


def _with_profile(database: Database, profile: AircraftProfile) -> Database:
    """The same database with another profile; its numbers are checked and hashed already."""
    changed = replace(database, profile=profile)
    changed.remember_hash(database.content_hash)
    return changed


def save_database(database: Database, path: str | Path) -> None:
    """Write a database to NetCDF or, for a name ending in ``.mat``, for MATLAB.

    The target is replaced in one move when all is written.
    Cells without a trim are missing values in NetCDF and filled again on reading. A profile of its own goes with it.

    Args:
        database: What to write.
        path: The target, ``*.nc`` or ``*.mat``.

    Raises:
        OutputError: The file could not be written; the old one, if any, still stands.
    """
    if database.profile.source:
        database = replace(database, attributes={**database.attributes, PROFILE_ATTRIBUTE: database.profile.source})
    if Path(path).suffix.lower() == ".mat":
        write_mat(database, path)
        return
    with _LIBRARY:
        write_database(database, path)
