"""A database as the closed loop flies it: with the XV-15's variables in their order, flaps and rotor speed included."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rtsim.aircraft.variables import INPUTS, OUTPUTS, STATES, Variable
from rtsim.errors import InputError
from rtsim.lpv.database import Database
from rtsim.lpv.variables import AUXILIARY_INPUTS, FLAP_INPUTS


@functools.lru_cache(maxsize=4)
def flown_database(database: Database, file: str | None = None) -> Database:
    """Give a database in the layout of the closed loop, whose kernels know the variables by their places.

    Args:
        database: Any database.
        file: File it came from, for the message.

    Returns:
        The same one where it has that layout; where it only lacks inputs of flaps and rotor speed, a copy in which they
        do nothing.

    Raises:
        InputError: It has other states, inputs or outputs: it serves in Python, but cannot be flown.
    """
    for kind, present, wanted in (
        ("states", database.states, STATES),
        ("inputs", tuple(v for v in database.inputs if v.name not in AUXILIARY_INPUTS), _without_auxiliary()),
        ("outputs", database.outputs, OUTPUTS),
    ):
        found, needed = _with_units(present), _with_units(wanted)
        if found != needed:
            raise InputError(
                "the database has other variables than the closed loop flies",
                file=file,
                key=kind,
                value=found,
                allowed=needed,
                mend="give it these variables in this order, or use it in Python (rtsim.load_aircraft)",
            )
    if [variable.name for variable in database.inputs] == [variable.name for variable in INPUTS]:
        return database
    places = {variable.name: place for place, variable in enumerate(database.inputs)}
    arrays: dict[str, Any] = {}
    for name in ("u_ref", "B", "D"):
        old = getattr(database, name)
        new = np.zeros((*old.shape[:-1], len(INPUTS)))
        for place, variable in enumerate(INPUTS):
            if variable.name in places:
                new[..., place] = old[..., places[variable.name]]
        arrays[name] = new
    return replace(database, inputs=INPUTS, **arrays)


def moves_flaps(database: Database) -> bool:
    """Whether a database knows what the flaps do.

    Args:
        database: A database.
    """
    return set(FLAP_INPUTS) <= {variable.name for variable in database.inputs}


def turns_rotors(database: Database) -> bool:
    """Whether a database knows what the rotor speed does.

    Args:
        database: A database.
    """
    return "rotor_speed" in {variable.name for variable in database.inputs}


def _with_units(variables: Sequence[Variable]) -> str:
    return ", ".join(f"{variable.name} [{variable.unit or '-'}]" for variable in variables)


def _without_auxiliary() -> tuple[Variable, ...]:
    return tuple(variable for variable in INPUTS if variable.name not in AUXILIARY_INPUTS)
