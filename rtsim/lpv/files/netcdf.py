"""The database as a self-describing NetCDF-4 file: dimensions, coordinates, units, long names, attributes.

Layout: the root group holds axes, trim map and linear models; ``/pilot/<design>`` holds the gains of one design,
``/lateral`` the motion out of the plane of symmetry.
A file is written beside its target and renamed, so a reader never meets half of one.
"""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from rtsim.aircraft.variables import Variable
from rtsim.errors import InputError
from rtsim.lpv.database import AXES, GRIDDED, Database, StoredArrays
from rtsim.lpv.files import netcdf_trial
from rtsim.lpv.files.assemble import KINDS, LARGEST_CONTENT, LARGEST_FILE, assemble_database, real_array
from rtsim.lpv.sanity import AXIS_UNITS
from rtsim.outside import regular_file, understanding
from rtsim.whole_file import whole_file

SHIPPED: Final = Path(__file__).parents[2] / "aircraft" / "xv15" / "data" / "xv15_lpv.nc"
"""The database that comes with rtsim."""
FORMAT: Final = "rtsim LPV database 1"
"""Value of the attribute ``format``; raised when the layout changes."""

LATERAL: Final = "lateral"
"""Group of the motion out of the plane of symmetry."""
_GRID = ("layer", "airspeed", "nacelle")
_TAILS: Final[Mapping[str, tuple[str, ...]]] = {
    "x_ref": ("state",), "u_ref": ("input",), "y_ref": ("output",), "xdot_ref": ("state",), "df_dnacelle": ("state",),
    "A": ("state", "state_column"), "B": ("state", "input"), "C": ("output", "state"), "D": ("output", "input"),
    "valid": (),
}  # fmt: skip
_LONG_NAMES: Final[Mapping[str, str]] = {
    "layer_acceleration": "level acceleration of the trims of each layer",
    "airspeed": "horizontal airspeed, signed",
    "nacelle": "nacelle angle, pi/2 helicopter, 0 airplane",
    "x_ref": "trim state",
    "u_ref": "trim input",
    "y_ref": "trim output",
    "xdot_ref": "state derivative at the trim",
    "A": "derivative of the state derivative with the state",
    "B": "derivative of the state derivative with the input",
    "C": "derivative of the output with the state",
    "D": "derivative of the output with the input",
    "df_dnacelle": "derivative of the state derivative with the nacelle angle",
    "valid": "a trim exists here; other cells repeat the nearest airspeed that has one",
    "flap": "flap deflection of the flap schedule",
    "rotor_speed": "rotor speed, held",
}
_UNITS: Final[Mapping[str, str]] = {
    "layer_acceleration": "m s-2", "airspeed": "m s-1", "nacelle": "rad", "flap": "rad", "rotor_speed": "rad s-1",
}  # fmt: skip
_SEPARATE_UNITS = "of the variables along its dimensions, SI and radians"


def read_database(path: str | Path | None = None) -> Database:
    """Read a database; without a path, the shipped one.

    Args:
        path: A file written by ``write_database`` or laid out like one.

    Returns:
        The database, checked, its arrays read-only.

    Raises:
        InputError: The file is missing, no NetCDF file, or not a database the kernels could fly.
    """
    missing = "run 'rtsim model build'" if path is None else "check the path"
    file = regular_file(SHIPPED if path is None else path, noun="database", largest=LARGEST_FILE, missing=missing)
    import netCDF4

    mend = "write it anew (docs/lpv.md), or restore it"
    if file != SHIPPED:
        _try(file, mend)
    with understanding("NetCDF database", file=file, mend=mend), netCDF4.Dataset(str(file), "r") as dataset:
        dataset.set_auto_mask(False)
        _measure(dataset)
        return _read(dataset, str(file))


def _try(file: Path, mend: str) -> None:
    """Have another process read a file first: given a damaged one the library may loop for ever, or crash."""
    command = [sys.executable, "-P", str(Path(netcdf_trial.__file__)), str(file.resolve())]
    ended = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    if ended.returncode:
        lines = ended.stderr.decode(errors="replace").split("\n") if ended.returncode == 1 else []
        with understanding("NetCDF database", file=file, mend=mend):
            raise ValueError(next((line for line in reversed(lines) if line), "reading it does not end, or crashes"))


def _measure(dataset: Any) -> None:
    """Refuse what would take more memory than any database: a damaged file says anything of its sizes."""
    groups = [dataset, *(dataset.groups["pilot"].groups.values() if "pilot" in dataset.groups else ())]
    groups += [dataset.groups[LATERAL]] if LATERAL in dataset.groups else []
    sizes = [
        math.prod(int(length) for length in variable.shape) for group in groups for variable in group.variables.values()
    ]
    if 8 * sum(sizes) > LARGEST_CONTENT:
        raise ValueError(f"it holds more than {LARGEST_CONTENT} bytes")


def write_database(database: Database, path: str | Path) -> None:
    """Write a database; the target is replaced in one move when all is written.

    Args:
        database: What to write.
        path: The target, usually ``*.nc``.

    Raises:
        OutputError: The file could not be written; the old one, if any, still stands.
    """
    import netCDF4

    with whole_file(path) as part:
        part.touch()  # the library calls everything that forbids this "Permission denied"
        try:
            with netCDF4.Dataset(str(part), "w", format="NETCDF4") as dataset:
                _write(dataset, database)
        except RuntimeError as error:  # how the library tells of a full disk
            raise OSError(f"{error} (is the disk full?)") from error


def _write(dataset: Any, database: Database) -> None:
    dataset.setncatts({**database.attributes, "format": FORMAT, "Conventions": "CF-1.11"})
    dataset.content_hash = database.content_hash
    for name, values in zip(_GRID, (database.layer_acceleration, database.airspeed, database.nacelle), strict=True):
        dataset.createDimension(name, values.size)
    for kind, variables in (("state", database.states), ("input", database.inputs), ("output", database.outputs)):
        dataset.createDimension(kind, len(variables))
        for column, part in (
            (f"{kind}_name", "name"),
            (f"{kind}_unit", "unit"),
            (f"{kind}_description", "description"),
            (f"{kind}_role", "role"),
        ):
            text = dataset.createVariable(column, str, (kind,))
            text[:] = np.array([getattr(variable, part) for variable in variables], dtype=object)
    dataset.createDimension("state_column", len(database.states))
    _put(dataset, "layer_acceleration", ("layer",), database.layer_acceleration)
    _put(dataset, "airspeed", ("airspeed",), database.airspeed)
    _put(dataset, "nacelle", ("nacelle",), database.nacelle)
    _put(dataset, "flap", ("airspeed", "nacelle"), database.flap)
    _put(dataset, "rotor_speed", ("nacelle",), database.rotor_speed)
    for name in GRIDDED:
        values = getattr(database, name)
        if name != "valid":
            values = np.where(database.valid.reshape(database.valid.shape + (1,) * len(_TAILS[name])), values, np.nan)
        _put(dataset, name, _GRID + _TAILS[name], values)
    for design, pilot in database.pilot.items():
        _put_group(dataset.createGroup(f"pilot/{design}"), pilot)
    if database.lateral is not None:
        _put_group(dataset.createGroup(LATERAL), database.lateral)


def _put_group(group: Any, stored: StoredArrays) -> None:
    group.setncatts(dict(stored.attributes))
    for name, array in stored.arrays.items():
        dimensions = []
        for axis, size in enumerate(array.shape):
            dimensions.append(f"{name}_{axis}")
            group.createDimension(dimensions[-1], size)
        variable = group.createVariable(name, "f8", dimensions, zlib=bool(array.shape), complevel=6, shuffle=True)
        variable[...] = array


def _put(dataset: Any, name: str, dimensions: tuple[str, ...], values: npt.NDArray[Any]) -> None:
    kind = "i1" if values.dtype == np.bool_ else "f8"
    missing = np.nan if name in GRIDDED and kind == "f8" else None
    variable = dataset.createVariable(
        name, kind, dimensions, zlib=bool(dimensions), complevel=6, shuffle=True, fill_value=missing
    )
    variable.long_name = _LONG_NAMES[name]
    if name != "valid":
        variable.units = _UNITS.get(name, _SEPARATE_UNITS)
    variable[...] = values


def _read(dataset: Any, file: str) -> Database:
    arrays = {
        name: np.asarray(dataset.variables[name][...])
        for name in (*AXES, *GRIDDED, "flap", "rotor_speed")
        if name in dataset.variables
    }
    attributes = {name: _plain(dataset.getncattr(name)) for name in dataset.ncattrs()}
    stored = attributes.pop("content_hash", None)
    for name in ("format", "Conventions"):
        attributes.pop(name, None)
    database = assemble_database(
        arrays,
        {kind: _read_variables(dataset, kind, file) for kind in KINDS},
        attributes=attributes,
        pilot=_read_pilots(dataset, file),
        lateral=_read_group(dataset.groups[LATERAL], LATERAL, file) if LATERAL in dataset.groups else None,
        file=file,
        units={
            name: str(dataset.variables[name].getncattr("units"))
            for name in AXIS_UNITS
            if name in dataset.variables and "units" in dataset.variables[name].ncattrs()
        },
    )
    if stored is not None and stored != database.content_hash:
        raise InputError(
            "the numbers do not match the content hash written with them",
            file=file,
            key="content_hash",
            mend="restore the file, or remove the attribute if the change was meant",
        )
    return database


def _read_variables(dataset: Any, kind: str, file: str) -> tuple[Variable, ...]:
    for column in (f"{kind}_name", f"{kind}_unit"):
        if column not in dataset.variables:
            raise InputError("the list is missing", file=file, key=column, mend="see docs/lpv.md for the layout")
    columns: list[list[str]] = []
    for part in ("name", "unit", "description", "role"):
        column = f"{kind}_{part}"
        read = column in dataset.variables
        columns.append([str(text) for text in dataset.variables[column][:]] if read else [""] * len(columns[0]))
    return tuple(Variable(*row) for row in zip(*columns, strict=True))


def _read_pilots(dataset: Any, file: str) -> dict[str, StoredArrays]:
    if "pilot" not in dataset.groups:
        return {}
    groups = dataset.groups["pilot"].groups.items()
    return {design: _read_group(group, f"pilot/{design}", file) for design, group in groups}


def _read_group(group: Any, path: str, file: str) -> StoredArrays:
    arrays = {name: real_array(f"{path}/{name}", variable[...], file) for name, variable in group.variables.items()}
    return StoredArrays(arrays, {key: _plain(group.getncattr(key)) for key in group.ncattrs()})


def _plain(value: Any) -> str | float | int:
    plain: str | float | int = value.item() if isinstance(value, np.generic) else value
    return plain
