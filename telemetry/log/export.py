"""A flight log for other programs: CSV for tables, MAT for MATLAB and Octave."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from rtsim.errors import InputError
from rtsim.whole_file import whole_file
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
    with whole_file(path) as temporary:
        writers[path.suffix](log, temporary)


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
