"""Compiled rotor drive: both rotors and what turns with them as one inertia between engine power and rotor torque.

With the governor on, the engines give whatever holds the rotor speed: it is exactly the held one, as in the trims. On
the downstop the held speed comes down to airplane mode's, by itself or by hand, and goes back before the nacelles move.
With the governor off, engine power follows the throttle, which moves with the power lever, and the rotors turn as fast
as power and torque let them. Rotor speed is an input of the aircraft, as the nacelle angle is: the acceleration of the
shaft does nothing else to an aircraft with two rotors that turn in opposite directions.

Legend:
    needed: Shaft power that the rotors take [W].
"""

from __future__ import annotations

from typing import NamedTuple

from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel

DEVIATION, ENGINE_POWER, THROTTLE_OFFSET, GOVERNED, THROTTLE_TRIM, HELD_OFFSET, HELD_SETTING, HELD_POWER = range(8)
"""Places in the state: rotor speed less the held one [rad/s]; shaft power that the engines give, and what it is above
that of the throttle's law [W]; whether the governor was on in the frame before (0, 1); what the pilot trims the
throttle by, as a share of full power; the held rotor speed and what it is to become, both less the governed one
[rad/s]; shaft power that changing it takes [W]."""
DRIVE_STATE_SIZE = 8
LOCKED = 2e-5
"""Nacelles this near to the downstop stand on it, locked [rad]."""
_SAME_SPEED = 1e-6
"""The governor takes a rotor speed this close to the wanted one as reached [rad/s]."""


class DriveTables(NamedTuple):
    """What the kernels know of the rotor drive. SI."""

    governed_speed: float
    """Rotor speed that the governor holds off the downstop [rad/s]."""
    slow_offset: float
    """Rotor speed of airplane mode less that one [rad/s]; 0 where the aircraft has no other."""
    change_rate: float
    """Rate at which the held rotor speed changes [rad/s^2]."""
    slow_axis: float
    """Way along the nacelle axis of the database, below 0, per change of the held rotor speed [rad per rad/s]."""
    held_acts: float
    """1 where the held rotor speed is an input of the plant too (the nonlinear aircraft), 0 where the axis says it."""
    inertia: float
    """Moment of inertia of all that turns with the rotors, as felt at the masts [kg m^2]."""
    lever: FloatArray
    """Power lever of the throttle's law, ascending, 0 to 1, shape (n,)."""
    power: FloatArray
    """Shaft power of both engines at these levers [W], shape (n,)."""
    lag: float
    """Time constant of the engines' power [s]."""
    recovery: float
    """Time constant with which the governor brings the rotor speed back [s]."""
    lowest: float
    """Slowest rotor speed that can be flown [rad/s]."""
    efficiency: float
    """Shaft power of the rotors over engine power."""
    highest: float
    """Fastest rotor speed that can be flown [rad/s]."""


@inner_kernel
def throttle_power(tables: DriveTables, lever: float) -> float:
    """Shaft power of both engines at a power lever by the throttle's law [W].

    Args:
        lever: Power lever, 0 to 1.
    """
    last = tables.lever.shape[0] - 1
    k = 0
    while k < last - 1 and tables.lever[k + 1] <= lever:
        k += 1
    share = (lever - tables.lever[k]) / (tables.lever[k + 1] - tables.lever[k])
    share = min(max(share, 0.0), 1.0)
    return float(tables.power[k] + share * (tables.power[k + 1] - tables.power[k]))


@inner_kernel
def rotor_speed_now(tables: DriveTables, state: FloatArray) -> float:
    """Rotor speed [rad/s]."""
    return float(tables.governed_speed + state[HELD_OFFSET] + state[DEVIATION])


@inner_kernel
def schedule_angle(tables: DriveTables, state: FloatArray, angle: float) -> float:
    """Place on the nacelle axis of the database: below 0 while the held rotor speed is lower [rad].

    Args:
        angle: Nacelle angle [rad].
    """
    return angle if state[HELD_OFFSET] == 0.0 else tables.slow_axis * state[HELD_OFFSET]


@inner_kernel
def held_moves(state: FloatArray) -> bool:
    """Whether the held rotor speed is, or is to be, another than the governed one: in most flights it never is.

    Args:
        state: Drive state.
    """
    return state[HELD_OFFSET] != 0.0 or state[HELD_SETTING] != 0.0 or state[HELD_POWER] != 0.0


@inner_kernel
def held_advance(
    tables: DriveTables, state: FloatArray, automatic: bool, angle: float, leaving: bool, dt: float
) -> None:
    """Move the held rotor speed over one frame: down only while the nacelles are locked on the downstop.

    Args:
        state: Drive state, changed in place.
        automatic: Whether it comes down by itself; else it goes to its setting.
        angle: Nacelle angle [rad].
        leaving: Whether the nacelles are about to leave the downstop.
    """
    state[HELD_POWER] = 0.0
    if state[GOVERNED] == 0.0:
        if state[HELD_OFFSET] < 0.0 and state[HELD_OFFSET] + state[DEVIATION] >= 0.0:
            # Back at full speed without the governor: from here on that is what the deviation is counted from.
            state[DEVIATION] += state[HELD_OFFSET]
            state[HELD_OFFSET] = state[HELD_SETTING] = 0.0
        return
    wanted = state[HELD_SETTING]
    if automatic or leaving or angle > LOCKED:
        wanted = tables.slow_offset if automatic and angle <= LOCKED and not leaving else 0.0
        state[HELD_SETTING] = wanted
    if wanted == state[HELD_OFFSET]:
        return
    most = tables.change_rate * dt
    change = min(max(wanted - state[HELD_OFFSET], -most), most)
    state[HELD_POWER] = tables.inertia * rotor_speed_now(tables, state) * change / dt
    state[HELD_OFFSET] = wanted if abs(wanted - state[HELD_OFFSET]) <= most else state[HELD_OFFSET] + change


@inner_kernel
def engine_power(state: FloatArray, needed: float) -> float:
    """Shaft power that the engines give now [W]."""
    if state[GOVERNED] != 0.0 and state[DEVIATION] == 0.0:
        return needed + state[HELD_POWER]
    return float(state[ENGINE_POWER])


@inner_kernel
def governor_power(tables: DriveTables, state: FloatArray, needed: float) -> float:
    """Shaft power with which the governor would hold the rotor speed, or bring it back [W]."""
    speed = rotor_speed_now(tables, state)
    return float(needed - tables.inertia * speed * state[DEVIATION] / tables.recovery)


@inner_kernel
def drive_advance(
    tables: DriveTables, state: FloatArray, governed: bool, torque: float, lever: float, available: float, dt: float
) -> None:
    """Turn the rotors over one frame.

    Switching the governor off keeps the engines at the power they give; from there lever and throttle trim move it.
    Switched on again, it brings the rotors back with what the engines can give or take, and holds them where that does
    not suffice.

    Args:
        state: Drive state, changed in place.
        governed: Whether the governor is on.
        torque: Torque of both masts together [N m].
        lever: Power lever that acts, 0 to 1.
        available: Largest shaft power of both engines [W].
    """
    speed = rotor_speed_now(tables, state)
    needed = torque * speed
    present = engine_power(state, needed)
    if governed:
        state[GOVERNED] = 1.0
        if state[DEVIATION] == 0.0:
            state[ENGINE_POWER] = needed
            return
        # Limits slow the recovery down, but never undo it: a governed rotor runs away no more off its speed than on it.
        wanted = governor_power(tables, state, needed)
        state[ENGINE_POWER] = min(max(wanted, min(needed, 0.0)), max(needed, available))
    else:
        if state[GOVERNED] != 0.0:
            state[THROTTLE_OFFSET] = present - throttle_power(tables, lever)
            state[GOVERNED] = 0.0
        trim = state[THROTTLE_TRIM] * tables.power[-1]
        wanted = min(max(throttle_power(tables, lever) + state[THROTTLE_OFFSET] + trim, 0.0), available)
        state[ENGINE_POWER] = min(present + dt / (tables.lag + dt) * (wanted - present), available)
    state[DEVIATION] += dt * (state[ENGINE_POWER] - needed) / (tables.inertia * speed)
    if governed and abs(state[DEVIATION]) < _SAME_SPEED:
        state[DEVIATION] = 0.0
