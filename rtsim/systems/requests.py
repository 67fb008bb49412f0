"""What may be asked of flaps, throttle and rotor speed, checked and written into their states."""

from __future__ import annotations

from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.systems.drive_kernels import HELD_SETTING, LOCKED, THROTTLE_TRIM, DriveTables
from rtsim.systems.flap_kernels import FLAP_SETTING, FlapTables, flap_now
from rtsim.units import deg, to_deg, to_rpm

SAME_FLAP = deg(0.5)
"""Flaps closer than this to a setting are at it [rad]."""
MOST_THROTTLE_TRIM = 0.5
"""Largest throttle trim, as a share of full power."""
_SAME_SPEED = 5e-3
"""A rotor speed this little beyond its range is at its end [rad/s]."""


def check_flap_setting(tables: FlapTables, angle: float) -> None:
    """Refuse a setting that the flaps cannot go to.

    Args:
        angle: Flap deflection [rad].

    Raises:
        InputError: The angle is outside their travel.
    """
    low, high = float(tables.nodes[0]), float(tables.nodes[-1])
    if not low <= angle <= high:
        raise InputError(
            "is outside the travel of the flaps",
            key="flaps",
            value=f"{to_deg(angle):.9g} deg",
            allowed=f"{to_deg(low):g} to {to_deg(high):g} deg",
            mend="angles are in radians: rtsim.units.deg converts",
        )


def flap_setting(state: FloatArray, scheduled: float) -> float:
    """Deflection that the flaps go to or stand at [rad].

    Args:
        scheduled: Deflection of the schedule [rad].
    """
    setting = float(state[FLAP_SETTING])
    return setting if setting >= 0.0 else float(flap_now(state, scheduled))


def next_flap_setting(tables: FlapTables, present: float, step: int) -> float:
    """The published setting beyond a deflection [rad]; beyond the last one, that one.

    Args:
        present: A deflection [rad].
        step: 1 down (more flap), -1 up.
    """
    nodes = tables.nodes
    beyond = nodes[nodes > present + SAME_FLAP] if step > 0 else nodes[nodes < present - SAME_FLAP][::-1]
    return float(beyond[0] if beyond.size else nodes[-1 if step > 0 else 0])


def trim_throttle(state: FloatArray, share: float) -> None:
    """Trim the throttle.

    Args:
        state: Drive state; changed in place.
        share: Engine power to add to that of the power lever, as a share of full power.

    Raises:
        InputError: The share is out of range.
    """
    if not -MOST_THROTTLE_TRIM <= share <= MOST_THROTTLE_TRIM:
        raise InputError(
            "is out of range",
            key="throttle trim",
            value=share,
            allowed=f"{-MOST_THROTTLE_TRIM:g} to {MOST_THROTTLE_TRIM:g} of full power",
        )
    state[THROTTLE_TRIM] = share


def check_slow_rotors(tables: DriveTables) -> None:
    """Refuse a rotor speed of airplane mode where the aircraft has none.

    Raises:
        InputError: The database has one rotor speed.
    """
    if tables.slow_offset == 0.0:
        raise InputError(
            "cannot be switched on: the database has one rotor speed",
            key="automatic_rotor_speed",
            value="on",
            allowed="off",
            mend="give it rows of lower rotor speed below nacelle 0 (docs/lpv.md)",
        )


def held_offset(tables: DriveTables, speed: float, nacelle: float) -> float:
    """What a rotor speed to hold is less than the governed one [rad/s].

    Args:
        speed: Rotor speed to hold [rad/s].
        nacelle: Nacelle angle [rad].

    Raises:
        InputError: The speed is out of range, or the nacelles do not stand on the downstop.
    """
    offset = speed - tables.governed_speed
    low, high = to_rpm(tables.governed_speed + tables.slow_offset), to_rpm(tables.governed_speed)
    if not tables.slow_offset - _SAME_SPEED <= offset <= _SAME_SPEED:
        allowed = f"{low:.4g} to {high:.4g} rpm" if tables.slow_offset else f"{high:.4g} rpm: the database has no other"
        raise InputError("is out of range", key="rotor_rpm", value=f"{to_rpm(speed):.6g} rpm", allowed=allowed)
    offset = min(max(offset, tables.slow_offset), 0.0)
    if offset < 0.0 and nacelle > LOCKED:
        raise InputError(
            "needs the nacelles on the downstop",
            key="rotor_rpm",
            value=f"{to_rpm(speed):.6g} rpm at nacelle {to_deg(nacelle):.4g} deg",
            allowed=f"{high:.4g} rpm off it",
            mend="move the nacelles to 0 deg first",
        )
    return offset


def set_held_speed(tables: DriveTables, state: FloatArray, speed: float, nacelle: float) -> None:
    """Give a rotor speed to hold.

    Args:
        state: Drive state; changed in place.
        speed: Rotor speed to hold [rad/s].
        nacelle: Nacelle angle [rad].

    Raises:
        InputError: The speed is out of range, or the nacelles do not stand on the downstop.
    """
    state[HELD_SETTING] = held_offset(tables, speed, nacelle)
