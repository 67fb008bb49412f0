"""A database as the closed loop flies it: the variables that its kernels know, in their order."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rtsim.aircraft.variables import (
    AUXILIARY_INPUTS,
    FLAP_INPUTS,
    GROUND_INPUTS,
    INPUTS,
    OUTPUTS,
    STATES,
    Variable,
    position,
)
from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.lpv.database import Database, StoredArrays


@functools.lru_cache(maxsize=4)
def flown_database(database: Database, file: str | None = None) -> Database:
    """Give a database in the layout of the closed loop, whose kernels know the variables by their places.

    Variables are found by name, in any order; outputs that nobody asks for are left out. Where inputs of flaps and
    rotor speed are missing, they do nothing.

    Returns:
        The same one where it has that layout; else a copy in it.

    Raises:
        InputError: It lacks a variable, or has a state or input that the closed loop would not move: it serves in
            Python, but cannot be flown.
    """
    needed = tuple(variable for variable in INPUTS if variable.name not in AUXILIARY_INPUTS)
    _refuse(database.states, STATES, STATES, "states", file)
    _refuse(database.inputs, needed, INPUTS, "inputs", file)
    _refuse(database.outputs, OUTPUTS, None, "outputs", file)
    pairs = ((database.states, STATES), (database.inputs, INPUTS), (database.outputs, OUTPUTS))
    if all([v.name for v in have] == [v.name for v in want] for have, want in pairs):
        return database
    x, u, y = (np.array([position(have, variable.name) for variable in want]) for have, want in pairs)

    def pick(name: str, *places: Any) -> FloatArray:
        """An array with its last axes in the closed loop's order; zeros where a variable is missing."""
        return ordered(getattr(database, name), places)

    def ordered(array: FloatArray, places: Sequence[Any]) -> FloatArray:
        for axis, place in enumerate(places, start=array.ndim - len(places)):
            array = np.take(array, np.maximum(place, 0), axis=axis)
            missing = [slice(None)] * array.ndim
            missing[axis] = place < 0
            array[tuple(missing)] = 0.0
        return np.asarray(array)

    lateral = {} if database.lateral is None else dict(database.lateral.arrays)
    axes = {
        "x_ref": (x,),
        "u_ref": (u,),
        "y_ref": (y,),
        "xdot_ref": (x,),
        "A": (x, x),
        "B": (x, u),
        "C": (y, x),
        "D": (y, u),
    }
    for name, places in axes.items():
        if f"loaded_{name}" in lateral:
            lateral[f"loaded_{name}"] = ordered(lateral[f"loaded_{name}"], places)
        if f"slip_{name}" in lateral:
            array, count = lateral[f"slip_{name}"], {"x": database.states, "u": database.inputs, "y": database.outputs}
            split = len(count[name[0]])
            lateral[f"slip_{name}"] = np.concatenate([ordered(array[..., :split], places), array[..., split:]], axis=-1)
    return replace(
        database,
        states=STATES,
        inputs=INPUTS,
        outputs=OUTPUTS,
        x_ref=pick("x_ref", x),
        u_ref=pick("u_ref", u),
        y_ref=pick("y_ref", y),
        xdot_ref=pick("xdot_ref", x),
        df_dnacelle=pick("df_dnacelle", x),
        A=pick("A", x, x),
        B=pick("B", x, u),
        C=pick("C", y, x),
        D=pick("D", y, u),
        lateral=None if database.lateral is None else StoredArrays(lateral, database.lateral.attributes),
    )


def moves_flaps(database: Database) -> bool:
    """Whether a database knows what the flaps do."""
    return set(FLAP_INPUTS) <= {variable.name for variable in database.inputs}


def turns_rotors(database: Database) -> bool:
    """Whether a database knows what the rotor speed does."""
    return "rotor_speed" in {variable.name for variable in database.inputs}


def meets_ground(database: Database) -> bool:
    """Whether a database knows what the ground does."""
    return set(GROUND_INPUTS) <= {variable.name for variable in database.inputs}


def _refuse(
    present: Sequence[Variable],
    needed: Sequence[Variable],
    known: Sequence[Variable] | None,
    kind: str,
    file: str | None,
) -> None:
    """Refuse what is missing, has another unit, or is not known."""
    found = {variable.name: variable for variable in present}
    for variable in needed:
        there = found.get(variable.name)
        if there is None:
            raise InputError(
                f"the closed loop needs '{variable.name}' [{variable.unit or '-'}], which the database lacks",
                file=file, key=kind, mend="add it, or use the database in Python (rtsim.load_aircraft)",
            )  # fmt: skip
        if there.unit != variable.unit:
            raise InputError(
                f"'{variable.name}' has another unit than the closed loop reckons in",
                file=file, key=kind, value=there.unit, allowed=variable.unit or "no unit", mend="convert it",
            )  # fmt: skip
    names = {variable.name for variable in known or present}
    for variable in present:
        if variable.name not in names:
            raise InputError(
                f"the closed loop does not know '{variable.name}' (role {variable.role}) and would leave it still",
                file=file, key=kind, allowed=", ".join(item.name for item in known or present),
                mend="leave it out, or use the database in Python (rtsim.load_aircraft)",
            )  # fmt: skip
