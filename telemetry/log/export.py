"""A flight log for other programs: CSV for tables, MAT for MATLAB and Octave."""

from __future__ import annotations

import csv
import json
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from rtsim.errors import InputError, OutputError
from telemetry.log.reader import FlightLog

EXPORT_FORMATS = (".csv", ".mat")
"""Endings of the files that ``export_log`` writes."""


def export_log(log: FlightLog, target: str | os.PathLike[str]) -> None:
    """Write all signals of a flight to one file, whose ending says how.

    Args:
        log: The flight.
        target: ``*.csv`` (a header line, then one line per frame, with every digit) or ``*.mat`` (one column vector
            per signal, ``units`` by signal and ``metadata`` as JSON text).

    Raises:
        InputError: The ending is neither.
        OutputError: The file cannot be written.
    """
    path = Path(target)
    writers: dict[str, Callable[[FlightLog, Path], None]] = {".csv": _write_csv, ".mat": _write_mat}
    if path.suffix not in writers:
        raise InputError(
            "cannot export to this kind of file",
            file=str(path),
            allowed=" or ".join(f"*{end}" for end in EXPORT_FORMATS),
        )
    write_and_rename(path, lambda temporary: writers[path.suffix](log, temporary))


def write_and_rename(path: Path, write: Callable[[Path], None]) -> None:
    """Let ``write`` fill a temporary file beside the target, then rename it: the target is whole or absent.

    Args:
        path: The file to appear.
        write: Writes the content to the path it is given, which has the target's ending.

    Raises:
        OutputError: The file cannot be written.
    """
    temporary: Path | None = None
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        write(temporary)
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    except OSError as failure:
        reason = failure.strerror or failure
        raise OutputError(f"{path}: cannot be written ({reason}); choose another path.") from failure
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _umask() -> int:
    """The process's file mode mask, which can only be read by setting it."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask


def _write_csv(log: FlightLog, path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(log.names)
        writer.writerows(log.rows.tolist())


def _write_mat(log: FlightLog, path: Path) -> None:
    from scipy.io import savemat

    content: dict[str, object] = {name: np.array(log[name]).reshape(-1, 1) for name in log.names}
    content["units"] = {name: unit or "-" for name, unit in zip(log.names, log.units, strict=True)}
    content["metadata"] = log.metadata.to_json()
    content["summary"] = json.dumps(dict(log.summary) if log.summary else None)
    savemat(path, content, long_field_names=True, do_compression=True)
