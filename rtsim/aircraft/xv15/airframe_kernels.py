"""Wing, fuselage, pylons, spinners, jets: force along body x and z [N], moment about the centre of gravity.

What acts on one half of the aircraft is told for that half, as if it were the right one (see ``half_kernels``).

Legend:
    wing: The tables.
"""

from __future__ import annotations

import math

from rtsim.aircraft.table_kernels import curve
from rtsim.aircraft.xv15.tables import BodyTables, Configuration, WingTables
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel

Load = tuple[float, float, float]
"""Force along x and z [N], pitching moment [N m]."""
HalfLoad = tuple[float, float, float, float, float, float]
"""The same, then force along y [N], rolling and yawing moment [N m]."""


@inner_kernel
def fold(alpha: float) -> float:
    """Angle of attack folded into -90 .. 90 deg; flow from behind is treated as its mirror image (low confidence).

    Args:
        alpha: Angle of attack [rad].
    """
    if alpha > 0.5 * math.pi:
        return math.pi - alpha
    if alpha < -0.5 * math.pi:
        return -math.pi - alpha
    return alpha


@inner_kernel
def moment_arm(position: tuple[float, float], gravity_centre: tuple[float, float]) -> tuple[float, float]:
    """Arm from the centre of gravity in body axes (x forward, z down) [m].

    Args:
        position: Stationline (aft), waterline (up) [m].
        gravity_centre: The same of the centre of gravity.
    """
    return gravity_centre[0] - position[0], gravity_centre[1] - position[1]


@inner_kernel
def wind_to_body(lift: float, drag: float, u: float, w: float, arm: tuple[float, float], moment: float) -> Load:
    """Resolve lift and drag of a surface in the flow (u, w) into body axes.

    Args:
        lift: Lift, normal to the flow [N].
        drag: Drag, along the flow [N].
        u: Flow velocity along body x [m/s].
        w: Flow velocity along body z [m/s].
        arm: Arm of the point of application from the centre of gravity [m].
        moment: Pitching moment about the point of application [N m].
    """
    speed = max(math.sqrt(u * u + w * w), 1e-9)
    x = (lift * w - drag * u) / speed
    z = (-lift * u - drag * w) / speed
    return x, z, moment + arm[1] * x - arm[0] * z


@inner_kernel
def flap_bracket(nodes: FloatArray, flap: float) -> tuple[int, float]:
    """Interval of the flap settings, and weight of its upper end.

    Args:
        nodes: Published settings, ascending [rad].
        flap: Flap deflection [rad].
    """
    k = 0
    while k < 2 and flap > nodes[k + 1]:
        k += 1
    return k, min(max((flap - nodes[k]) / (nodes[k + 1] - nodes[k]), 0.0), 1.0)


@inner_kernel
def wing_coefficients(
    wing: WingTables, alpha: float, mast_fraction: float, flap: float, mach: float
) -> tuple[float, float]:
    """Lift and drag coefficient of the wing, linear in flap and in mast angle between the tables.

    Args:
        alpha: Angle of attack, wing-flap-slipstream corrected [rad].
        mast_fraction: 0 helicopter, 1 airplane.
        flap: Flap deflection [rad].
        mach: Flight Mach number.
    """
    k, part = flap_bracket(wing.flap_nodes, flap)
    folded = fold(alpha)
    lift = 0.0
    drag = 0.0
    for end in range(2):
        weight_end = mast_fraction if end == 0 else 1.0 - mast_fraction
        for step in range(2):
            weight = weight_end * (part if step == 1 else 1.0 - part)
            if weight != 0.0:
                row = 4 * end + k + step
                lift += weight * curve(wing.lift, row, folded)
                drag += weight * curve(wing.drag, row, folded)
    if folded != alpha:
        # Lift is normal to the flow on the side given by the flow's direction: mirrored flow, mirrored lift.
        lift = -lift
    lift *= 1.0 + wing.mach_gain * mast_fraction * min(max((mach - 0.2) / 0.2, 0.0), 1.0)
    return lift, drag


@inner_kernel
def wing_angle_of_attack(
    wing: WingTables, alpha: float, nacelle: float, advance_ratio: float, rotor_force_coefficient: float
) -> float:
    """Fuselage angle of attack less the rotors' induced change at the wing (alpha_WFS of NASA CR-166536).

    Args:
        alpha: Fuselage angle of attack [rad].
        advance_ratio: Airspeed over tip speed.
        rotor_force_coefficient: Force of both rotors over density, pi, tip speed squared, radius squared.
    """
    mast = 0.5 * math.pi - nacelle
    upwash = wing.upwash[0] + wing.upwash[1] * mast + wing.upwash[2] * mast * mast
    return alpha - upwash * rotor_force_coefficient / max(0.15, advance_ratio) ** 2


@inner_kernel
def immersed_share(wing: WingTables, airspeed: float) -> float:
    """How much of the hover download is left at this airspeed, 1 to 0."""
    ratio = min(abs(airspeed) / wing.immersed_fade_speed, 1.0)
    return (1.0 - ratio * ratio) ** 2


@inner_kernel
def wing_load(
    wing: WingTables,
    air: Configuration,
    flow: tuple[float, float, float],
    setting: tuple[float, float, float],
    arm: tuple[float, float],
) -> Load:
    """The wing outside the rotors' wakes.

    Args:
        air: Density and speed of sound.
        flow: u, w and pitch rate [m/s, rad/s].
        setting: Nacelle angle [rad], flap [rad], wing angle of attack [rad].
        arm: Arm of the aerodynamic centre [m].
    """
    u, w, q = flow
    nacelle, flap, alpha = setting
    u_local = u + q * arm[1]
    w_local = w - q * arm[0]
    speed_squared = u_local * u_local + w_local * w_local
    speed = math.sqrt(speed_squared)
    mast_fraction = min(max(1.0 - nacelle / (0.5 * math.pi), 0.0), 1.0)
    cl, cd = wing_coefficients(wing, alpha, mast_fraction, flap, speed / air.sound_speed)
    immersed = curve(wing.immersed_area, 0, nacelle) * immersed_share(wing, speed)
    pressure = 0.5 * air.density * speed_squared
    k, part = flap_bracket(wing.flap_nodes, flap)
    cm = (1.0 - part) * curve(wing.moment, k, nacelle) + part * curve(wing.moment, k + 1, nacelle)
    free = pressure * (wing.area - immersed)
    return wind_to_body(free * cl, free * cd, u_local, w_local, arm, pressure * wing.area * wing.chord * cm)


@inner_kernel
def download(
    wing: WingTables,
    air: Configuration,
    speed: float,
    setting: tuple[float, float],
    wake: tuple[float, float],
) -> tuple[float, float]:
    """Force along x and z on the part of one half wing in its rotor's wake [N].

    Args:
        air: Density.
        speed: Airspeed of the wing in the plane of symmetry [m/s].
        setting: Nacelle angle, flap [rad].
        wake: Mean induced velocity and axial velocity of the rotor [m/s].
    """
    nacelle, flap = setting
    immersed = 0.5 * (curve(wing.immersed_area, 0, nacelle) * immersed_share(wing, speed))
    k, part = flap_bracket(wing.flap_nodes, flap)
    wake_speed = wing.immersed_velocity_factor * wake[0] + wake[1]
    broadside = -0.5 * math.pi
    normal_drag = (1.0 - part) * curve(wing.drag, 4 + k, broadside) + part * curve(wing.drag, 5 + k, broadside)
    push = 0.5 * air.density * wake_speed * abs(wake_speed) * immersed * normal_drag
    return -push * math.cos(nacelle), push * math.sin(nacelle)


@inner_kernel
def fuselage_load(body: BodyTables, air: Configuration, flow: tuple[float, float], arm: tuple[float, float]) -> Load:
    """Fuselage.

    Args:
        body: The tables.
        air: Density.
        flow: u, w [m/s].
        arm: Arm of the reference point [m].
    """
    u, w = flow
    pressure = 0.5 * air.density * (u * u + w * w)
    alpha = math.atan2(w, u)
    folded = fold(alpha)
    lift = pressure * curve(body.fuselage, 0, folded)
    if abs(alpha) > 0.5 * math.pi:
        lift = 0.0
    drag = pressure * curve(body.fuselage, 1, folded)
    return wind_to_body(lift, drag, u, w, arm, pressure * curve(body.fuselage, 2, folded))


@inner_kernel
def force_at(force: tuple[float, float, float], place: tuple[float, float, float]) -> HalfLoad:
    """A force at a place, with its moments about the centre of gravity.

    Args:
        force: Along body x, y, z [N].
        place: From the centre of gravity [m].
    """
    x, y, z = force
    return x, z, place[2] * x - place[0] * z, y, place[1] * z - place[2] * y, place[0] * y - place[1] * x


@inner_kernel
def drag_load(area: float, air: Configuration, flow: tuple[float, float], arm: tuple[float, float]) -> Load:
    """What only resists in the plane of symmetry: its drag along the flow.

    Args:
        area: Drag area [m^2].
        air: Density.
        flow: Flow at the place, along body x and z [m/s].
        arm: Arm of the place [m].
    """
    u, w = flow
    pull = -0.5 * air.density * area * math.sqrt(u * u + w * w)
    x, z = pull * u, pull * w
    return x, z, arm[1] * x - arm[0] * z


@inner_kernel
def pylon_load(
    body: BodyTables,
    air: Configuration,
    flow: tuple[float, float, float],
    setting: tuple[float, float, float],
    wake: float,
    place: tuple[float, float, float],
) -> HalfLoad:
    """One pylon in the whole flow about it in its own plane: free stream and rotor wake (NASA CR-166536 table 4-XV).

    Flow across that plane meets its side as a flat plate (D_PLAT of the same source, whose dynamic pressure is taken
    to be that of the sideward velocity alone: with the whole one the drag in conversion would double).

    Args:
        body: The tables.
        air: Density.
        flow: Flow at the pivot without the wake, along body x, y and z [m/s].
        setting: Nacelle angle [rad], angle between mast and free stream [rad], side area [m^2].
        wake: Velocity of the wake, down the mast [m/s].
        place: The pivot, from the centre of gravity [m].
    """
    nacelle, incidence, side = setting
    factor = curve(body.pylon_incidence_factor, 0, incidence)
    area = 0.5 * (curve(body.pylon_area, 0, nacelle) * factor)
    u, w = flow[0] + wake * math.cos(nacelle), flow[2] - wake * math.sin(nacelle)
    pull = -0.5 * air.density * area * math.sqrt(u * u + w * w)
    push = -0.5 * air.density * side * factor * flow[1] * abs(flow[1])
    return force_at((pull * u, push, pull * w), place)


@inner_kernel
def spinner_load(
    body: BodyTables,
    air: Configuration,
    hub: tuple[float, float, float],
    nacelle: float,
    place: tuple[float, float, float],
) -> HalfLoad:
    """One spinner and hub, in the flow at the hub.

    Args:
        body: The tables.
        air: Density.
        hub: Flow in the disc plane towards the nose and outboard, and along the mast with the induced velocity [m/s].
        place: The hub, from the centre of gravity [m].
    """
    ahead, outboard, along = hub
    across = math.sqrt(ahead * ahead + outboard * outboard)
    # Sine of the angle between mast and flow.
    sine = across / max(math.sqrt(across * across + along * along), 1e-9)
    area = 0.5 * (body.spinner_area + body.spinner_incidence_area * sine**3)
    s, c = math.sin(nacelle), math.cos(nacelle)
    u, w = ahead * s + along * c, ahead * c - along * s
    pull = -0.5 * air.density * area * math.sqrt(u * u + w * w + outboard * outboard)
    return force_at((pull * u, pull * outboard, pull * w), place)


@inner_kernel
def jet_load(body: BodyTables, power: float, airspeed: float, nacelle: float, arm: tuple[float, float]) -> Load:
    """Thrust of the engines' exhaust less the drag of the air they take in, along the mast at the pivot.

    Args:
        body: The law's constants.
        power: Shaft power of both rotors [W].
        airspeed: Airspeed [m/s].
        arm: Arm of the pivot [m].
    """
    thrust = max(body.jet_static + body.jet_per_power * power, 0.0) - body.jet_ram * airspeed
    x, z = thrust * math.cos(nacelle), -thrust * math.sin(nacelle)
    return x, z, arm[1] * x - arm[0] * z
