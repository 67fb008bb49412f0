"""Turns named arrays, as a file holds them, into a checked database."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from rtsim.aircraft.variables import Variable
from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.lpv.cells import fill_invalid
from rtsim.lpv.database import AXES, GRIDDED, Database, StoredArrays
from rtsim.lpv.lateral import LateralData
from rtsim.lpv.sanity import check_meaning, check_units

OPTIONAL: Final = ("valid", "xdot_ref", "df_dnacelle", "flap", "rotor_speed")
"""Arrays that a user's own database may leave out: all cells valid, unaccelerated, and the rest zero."""
LARGEST_FILE: Final = 500_000_000
"""Size of the largest database file that is read [bytes]."""
LARGEST_CONTENT: Final = 1_000_000_000
"""Size of the largest database, unpacked [bytes]."""
REDESIGN: Final = "design the pilots anew (rtsim model import FILE --design-pilots)"
"""What to do about gains that mean nothing."""
KINDS: Final = ("state", "input", "output")
"""The three lists of variables."""


def assemble_database(
    arrays: Mapping[str, Any],
    variables: Mapping[str, Sequence[Variable]],
    *,
    attributes: Mapping[str, str | float | int],
    pilot: Mapping[str, StoredArrays],
    lateral: StoredArrays | None = None,
    file: str,
    units: Mapping[str, str] = MappingProxyType({}),
) -> Database:
    """Build a database from what a file holds; fills cells without a trim.

    Args:
        arrays: Axes and gridded arrays by name; those in ``OPTIONAL`` may be missing.
        variables: States, inputs and outputs under ``state``, ``input`` and ``output``.
        attributes: Attributes of the file.
        pilot: Pilot gains by name of the design.
        lateral: The motion out of the plane of symmetry.
        units: Units of axes and configuration, where the file says them.

    Returns:
        The checked database.

    Raises:
        InputError: Naming the file, the array and what is wrong with it.
    """
    values = dict(arrays)
    for name in (*AXES, *GRIDDED, "flap", "rotor_speed"):
        if name not in values and name not in OPTIONAL:
            raise InputError("the array is missing", file=file, key=name, mend="see docs/lpv.md for the layout")
    for name, array in values.items():
        values[name] = _as_array(name, array, file)
    _complete(values)
    if values["rotor_speed"].size == 1:  # one for all rows
        values["rotor_speed"] = np.full(np.asarray(values["nacelle"]).size, values["rotor_speed"].item())
    for design, stored in pilot.items():
        for name, array in stored.arrays.items():
            if not np.all(np.isfinite(array)):
                raise InputError("not a finite number", file=file, key=f"pilot/{design}/{name}", mend=REDESIGN)
    try:
        _fill(values)
        for array in values.values():
            if isinstance(array, np.ndarray):
                array.setflags(write=False)  # ours alone: the database need not copy it again
        check_units(units)
        database = Database(
            **values,
            states=tuple(variables["state"]),
            inputs=tuple(variables["input"]),
            outputs=tuple(variables["output"]),
            attributes=attributes,
            pilot=pilot,
            lateral=lateral,
        )
        if lateral is not None:
            LateralData.of(database)  # refuses what does not fit
        check_meaning(database)
        return database
    except InputError as error:
        raise InputError(str(error).rstrip("."), file=file) from error


def _complete(values: dict[str, Any]) -> None:
    """Give the optional arrays their defaults where the shapes of the others allow it."""
    x_ref = np.asarray(values["x_ref"])
    grid = x_ref.shape[:-1]
    values.setdefault("valid", np.ones(grid, dtype=bool))
    values.setdefault("xdot_ref", np.zeros_like(x_ref))
    values.setdefault("df_dnacelle", np.zeros_like(x_ref))
    values.setdefault("flap", np.zeros(grid[1:]))
    values.setdefault("rotor_speed", np.array(0.0))


def real_array(name: str, value: Any, file: str) -> FloatArray:
    """A read-only array of float64 from what a file holds.

    Args:
        name: Its name in the file.
        value: What the file holds.

    Raises:
        InputError: It is not made of real numbers.
    """
    array = _as_array(name, value, file)
    array.setflags(write=False)
    return np.ascontiguousarray(array)


def _as_array(name: str, value: Any, file: str) -> Any:
    if np.iscomplexobj(value):
        raise InputError("holds complex numbers", file=file, key=name, mend="give real numbers")
    try:
        if name != "valid":
            return np.array(value, dtype=np.float64)
        flags = np.array(value)
        if flags.dtype != np.bool_ and not np.all(np.isin(flags, (0, 1))):
            raise InputError("neither 0 nor 1", file=file, key=name, mend="mark cells that have a trim with 1")
        return flags.astype(np.bool_)
    except (TypeError, ValueError) as error:
        raise InputError("not an array of numbers", file=file, key=name, value=str(error)) from error


def _fill(values: dict[str, Any]) -> None:
    """Fill the cells without a trim, where shapes allow; wrong shapes are refused by ``Database`` with their names."""
    valid, airspeed = values["valid"], values["airspeed"]
    gridded = {name: values[name] for name in GRIDDED}
    layers = values["layer_acceleration"]
    if valid.shape != (layers.size, airspeed.size, values["nacelle"].size) or not valid.size or valid.all():
        return
    if all(array.shape[:3] == valid.shape for array in gridded.values()):
        fill_invalid(gridded, airspeed, int(np.argmin(np.abs(layers))))
