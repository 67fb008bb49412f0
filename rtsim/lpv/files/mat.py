"""The database as a MATLAB file (version 5 to 7): the same names and shapes as in NetCDF, lists as cell arrays."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rtsim.aircraft.variables import Variable
from rtsim.errors import InputError
from rtsim.lpv.database import AXES, GRIDDED, Database, StoredArrays
from rtsim.lpv.files.assemble import KINDS, LARGEST_CONTENT, LARGEST_FILE, assemble_database, real_array
from rtsim.lpv.files.mat_layout import unpacked
from rtsim.lpv.lateral import LATERAL_AXES
from rtsim.outside import read_bytes, regular_file, understanding
from rtsim.whole_file import whole_file

_DIMENSIONS = {"x_ref": 4, "u_ref": 4, "y_ref": 4, "xdot_ref": 4, "df_dnacelle": 4, "valid": 3, "flap": 2,
               "A": 5, "B": 5, "C": 5, "D": 5}  # fmt: skip


def read_mat(path: str | Path) -> Database:
    """Read a database from a MATLAB file.

    MATLAB drops trailing dimensions of length one and turns vectors into rows; both are undone.

    Args:
        path: The file, saved with ``-v7`` or older.

    Returns:
        The checked database.

    Raises:
        InputError: The file is missing, not readable, or not a usable database.
    """
    from scipy.io import loadmat

    file = regular_file(path, noun="database", largest=LARGEST_FILE, missing="check the path")
    data = read_bytes(file, noun="database", largest=LARGEST_FILE)
    if b"\x89HDF" in data[:1024]:
        raise InputError("a MATLAB 7.3 file", file=str(file), mend="save it with the option '-v7'")
    with understanding("MATLAB database", file=file, mend="save it anew with the option '-v7'"):
        content = loadmat(io.BytesIO(unpacked(data, largest=LARGEST_CONTENT)), struct_as_record=True)
        arrays: dict[str, Any] = {}
        for name in (*AXES, *GRIDDED, "flap", "rotor_speed"):
            if name in content:
                arrays[name] = _reshaped(name, content[name])
        return assemble_database(
            arrays,
            {kind: _variables(content, kind, str(file)) for kind in KINDS},
            attributes=_attributes(content.get("attributes")),
            pilot=_pilots(content.get("pilot"), str(file)),
            lateral=_lateral(content["lateral"], str(file)) if "lateral" in content else None,
            file=str(file),
        )


def write_mat(database: Database, path: str | Path) -> None:
    """Write a database as a MATLAB file; the target is replaced in one move when all is written.

    Args:
        database: What to write.
        path: The target, usually ``*.mat``.

    Raises:
        OutputError: The file could not be written.
    """
    from scipy.io import savemat

    content: dict[str, Any] = {name: getattr(database, name) for name in (*AXES, *GRIDDED, "flap", "rotor_speed")}
    content["valid"] = database.valid.astype(np.uint8)
    for kind, variables in zip(KINDS, (database.states, database.inputs, database.outputs), strict=True):
        content[f"{kind}_name"] = _cells([variable.name for variable in variables])
        content[f"{kind}_unit"] = _cells([variable.unit for variable in variables])
        content[f"{kind}_description"] = _cells([variable.description for variable in variables])
        content[f"{kind}_role"] = _cells([variable.role for variable in variables])
    content["attributes"] = {**database.attributes, "content_hash": database.content_hash}
    if database.pilot:
        content["pilot"] = {
            design: {**pilot.arrays, "attributes": dict(pilot.attributes)} for design, pilot in database.pilot.items()
        }
    if database.lateral is not None:
        content["lateral"] = {**database.lateral.arrays, "attributes": dict(database.lateral.attributes)}
    with whole_file(path) as part, part.open("wb") as stream:
        savemat(stream, content, do_compression=True, long_field_names=True)


def _cells(texts: Sequence[str]) -> Any:
    cells = np.empty(len(texts), dtype=object)
    cells[:] = texts
    return cells


def _reshaped(name: str, value: Any) -> Any:
    array = np.asarray(value)
    if name in (*AXES, "rotor_speed"):
        return array.reshape(-1)
    missing = _DIMENSIONS.get(name, 0) - array.ndim
    return array.reshape(array.shape + (1,) * missing) if missing > 0 else array


def _texts(content: Mapping[str, Any], name: str) -> list[str] | None:
    if name not in content:
        return None
    return ["".join(str(part) for part in np.ravel(cell)) for cell in np.ravel(content[name])]


def _variables(content: Mapping[str, Any], kind: str, file: str) -> list[Variable]:
    names = _texts(content, f"{kind}_name")
    units = _texts(content, f"{kind}_unit")
    if names is None or units is None:
        missing = f"{kind}_name" if names is None else f"{kind}_unit"
        raise InputError("the list is missing", file=file, key=missing, mend="add it as a cell array of texts")
    descriptions = _texts(content, f"{kind}_description") or [""] * len(names)
    roles = _texts(content, f"{kind}_role") or [""] * len(names)
    if not len(names) == len(units) == len(descriptions) == len(roles):
        raise InputError("lists of different length", file=file, key=f"{kind}_name, {kind}_unit")
    return [Variable(*row) for row in zip(names, units, descriptions, roles, strict=True)]


def _record(value: Any) -> dict[str, Any]:
    """Fields of a scalar MATLAB structure."""
    array = np.asarray(value)
    if array.dtype.names is None or array.size != 1:
        return {}
    return {name: array.reshape(-1)[0][name] for name in array.dtype.names}


def _attributes(value: Any) -> dict[str, str | float | int]:
    attributes: dict[str, str | float | int] = {}
    for name, entry in _record(value).items():
        cell = np.asarray(entry)
        if name != "content_hash" and cell.size == 1 and cell.dtype.kind in "fiubU":
            attributes[name] = cell.reshape(-1)[0].item()
    return attributes


def _pilots(value: Any, file: str) -> dict[str, StoredArrays]:
    return {design: _stored(record, f"pilot.{design}", file) for design, record in _record(value).items()}


def _stored(value: Any, path: str, file: str) -> StoredArrays:
    parts = _record(value)
    attributes = _attributes(parts.pop("attributes", None))
    return StoredArrays({name: real_array(f"{path}.{name}", entry, file) for name, entry in parts.items()}, attributes)


def _lateral(value: Any, file: str) -> StoredArrays:
    stored = _stored(value, "lateral", file)
    axes = {name: stored.arrays[name].ravel() for name in LATERAL_AXES if name in stored.arrays}
    return StoredArrays({**stored.arrays, **axes}, stored.attributes)
