"""Refuses databases that the kernels could not fly, naming the array and what is wrong with it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rtsim.aircraft.variables import SCHEDULING_STATES, position
from rtsim.errors import InputError

if TYPE_CHECKING:
    from rtsim.lpv.database import Database

FloatArray = npt.NDArray[np.float64]
AXES = ("layer_acceleration", "airspeed", "nacelle")
"""The three axes, in the order of the arrays."""
MOST_LAYERS = 8
"""Layers that the kernels' work array has room for."""


def expected_shapes(database: Database) -> dict[str, tuple[int, ...]]:
    """Shapes that the arrays must have, from the axes and the lists of variables.

    Args:
        database: The database.

    Returns:
        Shape by name of the array.
    """
    grid = (database.layer_acceleration.size, database.airspeed.size, database.nacelle.size)
    nx, nu, ny = len(database.states), len(database.inputs), len(database.outputs)
    tails: dict[str, tuple[int, ...]] = {
        "x_ref": (nx,), "u_ref": (nu,), "y_ref": (ny,), "xdot_ref": (nx,), "df_dnacelle": (nx,), "valid": (),
        "A": (nx, nx), "B": (nx, nu), "C": (ny, nx), "D": (ny, nu),
    }  # fmt: skip
    return {name: grid + tail for name, tail in tails.items()} | {"flap": grid[1:]}


def check_database(database: Database, file: str | None = None) -> None:
    """Refuse a database that the kernels could not fly.

    Args:
        database: The database.
        file: File it came from, for the message.

    Raises:
        InputError: Naming the array and what is wrong with it.
    """
    _check_variables(database, file)
    for name in AXES:
        _check_axis(name, getattr(database, name), file, shortest=1 if name == "layer_acceleration" else 2)
    if np.min(np.abs(database.layer_acceleration)) > 1e-9:
        raise InputError(
            "there is no layer of level flight",
            file=file,
            key="layer_acceleration",
            value=database.layer_acceleration.tolist(),
            mend="add the layer of zero acceleration",
        )
    if database.layer_acceleration.size > MOST_LAYERS:
        raise InputError("too many layers", file=file, key="layer_acceleration",
                         value=database.layer_acceleration.size, allowed=f"at most {MOST_LAYERS}")  # fmt: skip
    for name, shape in expected_shapes(database).items():
        array = getattr(database, name)
        if array.shape != shape:
            raise InputError("wrong shape", file=file, key=name, value=array.shape, allowed=f"{shape}")
        if array.dtype != np.bool_ and not np.all(np.isfinite(array)):
            where = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
            raise InputError(
                "not a finite number",
                file=file,
                key=f"{name}{list(where)}",
                value=float(array[where]),
                mend="mark the cell invalid and fill it from the nearest airspeed that has a trim",
            )
    if not np.isfinite(database.rotor_speed):
        raise InputError("not a finite number", file=file, key="rotor_speed", value=database.rotor_speed)
    if not database.valid[database.level_layer].any():
        raise InputError("no cell of the level layer is valid", file=file, key="valid")


def _check_variables(database: Database, file: str | None) -> None:
    for kind, variables in (("states", database.states), ("inputs", database.inputs), ("outputs", database.outputs)):
        names = [variable.name for variable in variables]
        for name in names:
            if names.count(name) > 1:
                raise InputError("the same name twice", file=file, key=kind, value=name, mend="rename one of them")
    for name in SCHEDULING_STATES:
        if position(database.states, name) < 0:
            raise InputError(
                f"the state '{name}' is missing, from which airspeed and angle of attack are computed",
                file=file,
                key="states",
                value=[variable.name for variable in database.states],
                mend=f"name the state that means '{name}' so",
            )


def _check_axis(name: str, axis: FloatArray, file: str | None, *, shortest: int) -> None:
    if axis.ndim != 1 or axis.size < shortest:
        raise InputError("not an axis", file=file, key=name, value=axis.shape, allowed=f"{shortest} or more values")
    if not np.all(np.isfinite(axis)):
        raise InputError("not a finite number on the axis", file=file, key=name)
    if np.any(np.diff(axis) <= 0.0):
        first = int(np.argmax(np.diff(axis) <= 0.0)) + 1
        raise InputError("the axis does not ascend", file=file, key=f"{name}[{first}]", value=float(axis[first]),
                         mend="sort the axis and the arrays with it")  # fmt: skip
