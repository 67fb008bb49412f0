"""Compiled prediction: where airspeed and nacelle angle go if the controls stay as they are.

The model is the rigid body (u, w, q, pitch) with the rotor and the actuators settled, linear aerodynamics about the
trim of the present airspeed and nacelle angle, and exact gravity and Coriolis terms; the nacelles follow their filter
exactly. What the model's acceleration misses now is carried along and dies away.

Legend: z = (u, w, q, pitch); c = (stick, lever); V horizontal airspeed; n nacelle angle; r nacelle command rate. In a
turn q is the pitch rate less what the turn itself needs (``turn_model``).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rtsim.arrays import FloatArray
from rtsim.command import SENSOR
from rtsim.kernels.compiled import inner_kernel
from rtsim.kernels.grid_kernels import bilinear
from rtsim.places import Places
from rtsim.units import GRAVITY

CELL = Places(
    ("state", 4),  # trim u, w, q, pitch
    ("control", 2),  # trim stick, lever
    ("air", 3),  # aerodynamic accelerations at the trim: u', w', q'
    ("a", 9),  # their derivatives with u, w, q; rows u', w', q' (3 x 3); specific force does not depend on attitude
    ("b", 9),  # their derivatives with stick, lever, nacelle rate (3 x 3)
    ("nacelle", 3),  # their derivatives with the nacelle angle
    ("torque", 7),  # mast torque at the trim, its derivatives with u, w, q, stick, lever, nacelle rate
    ("flap_c", 7),  # the same of the cosine flapping
    ("flap_s", 7),  # the same of the sine flapping
    ("gain", 8),  # regulator of the recovery: stick and lever per deviation of u, w, q, pitch (2 x 4)
    ("turn", 9),  # what each unit of load factor above 1 adds to trim, controls, torque, cosine and sine flapping
    ("side", 5),  # derivatives of the sideward acceleration with v, p, r, lateral stick, pedals
    ("roll", 5),  # the same of the rolling acceleration
    ("yaw", 5),  # the same of the yawing acceleration
    ("twist", 5),  # the same of the right mast's torque less that of both in the mean
    "load",  # load factor of the turn that the model is for: 1 until ``turn_model`` sets it
    "excess",  # load factor less 1 of the turn that the corridor is watched for
)
"""Places in one cell of ``ModelTables.cells``."""

_NO_DIRECTION = 5.0
"""Speed below which the flight has hardly a direction [m/s]."""

OUT = Places(
    "low",  # least margins to the low and the high side [m/s]
    "high",
    "low_end",  # both at the end [m/s]
    "high_end",
    "time",  # of the first crossing [s]; the horizon where there is none
    "side",  # its side: -1 low, 1 high, 0 none
)
"""Places in the result of ``roll_out``."""


class ModelTables(NamedTuple):
    """Reduced models over the grid; read-only."""

    airspeed: FloatArray
    """Airspeed axis (V,) [m/s], ascending."""
    nacelle: FloatArray
    """Nacelle axis (N,) [rad], ascending."""
    cells: FloatArray
    """Models (V, N, CELL_SIZE), see ``C_*``."""
    nacelle_frequency: float
    """Natural frequency of the nacelles' critically damped filter [rad/s]."""
    forward_stop: float
    """Smallest nacelle command angle [rad]."""
    aft_stop: float
    """Largest nacelle command angle [rad]."""
    alpha_speed: float
    """Added to the airspeed where sideslip is an angle, as for scheduling [m/s]."""
    turns: int
    """1: the aircraft moves out of its plane of symmetry too."""


class BoundaryTables(NamedTuple):
    """A corridor sampled evenly in nacelle angle, from 0 up, so that a look-up needs no search; read-only."""

    spacing: float
    """Distance of the samples [rad]; every corner of a published boundary is a sample."""
    low: FloatArray
    """Low-speed side, shape (n,) [m/s]."""
    high: FloatArray
    """High-speed side off the downstop, shape (n,) [m/s]."""
    downstop_nacelle: float
    """At and below this angle the nacelles rest on the downstop [rad]."""
    downstop_speed: float
    """High-speed side on the downstop [m/s]."""
    turn_low: FloatArray
    """What the low-speed side gains for each unit of load factor above 1, shape (n,) [m/s]."""
    turn_high: FloatArray
    """The same of the high-speed side off the downstop, negative or 0, shape (n,) [m/s]."""


@inner_kernel
def speed_range(tables: BoundaryTables, angle: float, excess: float) -> tuple[float, float]:
    """Lowest and highest allowed airspeed at a nacelle angle [m/s].

    Args:
        angle: Nacelle angle [rad].
        excess: Load factor of the turn less 1.
    """
    place = min(max(angle / tables.spacing, 0.0), tables.low.shape[0] - 1.000001)
    k = int(place)
    share = place - k
    low = tables.low[k] + share * (tables.low[k + 1] - tables.low[k])
    high = tables.high[k] + share * (tables.high[k + 1] - tables.high[k])
    if excess != 0.0:
        low += excess * tables.turn_low[k]
        high += excess * tables.turn_high[k]
    return low, tables.downstop_speed if angle <= tables.downstop_nacelle else high


@inner_kernel
def model_at(tables: ModelTables, airspeed: float, nacelle: float, out: FloatArray) -> None:
    """Interpolate the model of straight flight, bilinear; outside the grid the nearest point holds.

    Args:
        out: Written: one cell, shape (CELL_SIZE,).
    """
    bilinear(tables, tables.cells, airspeed, nacelle, CELL.load, out)
    out[CELL.load], out[CELL.excess] = 1.0, 0.0


@inner_kernel
def turn_model(cell: FloatArray, load: float, excess: float) -> None:
    """Make a model that of a turn: trim, controls, torque and flapping are those of the load it carries.

    In its own plane of symmetry the turning aircraft flies straight, and weighs more by the load factor; pitch is its
    angle of attack and the climb above, and the pitch rate that the turn itself needs takes no part (``turn_motion``).

    Args:
        cell: The model of level flight; changed in place.
        load: Load factor of the turn now.
        excess: Load factor less 1 for which the corridor is watched: of the turn that is begun.
    """
    cell[CELL.load], cell[CELL.excess] = load, excess
    more = load - 1.0
    before = cell[CELL.state + 3]
    for k in range(4):
        cell[CELL.state + k] += more * cell[CELL.turn + k]
    cell[CELL.control] += more * cell[CELL.turn + 4]
    cell[CELL.control + 1] += more * cell[CELL.turn + 5]
    cell[CELL.torque] += more * cell[CELL.turn + 6]
    cell[CELL.flap_c] += more * cell[CELL.turn + 7]
    cell[CELL.flap_s] += more * cell[CELL.turn + 8]
    pitch = cell[CELL.state + 3]
    cell[CELL.air] += GRAVITY * (load * math.sin(pitch) - math.sin(before))
    cell[CELL.air + 1] -= GRAVITY * (load * math.cos(pitch) - math.cos(before))


@inner_kernel
def turn_motion(sensors: FloatArray) -> tuple[float, float, float, float]:
    """What a turning aircraft does in its own plane of symmetry, as if it flew straight there: u, w, q, pitch.

    Args:
        sensors: What is known, order of ``rtsim.command.Sensors``.
    """
    airspeed, pitch, climb = sensors[SENSOR.airspeed], sensors[SENSOR.pitch], sensors[SENSOR.climb_rate]
    sine, cosine, bank = math.sin(pitch), math.cos(pitch), sensors[SENSOR.bank]
    upright = max(math.cos(bank), 0.5)
    u, w = airspeed * cosine + climb * sine, (airspeed * sine - climb * cosine) / upright
    q = sensors[SENSOR.pitch_rate] - sensors[SENSOR.yaw_rate] * math.sin(bank) / upright
    square = u * u + w * w
    ahead = math.sqrt(max(square - climb * climb, 0.0))
    if airspeed < 0.0:
        ahead = -ahead
    # The angle that turns (u, w) into what flies ahead and what climbs; in hover there is none, and attitude stands.
    whole = math.atan2(u * climb + w * ahead, u * ahead - w * climb)
    return u, w, q, pitch + square / (square + _NO_DIRECTION**2) * (whole - pitch)


@inner_kernel
def affine(
    cell: FloatArray, place: int, z: tuple[float, float, float, float], controls: tuple[float, float], rate: float
) -> float:
    """Settled value of an output: its trim value plus derivatives times deviations.

    Args:
        cell: The model.
        place: ``CELL.torque``, ``CELL.flap_c`` or ``CELL.flap_s``.
        z: u, w [m/s], q [rad/s], pitch [rad].
        controls: Stick and lever.
        rate: Nacelle rate [rad/s].
    """
    return float(
        cell[place]
        + cell[place + 1] * (z[0] - cell[CELL.state])
        + cell[place + 2] * (z[1] - cell[CELL.state + 1])
        + cell[place + 3] * (z[2] - cell[CELL.state + 2])
        + cell[place + 4] * (controls[0] - cell[CELL.control])
        + cell[place + 5] * (controls[1] - cell[CELL.control + 1])
        + cell[place + 6] * rate
    )


@inner_kernel
def accelerations(
    cell: FloatArray,
    z: tuple[float, float, float, float],
    controls: tuple[float, float],
    nacelle: tuple[float, float],
) -> tuple[float, float, float, float, float]:
    """Rates of u, w, q and of the horizontal airspeed, and the airspeed itself.

    Args:
        cell: The model.
        z: u, w [m/s], q [rad/s], pitch [rad].
        controls: Stick and lever.
        nacelle: Nacelle angle minus that of the model [rad], nacelle rate [rad/s].
    """
    u, w, q, pitch = z
    du, dw, dq = u - cell[CELL.state], w - cell[CELL.state + 1], q - cell[CELL.state + 2]
    ds, dl = controls[0] - cell[CELL.control], controls[1] - cell[CELL.control + 1]
    dn, rate = nacelle
    a = (
        cell[CELL.air] + cell[CELL.a] * du + cell[CELL.a + 1] * dw + cell[CELL.a + 2] * dq
        + cell[CELL.b] * ds + cell[CELL.b + 1] * dl + cell[CELL.b + 2] * rate + cell[CELL.nacelle] * dn
    )  # fmt: skip
    b = (
        cell[CELL.air + 1] + cell[CELL.a + 3] * du + cell[CELL.a + 4] * dw + cell[CELL.a + 5] * dq
        + cell[CELL.b + 3] * ds + cell[CELL.b + 4] * dl + cell[CELL.b + 5] * rate + cell[CELL.nacelle + 1] * dn
    )  # fmt: skip
    m = (
        cell[CELL.air + 2] + cell[CELL.a + 6] * du + cell[CELL.a + 7] * dw + cell[CELL.a + 8] * dq
        + cell[CELL.b + 6] * ds + cell[CELL.b + 7] * dl + cell[CELL.b + 8] * rate + cell[CELL.nacelle + 2] * dn
    )  # fmt: skip
    sine, cosine, weight = math.sin(pitch), math.cos(pitch), GRAVITY * cell[CELL.load]
    # The Coriolis terms turn the velocity with the body and leave the horizontal airspeed alone.
    airspeed_rate = a * cosine + b * sine
    return (
        a - weight * sine - q * w,
        b + weight * cosine + q * u,
        m,
        airspeed_rate,
        u * cosine + w * sine,
    )


@inner_kernel
def roll_out(
    tables: ModelTables,
    corridor: BoundaryTables,
    cell: FloatArray,
    start: tuple[float, float, float, float],
    controls: tuple[float, float],
    nacelle: tuple[float, float, float],
    motion: tuple[float, float],
    bias: tuple[float, float],
    time: tuple[float, float],
    pitch_guard: tuple[float, float],
    out: FloatArray,
) -> None:
    """Fly the model ahead with controls held, and find how near the corridor's boundaries it comes.

    Args:
        tables: Axes and nacelle filter.
        corridor: The boundaries.
        cell: The model at the present condition.
        start: u, w [m/s], q [rad/s], pitch [rad] now.
        controls: Stick and lever, held.
        nacelle: Command angle [rad], angle [rad], rate [rad/s] now.
        motion: Nacelle command rate [rad/s], and how long it is applied before the nacelles are stopped [s].
        bias: Acceleration the model misses now [m/s^2] and the time constant with which it dies away [s].
        time: Step and horizon [s].
        pitch_guard: Attitude [rad] that whoever flies is taken not to pass, and how sharply it may be approached
            [rad/s]: a stick deflection is not held until the aircraft stands on its tail.
        out: Written: ``OUT_*``.
    """
    u, w, q, pitch = start
    command, angle, rate = nacelle
    wanted, hold = motion
    missing, decay = bias
    step, horizon = time
    steepest, sharpness = pitch_guard
    here = angle
    f = tables.nacelle_frequency
    settle = math.exp(-f * step)
    fade = math.exp(-step / decay)
    carried = 0.0  # airspeed gained from what the model misses
    out[OUT.time] = horizon
    out[OUT.side] = 0.0
    out[OUT.low], out[OUT.high] = 1e9, 1e9
    before = 0.0
    for k in range(int(horizon / step + 0.5) + 1):
        a, b, m, _, airspeed = accelerations(cell, (u, w, q, pitch), controls, (angle - here, rate))
        airspeed += carried
        slowest, fastest = speed_range(corridor, angle, cell[CELL.excess])
        low, high = airspeed - slowest, fastest - airspeed
        margin = min(low, high)
        out[OUT.low] = min(out[OUT.low], low)
        out[OUT.high] = min(out[OUT.high], high)
        out[OUT.low_end], out[OUT.high_end] = low, high
        if margin < 0.0 and out[OUT.side] == 0.0:
            share = before / (before - margin) if k > 0 and before > margin else 0.0
            out[OUT.time] = (k - 1 + share) * step if k > 0 else 0.0
            out[OUT.side] = -1.0 if low < high else 1.0
        before = margin
        # Semi-implicit: the fast pitch motion first, so that a step of a tenth of a second stays stable.
        up = sharpness * (sharpness * (steepest - pitch) - 2.0 * q)
        down = -sharpness * (sharpness * (steepest + pitch) + 2.0 * q)
        q += step * min(max(m, down), up)
        pitch += step * q
        u += step * a
        w += step * b
        carried += step * missing
        missing *= fade
        # The nacelles' critically damped filter of a ramp, in closed form (rtsim.kernels.ramp_filter_kernels).
        r = wanted if k * step < hold - 1e-9 else 0.0
        if command + r * step < tables.forward_stop:
            r = (tables.forward_stop - command) / step
        elif command + r * step > tables.aft_stop:
            r = (tables.aft_stop - command) / step
        lag = 2.0 * r / f
        e = angle - command + lag
        d = rate - r
        g = d + f * e
        command += r * step
        angle = command - lag + (e + g * step) * settle
        rate = r + (d - f * g * step) * settle
