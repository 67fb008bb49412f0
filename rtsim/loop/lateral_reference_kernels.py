"""What the flight is meant to do out of the plane of symmetry, compiled: turn rate, heading, lateral velocity, line.

All of it is led by filters, so that a pilot has rates to lead his hands with. In a straight programme it is zero, and
the heading is that of the start.
"""

from __future__ import annotations

import math

from rtsim.aircraft.variables import STATE
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel
from rtsim.loop.data import PROGRAMME, REFERENCE
from rtsim.pilot.lateral_kernels import WANTED
from rtsim.programme import TURN
from rtsim.units import DEGREE, GRAVITY, KNOT

TURN_FREQUENCY = 1.5
"""Natural frequency of the critically damped filter of the turn rate [rad/s]."""
LATERAL_FREQUENCY = 0.8
"""That of the lateral velocity [rad/s]."""
LATERAL_ACCELERATION = 1.2
"""Largest acceleration of the lateral velocity asked for [m/s^2]: 7 deg of bank."""
HEADING_GAIN = 0.4
"""Turn rate per heading error [1/s]."""
HEADING_BANK = 20.0 * DEGREE
"""Bank of the turn onto a heading [rad]."""
HEADING_TURN_RATE = 12.0 * DEGREE
"""Fastest turn onto a heading [rad/s]: in hover a turn needs no bank."""
LINE_RATE = 0.12
"""Rate at which the pilot closes in on his line [1/s]."""
LARGEST_CUT = 20.0 * DEGREE
"""Largest angle between heading and line [rad]."""
LARGEST_CLOSING = 3.0
"""Fastest sideward closing in [m/s]."""
BY_HEADING = (25.0 * KNOT, 45.0 * KNOT)
"""Airspeeds between which the line is held less and less by sideward flight and more and more by the heading [m/s]."""


@inner_kernel
def turn_wanted(programme: FloatArray, low: int, share: float) -> tuple[float, float, float, float]:
    """What the programme asks for at what ``programme_at`` found.

    Args:
        programme: The programme's points.
        low: Number of the point before the time.
        share: Share of the way to the next.

    Returns:
        One of ``TURN`` and its value, lateral airspeed, whether a line is held.
    """
    last = programme.shape[1] - 1
    if low == last:
        return (
            programme[PROGRAMME.turn_kind, last],
            programme[PROGRAMME.turn, last],
            programme[PROGRAMME.lateral, last],
            programme[PROGRAMME.track, last],
        )
    kind, goal = programme[PROGRAMME.turn_kind, low + 1], programme[PROGRAMME.turn, low + 1]
    start = goal if kind == TURN.heading else 0.0
    if programme[PROGRAMME.turn_kind, low] == kind:
        start = programme[PROGRAMME.turn, low]
    before = programme[PROGRAMME.lateral, low]
    lateral = before + share * (programme[PROGRAMME.lateral, low + 1] - before)
    return kind, start + share * (goal - start), lateral, programme[PROGRAMME.track, low + 1]


@inner_kernel
def _nearest(angle: float) -> float:
    """An angle between -pi and pi."""
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@inner_kernel
def _jerk(reference: FloatArray, turn_rate: float) -> float:
    """Rate of the turn acceleration on the way to a turn rate [rad/s^3]."""
    frequency = TURN_FREQUENCY
    missing = turn_rate - reference[REFERENCE.turn_rate]
    return float(frequency * (frequency * missing - 2.0 * reference[REFERENCE.turn_acceleration]))


@inner_kernel
def _asked(
    reference: FloatArray, asked: tuple[float, float, float, float], x: FloatArray, wind_right: float
) -> tuple[float, float]:
    """Turn rate and lateral velocity that the filters lead to.

    Args:
        reference: ``REFERENCE``.
        asked: From ``turn_wanted``.
        x: Aircraft state: where it is.
        wind_right: Wind to the right of the heading [m/s].
    """
    kind, value, lateral, track = asked
    speed = max(reference[REFERENCE.airspeed], 1.0)
    cut = 0.0
    if track != 0.0:
        sine, cosine = math.sin(reference[REFERENCE.line_course]), math.cos(reference[REFERENCE.line_course])
        north, east = x[STATE.north] - reference[REFERENCE.line_north], x[STATE.east] - reference[REFERENCE.line_east]
        off = east * cosine - north * sine
        by_heading = min(max((speed - BY_HEADING[0]) / (BY_HEADING[1] - BY_HEADING[0]), 0.0), 1.0)
        drift = math.asin(min(max(wind_right / speed, -0.5), 0.5))
        cut = -by_heading * min(max(math.atan(LINE_RATE * off / speed) + drift, -LARGEST_CUT), LARGEST_CUT)
        lateral -= (1.0 - by_heading) * (wind_right + min(max(LINE_RATE * off, -LARGEST_CLOSING), LARGEST_CLOSING))
    if kind == TURN.bank:
        turn_rate = GRAVITY * math.tan(value) / speed
    elif kind == TURN.rate:
        turn_rate = value
    else:
        turn_rate = HEADING_GAIN * _nearest(value - reference[REFERENCE.heading])
    if (track != 0.0 and value == 0.0) or (kind == TURN.heading and track != 0.0):
        turn_rate = HEADING_GAIN * _nearest(reference[REFERENCE.line_course] + cut - reference[REFERENCE.heading])
    if kind == TURN.heading or track != 0.0:
        limit = min(GRAVITY * math.tan(HEADING_BANK) / speed, HEADING_TURN_RATE)
        turn_rate = min(max(turn_rate, -limit), limit)
    return turn_rate, lateral


@inner_kernel
def fill_wanted(
    reference: FloatArray,
    asked: tuple[float, float, float, float],
    x: FloatArray,
    wind_right: float,
    wanted: FloatArray,
) -> None:
    """Fill what the pilot's lateral half is asked for in this frame.

    Args:
        reference: ``REFERENCE``.
        asked: From ``turn_wanted``.
        x: Aircraft state.
        wind_right: Wind to the right of the heading [m/s].
        wanted: Written: ``WANTED``.
    """
    turn_rate, _ = _asked(reference, asked, x, wind_right)
    wanted[WANTED.heading] = reference[REFERENCE.heading]
    wanted[WANTED.turn_rate] = reference[REFERENCE.turn_rate]
    wanted[WANTED.turn_acceleration] = reference[REFERENCE.turn_acceleration]
    wanted[WANTED.turn_jerk] = _jerk(reference, turn_rate)
    wanted[WANTED.lateral_velocity] = reference[REFERENCE.lateral]
    wanted[WANTED.lateral_acceleration] = reference[REFERENCE.lateral_rate]
    wanted[WANTED.airspeed] = reference[REFERENCE.airspeed]


@inner_kernel
def move_lateral_reference(
    reference: FloatArray, asked: tuple[float, float, float, float], x: FloatArray, wind_right: float, dt: float
) -> None:
    """Move the references to the next frame.

    Args:
        reference: ``REFERENCE``, changed.
        asked: From ``turn_wanted``.
        x: Aircraft state.
        wind_right: Wind to the right of the heading [m/s].
    """
    if asked[3] != 0.0 and reference[REFERENCE.on_track] == 0.0:
        reference[REFERENCE.line_north], reference[REFERENCE.line_east] = x[STATE.north], x[STATE.east]
        reference[REFERENCE.line_course] = asked[1] if asked[0] == TURN.heading else reference[REFERENCE.heading]
    reference[REFERENCE.on_track] = asked[3]
    turn_rate, lateral = _asked(reference, asked, x, wind_right)
    before = reference[REFERENCE.turn_rate]
    reference[REFERENCE.turn_acceleration] += dt * _jerk(reference, turn_rate)
    reference[REFERENCE.turn_rate] += dt * reference[REFERENCE.turn_acceleration]
    reference[REFERENCE.heading] += 0.5 * dt * (before + reference[REFERENCE.turn_rate])
    missing = lateral - reference[REFERENCE.lateral]
    change = LATERAL_FREQUENCY * (LATERAL_FREQUENCY * missing - 2.0 * reference[REFERENCE.lateral_rate])
    rate = reference[REFERENCE.lateral_rate] + dt * change
    reference[REFERENCE.lateral_rate] = min(max(rate, -LATERAL_ACCELERATION), LATERAL_ACCELERATION)
    reference[REFERENCE.lateral] += dt * reference[REFERENCE.lateral_rate]
