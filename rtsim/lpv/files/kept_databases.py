"""Databases of the XV-15 at other conditions: built once, and kept beside the compiled kernels.

A kept database is an ordinary NetCDF file. Its name says the condition and what it was built by: a changed model, or
changed building, is another name. What is not used for a month goes with its folder (``rtsim.kernels.cache``).

Legend:
    condition: The condition.
"""

from __future__ import annotations

import functools
import hashlib
from pathlib import Path

from rtsim.aircraft.condition import AircraftCondition
from rtsim.errors import OutputError
from rtsim.kernels import store

BUILT_FROM = ("aircraft/**/*", "lpv/*", "lpv/building/*", "nacelle/*", "pilot/*")
"""Sources and data in rtsim that a database is made from, besides the kernels, which name the folder."""


def kept_file(condition: AircraftCondition) -> Path | None:
    """The file of a database that is kept; None where there is none."""
    name = _name(condition)
    for folder in (store.main_folder(), store.writable_folder()):
        if folder is not None and (folder / name).is_file():
            return folder / name
    return None


def place_for(condition: AircraftCondition) -> Path:
    """Where a database is to be kept.

    Raises:
        OutputError: Nothing can be written anywhere.
    """
    folder = store.writable_folder()
    if folder is None:
        raise OutputError(
            f"the database for {condition} cannot be kept: no folder can be written; build it with "
            f"'rtsim model build {condition.flags} --out FILE' and fly it with --database FILE"
        )
    return folder / _name(condition)


def _name(condition: AircraftCondition) -> str:
    weight, height, forward = condition.values
    return f"xv15_{weight}lb_{height}ft_{forward}in_{_recipe()}.nc"


@functools.cache
def _recipe() -> str:
    """Hash of everything a database is built from."""
    root, digest = Path(__file__).resolve().parents[2], hashlib.sha256()
    files = (path for part in BUILT_FROM for ending in ("py", "toml") for path in root.glob(f"{part}.{ending}"))
    for path in sorted(files):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]
