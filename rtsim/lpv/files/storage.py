"""Reading and writing databases, whatever the file's format."""

from __future__ import annotations

import functools
from pathlib import Path

from rtsim.lpv.database import Database
from rtsim.lpv.files.mat import read_mat, write_mat
from rtsim.lpv.files.netcdf import SHIPPED, read_database, write_database


def load_database(path: str | Path | None = None) -> Database:
    """Read a database; without a path, the shipped one.

    Args:
        path: A NetCDF or MATLAB file (``.mat``) as written by ``save_database``; the layout is in docs/lpv.md.

    Returns:
        The database, checked, its arrays read-only.

    Raises:
        InputError: The file is missing, not readable, or not a database the kernels could fly.
    """
    file = SHIPPED if path is None else Path(path)
    return _read_once(file, file.stat().st_mtime_ns) if file.is_file() else _read(file)


@functools.lru_cache(maxsize=2)
def _read_once(file: Path, _modified: int) -> Database:
    """Keep what was read: its arrays are read-only, and a batch of flights asks for it again and again."""
    return _read(file)


def _read(file: Path) -> Database:
    return read_mat(file) if file.suffix.lower() == ".mat" else read_database(file)


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
