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
LARGEST_LEAD = 30.0 * DEGREE
"""Heading asked for less that of an aircraft that does not follow, at most [rad]: a pilot sees where his nose is."""
LINE_RATE = 0.12
"""Rate at which the pilot closes in on his line [1/s]."""
ON_LINE, TURNS_ONTO = 1.0, 2.0
"""Whether the line is held, or the flight still turns onto its course."""
ALIGNED = 3.0 * DEGREE
"""So near the heading along the line the line begins, where the aircraft is [rad]."""
LARGEST_CUT = 20.0 * DEGREE
"""Largest angle between heading and line [rad]."""
LARGEST_CLOSING = 3.0
"""Fastest closing in [m/s]."""
STANDING = 0.5 * KNOT
"""An airspeed that leaves less speed over the ground along the heading means to stand [m/s]."""
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
def beside_line(reference: FloatArray, x: FloatArray) -> float:
    """Place to the right of the line over the ground [m].

    Args:
        reference: ``REFERENCE``.
        x: Aircraft state: where it is.
    """
    return _from_point(reference, x, reference[REFERENCE.line_course])[1]


@inner_kernel
def from_point(reference: FloatArray, x: FloatArray) -> float:
    """Distance from the line's point [m].

    Args:
        reference: ``REFERENCE``.
        x: Aircraft state: where it is.
    """
    ahead, right = _from_point(reference, x, 0.0)
    return math.sqrt(ahead * ahead + right * right)


@inner_kernel
def _from_point(reference: FloatArray, x: FloatArray, direction: float) -> tuple[float, float]:
    """Place ahead of the line's point and to the right of it, seen in a direction [m]."""
    north, east = x[STATE.north] - reference[REFERENCE.line_north], x[STATE.east] - reference[REFERENCE.line_east]
    sine, cosine = math.sin(direction), math.cos(direction)
    return north * cosine + east * sine, east * cosine - north * sine


@inner_kernel
def line_by_heading(speed: float) -> float:
    """Share of the line that is held by the heading.

    Args:
        speed: Airspeed [m/s].
    """
    return min(max((speed - BY_HEADING[0]) / (BY_HEADING[1] - BY_HEADING[0]), 0.0), 1.0)


@inner_kernel
def _cut(speed: float, off: float, wind_right: float) -> float:
    """Angle between heading and line that keeps to the line, or leads back to it [rad]."""
    drift = math.asin(min(max(wind_right / speed, -0.5), 0.5))
    return -line_by_heading(speed) * min(max(math.atan(LINE_RATE * off / speed) + drift, -LARGEST_CUT), LARGEST_CUT)


@inner_kernel
def _closing(off: float) -> float:
    """Speed of closing in on a place that far away [m/s]."""
    return min(max(LINE_RATE * off, -LARGEST_CLOSING), LARGEST_CLOSING)


@inner_kernel
def _course(reference: FloatArray, asked: tuple[float, float, float, float]) -> float:
    """Course of the line: the heading asked for; else that of the flight when it began, or when its turn ended."""
    if asked[0] == TURN.heading:
        return asked[1]
    turning = asked[1] != 0.0 or reference[REFERENCE.on_track] == 0.0
    return float(reference[REFERENCE.heading] if turning else reference[REFERENCE.line_course])


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
        off = 0.0
        if reference[REFERENCE.on_track] == ON_LINE:
            standing = reference[REFERENCE.standing] != 0.0
            off = _from_point(reference, x, x[STATE.heading])[1] if standing else beside_line(reference, x)
        by_heading = line_by_heading(speed)
        cut = _cut(speed, off, wind_right)
        lateral -= (1.0 - by_heading) * (wind_right + _closing(off))
    onto = kind == TURN.heading or (track != 0.0 and value == 0.0)
    if onto:
        goal = _course(reference, asked) + cut if track != 0.0 else value
        limit = min(GRAVITY * math.tan(HEADING_BANK) / speed, HEADING_TURN_RATE)
        turn_rate = min(max(HEADING_GAIN * _nearest(goal - reference[REFERENCE.heading]), -limit), limit)
    elif kind == TURN.bank:
        turn_rate = GRAVITY * math.tan(value) / speed
    else:
        turn_rate = value
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
    _keep_line(reference, asked, x, wind_right, dt)
    turn_rate, lateral = _asked(reference, asked, x, wind_right)
    before = reference[REFERENCE.turn_rate]
    reference[REFERENCE.turn_acceleration] += dt * _jerk(reference, turn_rate)
    reference[REFERENCE.turn_rate] += dt * reference[REFERENCE.turn_acceleration]
    moved = reference[REFERENCE.heading] + 0.5 * dt * (before + reference[REFERENCE.turn_rate])
    reference[REFERENCE.heading] = min(max(moved, x[STATE.heading] - LARGEST_LEAD), x[STATE.heading] + LARGEST_LEAD)
    _follow(reference, REFERENCE.lateral, REFERENCE.lateral_rate, lateral, dt)


@inner_kernel
def _follow(reference: FloatArray, place: int, rate_place: int, goal: float, dt: float) -> None:
    """Move a lateral velocity towards its goal."""
    missing = goal - reference[place]
    change = LATERAL_FREQUENCY * (LATERAL_FREQUENCY * missing - 2.0 * reference[rate_place])
    rate = reference[rate_place] + dt * change
    reference[rate_place] = min(max(rate, -LATERAL_ACCELERATION), LATERAL_ACCELERATION)
    reference[place] += dt * reference[rate_place]


@inner_kernel
def _keep_line(
    reference: FloatArray, asked: tuple[float, float, float, float], x: FloatArray, wind_right: float, dt: float
) -> None:
    """Begin the line over the ground, turn it, and move it to the right as fast as is asked for.

    A line that is held by the heading begins where the aircraft has turned onto it.
    """
    if asked[3] == 0.0:
        reference[REFERENCE.on_track] = 0.0
        return
    speed = max(reference[REFERENCE.airspeed], 1.0)
    by_heading = line_by_heading(speed)
    course, begins = _course(reference, asked), reference[REFERENCE.on_track] == 0.0
    astray = abs(_nearest(course + _cut(speed, 0.0, wind_right) - reference[REFERENCE.heading]))
    turns = course != reference[REFERENCE.line_course] or reference[REFERENCE.on_track] == TURNS_ONTO or begins
    turns = turns and by_heading > 0.0 and astray > ALIGNED
    if begins or turns:
        reference[REFERENCE.line_north], reference[REFERENCE.line_east] = x[STATE.north], x[STATE.east]
    if begins:
        reference[REFERENCE.line_lateral] = reference[REFERENCE.lateral] + wind_right
        reference[REFERENCE.line_lateral_rate] = reference[REFERENCE.lateral_rate]
        reference[REFERENCE.standing] = 0.0
    reference[REFERENCE.on_track], reference[REFERENCE.line_course] = TURNS_ONTO if turns else ON_LINE, course
    _follow(reference, REFERENCE.line_lateral, REFERENCE.line_lateral_rate, asked[2], dt)
    way = (1.0 - by_heading) * dt * reference[REFERENCE.line_lateral]
    reference[REFERENCE.line_north] -= way * math.sin(reference[REFERENCE.heading])
    reference[REFERENCE.line_east] += way * math.cos(reference[REFERENCE.heading])


@inner_kernel
def stand_still(reference: FloatArray, track: float, x: FloatArray, ahead: float) -> float:
    """What is added to the airspeed asked for, so that an aircraft that is to stand stands over its point [m/s].

    Args:
        reference: ``REFERENCE``, changed: whether it stands; as it begins to, its point is abreast of it.
        track: Whether a line over the ground is held.
        x: Aircraft state.
        ahead: Speed over the ground that is asked for along the heading [m/s].
    """
    before = reference[REFERENCE.standing]
    stands = track != 0.0 and reference[REFERENCE.on_track] != 0.0 and abs(ahead) <= STANDING
    reference[REFERENCE.standing] = 1.0 if stands else 0.0
    if not stands:
        return 0.0
    if before == 0.0:
        sine, cosine = math.sin(x[STATE.heading]), math.cos(x[STATE.heading])
        way = _from_point(reference, x, x[STATE.heading])[0]
        reference[REFERENCE.line_north] += way * cosine
        reference[REFERENCE.line_east] += way * sine
    return -_closing(_from_point(reference, x, x[STATE.heading])[0])
