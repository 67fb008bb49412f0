"""Levels of handling qualities, by the boundaries of ADS-33E-PRF and MIL-F-8785C (``data/handling.toml``)."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Any, Literal

from rtsim.analysis.handling import Response
from rtsim.toml_file import shipped_toml

Axis = Literal["pitch", "roll", "yaw"]
LARGEST_PHASE_DELAY = 0.15
"""Beyond, the boundaries of the bandwidth rise with the phase delay [s]."""


@functools.cache
def boundaries() -> dict[str, Any]:
    """The boundaries with their sources."""
    return shipped_toml("rtsim/analysis/data", "handling.toml")


def bandwidth_level(axis: Axis, response: Response) -> int:
    """Level of an attitude's bandwidth: 1 to 3.

    Args:
        axis: Which attitude.
        response: Its bandwidth and phase delay; a long delay is never better than level 3.
    """
    if response.phase_delay > LARGEST_PHASE_DELAY:
        return 3
    least: list[float] = boundaries()["bandwidth"][f"{axis}_rad_s"]
    return _first(response.bandwidth >= low for low in least)


def dutch_roll_level(root: complex) -> int:
    """Level of the Dutch roll: 1 to 3, 4 beyond.

    Args:
        root: Its upper root [rad/s]; 0 where there is none, which is level 1.
    """
    if root == 0.0:
        return 1
    frequency = abs(root)
    damping = -root.real / frequency
    shown = (damping, damping * frequency, frequency)
    return _first(all(map(float.__ge__, shown, least)) for least in boundaries()["dutch_roll"]["least"])


def roll_mode_level(root: float) -> int:
    """Level of the roll mode: 1 to 3, 4 beyond.

    Args:
        root: The real root [rad/s]; nan where it is part of an oscillation, which is level 1.
    """
    if math.isnan(root):
        return 1
    constant = -1.0 / root if root < 0.0 else math.inf
    return _first(constant <= most for most in boundaries()["roll_mode"]["time_constant_s"])


def spiral_level(root: float) -> int:
    """Level of the spiral: 1 to 3, 4 beyond.

    Args:
        root: The real root [rad/s]; nan where there is none, which is level 1.
    """
    doubled = math.log(2.0) / root if root > 0.0 else math.inf
    return _first(doubled >= least for least in boundaries()["spiral"]["time_to_double_s"])


def _first(holds: Any) -> int:
    """Number of the first level that holds, one more than there are where none does."""
    found: Sequence[bool] = list(holds)
    return found.index(True) + 1 if True in found else len(found) + 1
