"""The pilot as a linear system over one held frame: rates of estimate, hands and delay, and the limits of the hands.

Legend: x estimate [plant | delay | hands] (padded), u true hands before the delay, d true delay filter; A B C F l G2 as
in the design. Matrices are stored column after column, so that each multiply-add runs down contiguous memory.
"""

from __future__ import annotations

from typing import NamedTuple

from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel
from rtsim.pilot.layout_kernels import INTEGRALS, PilotTables, pad4


class Gains(NamedTuple):
    """Interpolated gains of one frame: flat views into one array, so that the compiler knows every stride."""

    A: FloatArray
    """Columns of the plant's dynamics, padded n long."""
    B: FloatArray
    """Columns of its controls, padded n long."""
    C: FloatArray
    """Columns of the displays, padded ny long."""
    F: FloatArray
    """Columns of the filter gain, padded estimate long."""
    L: FloatArray
    """Columns of the commanded-control gain, nu long."""
    G: FloatArray
    """Inverse neuromotor lag, nu long rows."""


class Held(NamedTuple):
    """What acts constantly during a frame."""

    plant: FloatArray
    """Known accelerations of the plant (padded n)."""
    displays: FloatArray
    """Deviations read (padded ny)."""
    command: FloatArray
    """Commands of the outer loops (nu,)."""
    limit: FloatArray
    """What limits take off the hands' rates (nu,)."""
    motor: FloatArray
    """Motor noise on the hands' rates (nu,)."""


class Motion(NamedTuple):
    """Estimate, true hands and true delay filter, or their rates."""

    x: FloatArray
    """Estimate (padded)."""
    u: FloatArray
    """Hands (nu,)."""
    d: FloatArray
    """Delay filter (nd,)."""


@inner_kernel
def gains_of(tables: PilotTables, cell: FloatArray) -> Gains:
    """Find the gains in an interpolated cell.

    Args:
        cell: Interpolated gains.

    Returns:
        Views into the cell.
    """
    roles = tables.roles
    hands = roles.hands
    displays = roles.displays
    seen = pad4(displays)
    slow = roles.plant + roles.delay
    rows = pad4(roles.plant)
    wide = pad4(slow + hands)
    return Gains(
        cell[roles.a : roles.a + roles.a_columns * rows],
        cell[roles.b : roles.b + hands * rows],
        cell[roles.c : roles.c + roles.c_columns * seen],
        cell[roles.f : roles.f + displays * wide],
        cell[roles.l : roles.l + slow * hands],
        cell[roles.g : roles.g + hands * hands],
    )


@inner_kernel
def rates(
    tables: PilotTables, gains: Gains, held: Held, at: Motion, holds: int, out: Motion, scratch: FloatArray
) -> None:
    """Rates of the pilot at held displays.

    Args:
        gains: Gains of this frame.
        held: What acts constantly.
        at: Estimate, hands and delay filter.
        holds: How many of the integrals stand still: none, that of the airspeed, both.
        out: Receives the rates.
        scratch: Room for the padded displays, the hands, and the states with a column.
    """
    roles = tables.roles
    n, delay, hands = roles.plant, roles.delay, roles.hands
    x, u, d = at.x, at.u, at.d
    dx, du, dd = out.x, out.u, out.d
    rows, seen, wide = pad4(n), pad4(roles.displays), pad4(n + delay + hands)
    innovation = scratch[:seen]
    wanted = scratch[seen : seen + hands]
    values = scratch[seen + hands : seen + hands + roles.a_columns + hands]
    for c in range(roles.a_columns):
        values[c] = x[tables.a_columns[c]]
    for hand in range(hands):
        value = tables.delay_d[hand] * x[n + delay + hand]
        for k in range(delay):
            value += tables.model_delay_c[hand, k] * x[n + k]
        values[roles.a_columns + hand] = value
    for k in range(rows, wide):
        dx[k] = 0.0
    for k in range(rows):
        total = held.plant[k]
        for c in range(roles.a_columns):
            total += gains.A[rows * c + k] * values[c]
        for hand in range(hands):
            total += gains.B[rows * hand + k] * values[roles.a_columns + hand]
        dx[k] = total
    for k in range(n - INTEGRALS, n - INTEGRALS + holds):
        dx[k] = 0.0
    for k in range(delay):
        model = 0.0
        true = 0.0
        for m in range(delay):
            model += tables.model_delay_a[k, m] * x[n + m]
            true += tables.output_delay_a[k, m] * d[m]
        for hand in range(hands):
            model += tables.delay_b[k, hand] * x[n + delay + hand]
            true += tables.delay_b[k, hand] * u[hand]
        dx[n + k] = model
        dd[k] = true
    for hand in range(hands):
        wanted[hand] = held.command[hand]
    for k in range(n + delay):
        for hand in range(hands):
            wanted[hand] -= gains.L[hands * k + hand] * x[k]
    for hand in range(hands):
        model = held.limit[hand]
        true = model + held.motor[hand]
        for other in range(hands):
            model += gains.G[hands * hand + other] * (wanted[other] - x[n + delay + other])
            true += gains.G[hands * hand + other] * (wanted[other] - u[other])
        dx[n + delay + hand] = model
        du[hand] = true
    for c in range(roles.c_columns):
        values[c] = x[tables.c_columns[c]]
    for k in range(seen):
        total = held.displays[k]
        for c in range(roles.c_columns):
            total -= gains.C[seen * c + k] * values[c]
        innovation[k] = total
    for k in range(wide):
        total = dx[k]
        for display in range(roles.displays):
            total += gains.F[wide * display + k] * innovation[display]
        dx[k] = total


@inner_kernel
def limit_hands(tables: PilotTables, gains: Gains, held: Held, at: Motion, trim: FloatArray) -> bool:
    """Limit rate and travel of the hands at the start of a frame.

    Args:
        gains: Gains of this frame.
        held: ``limit`` receives what is taken off the hands' rates.
        at: Estimate and hands.
        trim: Pitch and hands of the commanded trim.

    Returns:
        Whether anything was taken off.
    """
    hands = tables.roles.hands
    limited = False
    for hand in range(hands):
        rate = 0.0
        for other in range(hands):
            wanted = held.command[other]
            for k in range(tables.roles.plant + tables.roles.delay):
                wanted -= gains.L[hands * k + other] * at.x[k]
            rate += gains.G[hands * hand + other] * (wanted - at.u[other])
        allowed = min(tables.limits[2, hand], max(-tables.limits[2, hand], rate))
        position = trim[1 + hand] + at.u[hand]
        if (position >= tables.limits[1, hand] and allowed > 0.0) or (
            position <= tables.limits[0, hand] and allowed < 0.0
        ):
            allowed = 0.0
        held.limit[hand] = allowed - rate
        limited = limited or allowed != rate
    return limited


@inner_kernel
def motion_of(tables: PilotTables, work: FloatArray) -> Motion:
    """Look at an array as estimate, hands and delay filter.

    Args:
        work: Array of `motion_size` values.

    Returns:
        Views into the array.
    """
    roles = tables.roles
    hands = roles.hands
    delay = roles.delay
    wide = pad4(roles.plant + delay + hands)
    return Motion(work[:wide], work[wide : wide + hands], work[wide + hands : wide + hands + delay])


@inner_kernel
def motion_size(tables: PilotTables) -> int:
    """Length of an array for `motion_of`.

    Returns:
        The number of float64 values.
    """
    roles = tables.roles
    return int(pad4(roles.plant + roles.delay + roles.hands) + roles.hands + roles.delay)


@inner_kernel
def held_of(tables: PilotTables, work: FloatArray) -> Held:
    """Look at an array as what acts constantly during a frame.

    Args:
        work: Array of `held_size` values.

    Returns:
        Views into the array.
    """
    hands = tables.roles.hands
    rows = pad4(tables.roles.plant)
    command = rows + pad4(tables.roles.displays)
    return Held(
        work[:rows],
        work[rows:command],
        work[command : command + hands],
        work[command + hands : command + 2 * hands],
        work[command + 2 * hands : command + 3 * hands],
    )


@inner_kernel
def held_size(tables: PilotTables) -> int:
    """Length of an array for `held_of`.

    Returns:
        The number of float64 values.
    """
    return int(pad4(tables.roles.plant) + pad4(tables.roles.displays) + 3 * tables.roles.hands)
