"""What may be asked of flaps and throttle, checked and written into their states."""

from __future__ import annotations

from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.systems.drive_kernels import THROTTLE_TRIM
from rtsim.systems.flap_kernels import FLAP_SETTING, FlapTables, flap_now
from rtsim.units import deg, to_deg

SAME_FLAP = deg(0.5)
"""Flaps closer than this to a setting are at it [rad]."""
MOST_THROTTLE_TRIM = 0.5
"""Largest throttle trim, as a share of full power."""


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
