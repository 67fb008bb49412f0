"""Reading and writing databases, whatever the file's format."""

from __future__ import annotations

import functools
from pathlib import Path

from rtsim.lpv.database import Database
from rtsim.lpv.database_file import SHIPPED, read_database, write_database
from rtsim.lpv.mat_file import read_mat, write_mat


def load_database(path: str | Path | None = None) -> Database:
    """Read a database; without a path, the shipped one.

    Args:
        path: A NetCDF or MATLAB file (``.mat``) as written by ``save_database``; the layout is in docs/lpv.md.

    Returns:
        The database, checked, its arrays read-only.

    Raises:
        InputError: The file is missing, not readable, or not a database the kernels could fly.
    """
    if path is not None and Path(path).suffix.lower() == ".mat":
        return read_mat(path)
    if path is None and SHIPPED.is_file():
        return _read_once(SHIPPED.stat().st_mtime_ns)
    return read_database(path)


@functools.lru_cache(maxsize=1)
def _read_once(_modified: int) -> Database:
    """Keep the shipped database: its arrays are read-only, and a batch of flights asks for it again and again."""
    return read_database()


def save_database(database: Database, path: str | Path) -> None:
    """Write a database to NetCDF or, for a name ending in ``.mat``, for MATLAB.

    The target is replaced in one move when all is written.
    Cells without a trim are missing values in NetCDF and filled again on reading.

    Args:
        database: What to write.
        path: The target, ``*.nc`` or ``*.mat``.

    Raises:
        OutputError: The file could not be written; the old one, if any, still stands.
    """
    if Path(path).suffix.lower() == ".mat":
        write_mat(database, path)
        return
    write_database(database, path)
