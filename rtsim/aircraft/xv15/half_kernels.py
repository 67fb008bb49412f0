"""One half of the aircraft: rotor, spinner, pylon, immersed wing and fin of the right side.

The left half is the same function called with mirrored arguments: in a mirror the sideward velocity, the rates of roll
and yaw and the rudder change their sign, and so do the force along y and the moments of roll and yaw that come back.
Equal halves therefore give equal numbers to the last bit.

Legend:
    half: Where the halves stand.
    air: Density, speed of sound, rotor speed.
    nacelle: Nacelle angle [rad].
    out: Written: ``HALF``.
"""

from __future__ import annotations

import math

from rtsim.aircraft.table_kernels import curve
from rtsim.aircraft.xv15.airframe_kernels import HalfLoad, download, force_at, pylon_load, spinner_load
from rtsim.aircraft.xv15.fin_kernels import fin_load
from rtsim.aircraft.xv15.flow import Air, Blades, Frame, Motion
from rtsim.aircraft.xv15.lateral_tables import HalfTables
from rtsim.aircraft.xv15.rotor_kernels import (
    FORWARD_FORCE,
    LOAD_COUNT,
    OUTBOARD_FORCE,
    THRUST,
    TORQUE,
    Hub,
    flapping_accelerations,
    inflow_rates_near_ground,
    rotor_loads_in,
)
from rtsim.aircraft.xv15.tables import AircraftTables, Configuration
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel
from rtsim.places import Places

HALF = Places(
    ("rotor", LOAD_COUNT),  # as rtsim.aircraft.xv15.rotor_kernels writes them
    ("hub", 6),  # flow and rates at the hub, as the rotor takes them
    ("rotors", 6),  # loads as HalfLoad
    ("spinners", 6),
    ("pylons", 6),
    ("wake", 2),  # force along x and z of the wake on the wing [N]
    ("fins", 6),
)
"""What a half tells."""


@inner_kernel
def hub_motion(half: HalfTables, motion: Motion, frame: Frame, nacelle: float) -> Hub:
    """Velocity and rates of the hub in the rotor's axes.

    Args:
        motion: Motion through the air.
        frame: Where the hub is.
    """
    sn, cn = math.sin(nacelle), math.cos(nacelle)
    st, ct = math.sin(half.tilt), math.cos(half.tilt)
    y = half.hub
    u = motion.u + motion.q * frame.hub[1] + motion.nacelle_rate * frame.drift[0] - motion.r * y
    v = motion.v + motion.r * frame.hub[0] - motion.p * frame.hub[1]
    w = motion.w - motion.q * frame.hub[0] + motion.nacelle_rate * frame.drift[1] + motion.p * y
    q = motion.q + motion.nacelle_rate
    axial, turning = u * cn - w * sn, motion.p * cn - motion.r * sn
    sense = half.rotation
    return (
        u * sn + w * cn,
        axial * ct + v * st,
        q * ct - turning * st,
        sense * (v * ct - axial * st),
        sense * (motion.p * sn + motion.r * cn),
        sense * (turning * ct + q * st),
    )


@inner_kernel
def interference(half: HalfTables, air: Configuration, radius: float, motion: Motion, other: float) -> float:
    """Velocity of the other rotor's wake through this one where the wind comes from the other side [m/s].

    Args:
        air: Rotor speed.
        radius: Rotor radius [m].
        motion: Motion through the air; moving inboard (v negative) this rotor is downwind.
        other: Mean inflow of the other rotor over tip speed.
    """
    if motion.v >= 0.0:
        return 0.0
    tip = air.rotor_speed * radius
    sideward = motion.v * motion.v
    share = sideward / (motion.u * motion.u + motion.w * motion.w + sideward)
    return curve(half.interference, 0, -motion.v / tip) * share * other * tip


@inner_kernel
def rotor_load(
    half: HalfTables,
    spring: float,
    out: FloatArray,
    flapping: tuple[float, float],
    place: tuple[float, float],
    nacelle: float,
) -> HalfLoad:
    """Loads of a rotor on the aircraft.

    Args:
        spring: Moment of the hub per gimbal tilt [N m/rad].
        out: ``HALF`` with the rotor's own loads.
        flapping: Cosine and sine flapping [rad].
        place: The hub along body x and z [m].
    """
    sn, cn = math.sin(nacelle), math.cos(nacelle)
    st, ct = math.sin(half.tilt), math.cos(half.tilt)
    thrust, forward = out[HALF.rotor + THRUST], out[HALF.rotor + FORWARD_FORCE]
    outboard = half.rotation * out[HALF.rotor + OUTBOARD_FORCE]
    along = thrust * ct - outboard * st
    x = along * cn + forward * sn
    z = -along * sn + forward * cn
    x, z, m, y, roll, yaw = force_at((x, outboard * ct + thrust * st, z), (place[0], half.hub, place[1]))
    # The gimbal's spring about o and f; the torque turns the aircraft against the blades.
    about_o, about_f = spring * flapping[0], half.rotation * spring * flapping[1]
    torque = half.rotation * out[HALF.rotor + TORQUE]
    roll -= about_f * sn - about_o * cn * st + torque * cn * ct
    yaw -= about_f * cn + about_o * sn * st - torque * sn * ct
    return x, z, m - about_o * ct - torque * st, y, roll, yaw


@inner_kernel
def half_loads(
    tables: AircraftTables,
    air: Configuration,
    motion: Motion,
    blades: Blades,
    frame: Frame,
    shared: Air,
    rudder: float,
    out: FloatArray,
    flow: FloatArray,
) -> None:
    """Loads of a half.

    Args:
        motion: Motion through the air.
        blades: The rotor.
        frame: Where things are.
        shared: What both halves share.
        rudder: Rudder [rad].
        flow: Scratch of the blade elements.
    """
    nacelle = shared.nacelle
    half, rotor = tables.lateral.half, tables.rotor
    hub = hub_motion(half, motion, frame, nacelle)
    met = interference(half, air, rotor.radius, motion, blades.other_inflow)
    hub = (hub[0], hub[1] + met, hub[2], hub[3], hub[4], hub[5])
    rotor_loads_in(rotor, air, hub, blades.flapping, blades.inflow, blades.pitch, out, flow)
    induced = blades.inflow[0] * air.rotor_speed * rotor.radius
    place = (frame.pivot[0], half.hub, frame.pivot[1])
    pivot_flow = (
        motion.u + motion.q * place[2] - motion.r * place[1],
        motion.v + motion.r * place[0] - motion.p * place[2],
        motion.w - motion.q * place[0] + motion.p * place[1],
    )
    loads = (
        rotor_load(half, rotor.hub_spring, out, (blades.flapping[2], blades.flapping[4]), frame.hub, nacelle),
        spinner_load(
            tables.body,
            air,
            (hub[0], half.rotation * hub[3], hub[1] + induced),
            nacelle,
            (frame.hub[0], half.hub, frame.hub[1]),
        ),
        pylon_load(
            tables.body,
            air,
            pivot_flow,
            (nacelle, shared.incidence, half.pylon_area),
            tables.wing.immersed_velocity_factor * induced,
            place,
        ),
    )
    for k in range(len(loads)):
        for axis in range(6):
            out[HALF.rotors + 6 * k + axis] = loads[k][axis]
    wake = download(tables.wing, air, shared.wing_speed, (nacelle, shared.flap), (induced, hub[1]))
    out[HALF.wake], out[HALF.wake + 1] = wake
    fin_setting = (rudder, shared.fin_share, shared.tail_pressure)
    fin = fin_load(tables.lateral.fin, air, motion, frame.fin, tables.lateral.wing.span, fin_setting)
    for axis in range(6):
        out[HALF.fins + axis] = fin[axis]
    for k in range(6):
        out[HALF.hub + k] = hub[k]


@inner_kernel
def half_rates(
    tables: AircraftTables,
    air: Configuration,
    blades: Blades,
    mast: tuple[float, float, float, float],
    nearness: float,
    out: FloatArray,
) -> tuple[float, float, float, float, float, float]:
    """Accelerations of coning and gimbal [rad/s^2] and rates of the inflow [1/s] of the half's rotor.

    Args:
        blades: The rotor.
        mast: As ``flapping_accelerations`` takes it.
        nearness: Ground effect.
        out: ``HALF`` as ``half_loads`` wrote it.
    """
    hub = (out[HALF.hub], out[HALF.hub + 1], out[HALF.hub + 2], out[HALF.hub + 3], out[HALF.hub + 4], out[HALF.hub + 5])
    flaps = flapping_accelerations(tables.rotor, air.rotor_speed, mast, blades.flapping, out)
    flows = inflow_rates_near_ground(tables.rotor, air, hub, blades.inflow, out, nearness)
    return flaps[0], flaps[1], flaps[2], flows[0], flows[1], flows[2]
