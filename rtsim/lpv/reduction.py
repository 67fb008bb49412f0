"""Reduces linear models to the states that matter: the others settle at once. Selected by role, in one place.

Legend: A, B derivatives of the state derivative with state and input; k kept states, f fast ones, m inputs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rtsim.aircraft.variables import RIGID_BODY_STATES, of_role, required_position
from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.lpv.database import Database


@dataclass(frozen=True, slots=True)
class Settled:
    """Linear models in which some states have settled; leading axes are those of the grid that was asked for."""

    kept: tuple[int, ...]
    """Positions of the k states that are left."""
    fast: tuple[int, ...]
    """Positions of the f states that have settled."""
    inputs: tuple[int, ...]
    """Positions of the m inputs."""
    a: FloatArray
    """Dynamics [..., k, k]."""
    b: FloatArray
    """Effect of the inputs [..., k, m]."""
    of_state: FloatArray
    """Settled fast states per kept state [..., f, k]."""
    of_input: FloatArray
    """Settled fast states per input [..., f, m]."""
    coupling: FloatArray = field(repr=False)
    """Effect of the fast states on the kept ones [..., k, f]."""
    inner: FloatArray = field(repr=False)
    """Dynamics of the fast states among themselves [..., f, f]."""


def settled(
    database: Database,
    *,
    keep: Sequence[str],
    inputs: Sequence[str],
    purpose: str,
    where: tuple[int, ...] | None = None,
    by_inverse: bool = False,
) -> Settled:
    """Let everything settle but the rigid body and what else is kept.

    Args:
        keep: States that are left, in this order: the rigid body's, which must all be among them, and any others.
        inputs: Inputs that are left, in this order.
        purpose: What for, for messages.
        where: Layer, airspeed and nacelle numbers of one point; None: the whole level layer.
        by_inverse: Multiply by the inverse instead of solving; differs in the last bits.

    Raises:
        InputError: A variable is missing, or a state of the rigid body would be taken for one that settles.
    """
    states = database.states
    refuse_unknown_motion(database, purpose)
    kept = tuple(required_position(states, name, purpose) for name in keep)
    columns = tuple(required_position(database.inputs, name, purpose) for name in inputs)
    fast = tuple(place for place in of_role(states, "rotor", "inflow", "actuator") if place not in kept)
    place = (database.level_layer,) if where is None else where
    A, B = database.A[place], database.B[place]
    rows, quick = A[..., list(kept), :], A[..., list(fast), :]
    coupling, inner = rows[..., list(fast)], quick[..., list(fast)]
    of_state = settle(inner, quick[..., list(kept)], by_inverse=by_inverse)
    of_input = settle(inner, B[..., list(fast), :][..., list(columns)], by_inverse=by_inverse)
    return Settled(
        kept=kept,
        fast=fast,
        inputs=columns,
        a=rows[..., list(kept)] + coupling @ of_state,
        b=B[..., list(kept), :][..., list(columns)] + coupling @ of_input,
        of_state=of_state,
        of_input=of_input,
        coupling=coupling,
        inner=inner,
    )


def eliminated(
    a: FloatArray, b: FloatArray, kept: Sequence[int], inputs: Sequence[int]
) -> tuple[FloatArray, FloatArray]:
    """Let all states settle but some, of any linear models.

    Args:
        a: Dynamics [..., n, n].
        b: Effect of the inputs [..., n, m].
        kept: Positions of the states that are left, in this order.
        inputs: Positions of the inputs that are left, in this order.

    Returns:
        Dynamics and effect of the inputs that are left.
    """
    slow, columns = list(kept), list(inputs)
    fast = [place for place in range(a.shape[-1]) if place not in slow]
    rows, quick = a[..., slow, :], a[..., fast, :]
    push = np.concatenate([quick[..., slow], b[..., fast, :][..., columns]], axis=-1)
    inner = np.linalg.solve(quick[..., fast], push)
    reduced_a = rows[..., slow] - rows[..., fast] @ inner[..., : len(slow)]
    return reduced_a, b[..., slow, :][..., columns] - rows[..., fast] @ inner[..., len(slow) :]


def settle(inner: FloatArray, push: FloatArray, *, by_inverse: bool = False) -> FloatArray:
    """Where fast states settle [..., f, n].

    Args:
        inner: Their dynamics among themselves [..., f, f].
        push: What acts on their derivatives [..., f, n].
        by_inverse: Multiply by the inverse instead of solving.
    """
    return np.asarray(-np.linalg.inv(inner) @ push if by_inverse else -np.linalg.solve(inner, push))


def refuse_unknown_motion(database: Database, purpose: str) -> None:
    """Refuse a database whose rigid body moves in more ways than the ones that are reckoned with.

    Args:
        purpose: What for, for the message.

    Raises:
        InputError: Naming the first such state.
    """
    for place in of_role(database.states, "rigid", "navigation"):
        name = database.states[place].name
        if name not in RIGID_BODY_STATES:
            raise InputError(
                f"the rigid body moves in a way that {purpose} does not reckon with",
                key="states", value=name, allowed=", ".join(RIGID_BODY_STATES),
                mend="leave this state out, or give it the role that it has",
            )  # fmt: skip
