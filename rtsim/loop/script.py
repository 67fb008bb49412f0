"""Scripted misuse: what a scenario's hands do to stick, lever and nacelle switch besides the pilot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rtsim.arrays import FloatArray

Channel = Literal["stick", "lever", "switch", "lateral_stick", "pedal"]
Shape = Literal["step", "doublet", "sine"]
CHANNELS: dict[Channel, int] = {"stick": 0, "lever": 1, "switch": 2, "lateral_stick": 3, "pedal": 4}
"""Channels by name, with their place in a command."""
SHAPES: dict[Shape, int] = {"step": 0, "doublet": 1, "sine": 2}
"""Shapes of pulses by name, with their number in ``rtsim.loop.script_kernels``."""
PULSE_SIZE = 7
"""Numbers of a pulse in the kernels' table."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pulse:
    """One movement of one control. SI."""

    channel: Channel
    """What is moved; ``switch`` ends the programme's nacelle motion for good."""
    start: float
    """When it begins [s]."""
    duration: float
    """How long it lasts [s]."""
    amount: float
    """Added to stick, lateral stick, pedals (-1 to 1; forward, right positive) or lever (0 to 1); nacelle rate of the
    switch [rad/s]."""
    shape: Shape = "step"
    """``step``, ``doublet`` (reverses half-way) or ``sine``."""
    period: float = 1.0
    """Period of a ``sine`` [s]."""
    replaces: bool = False
    """The amount replaces what the pilot gives instead of being added."""


def pulse_table(pulses: Sequence[Pulse]) -> FloatArray:
    """Give the script as the kernels read it, shape (pulses, PULSE_SIZE).

    Args:
        pulses: The movements, in any order; they add up where they overlap.
    """
    table = np.zeros((len(pulses), PULSE_SIZE))
    for row, pulse in zip(table, sorted(pulses, key=lambda pulse: pulse.start), strict=True):
        row[:] = (
            CHANNELS[pulse.channel],
            pulse.start,
            pulse.start + pulse.duration,
            pulse.amount,
            SHAPES[pulse.shape],
            pulse.period,
            1.0 if pulse.replaces else 0.0,
        )
    table.setflags(write=False)
    return table
