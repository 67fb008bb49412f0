"""Parameters of what acts out of the plane of symmetry, as the kernels read them: SI, radians."""

from __future__ import annotations

from typing import NamedTuple

from rtsim.aircraft.table_kernels import Curves, Surfaces
from rtsim.arrays import FloatArray


class HalfTables(NamedTuple):
    """Where the halves of the aircraft stand, and what meets only one of them."""

    hub: float
    """Distance of a hub from the plane of symmetry [m]."""
    wake: float
    """The same of the place where a rotor's wake loads the wing [m]."""
    tilt: float
    """Outboard tilt of the masts [rad]."""
    rotation: float
    """1: the blades advance outboard; -1: inboard."""
    interference: Curves
    """Share of the upwind rotor's inflow that meets the downwind rotor against sideward advance ratio (X_SF)."""
    pylon_area: float
    """Side area of one pylon [m^2]."""


class SideslipTables(NamedTuple):
    """Fuselage and horizontal tail in sideslip."""

    fuselage: Curves
    """Against the size of the sideslip angle: side force, roll and yaw moment (odd), increments of lift, drag and pitch
    moment (even), over dynamic pressure [m^2, m^3]."""
    tail_wake: Curves
    """Factor on the rotor wake at the tail against the size of the sideslip: rows as ``TailTables.wake_nacelle``."""
    tail_lift: float
    """Change of the tail's lift coefficient with the size of the sideslip [1/rad]."""
    rounding: float
    """Sideslip over which its size is rounded [rad]."""


class WingSideTables(NamedTuple):
    """Wing and pylons: lateral coefficients and ailerons."""

    span: float
    """Span [m]."""
    aspect_ratio: float
    """Span squared over area."""
    roll_sideslip: Curves
    """C_l_beta at no lift, rows F0 F20 F40 F75, then its growth with CL, the same rows; argument nacelle angle."""
    yaw_sideslip: FloatArray
    """C_n_beta at no lift, and its growth with CL^2."""
    roll_roll: float
    """C_l_p at no lift and Mach 0."""
    lift_slope: Curves
    """Slope of the lift at no lift [1/rad], rows F0 F20 F40 F75; argument nacelle angle."""
    profile_drag: Curves
    """CD at no lift, the same rows."""
    roll_yaw: FloatArray
    """C_l_r per CL, and its growth with flap [1/rad]."""
    yaw_roll: float
    """C_n_p per CL."""
    yaw_yaw: FloatArray
    """C_n_r per CL^2, and per CD at no lift."""
    sweep: float
    """Sweep of the quarter chord, back positive [rad]."""
    aileron_roll: Curves
    """C_l per aileron angle [1/rad], rows F0 F20 F40 F75; argument nacelle angle."""
    aileron_yaw: Curves
    """C_n per aileron angle: constant rows F0 F20 F40 F75 [1/rad], then the factor on CL C_l, the same rows."""
    aileron_lift: FloatArray
    """Lift coefficient lost per aileron angle at the flap settings [1/rad]."""
    aileron_fade: FloatArray
    """Angles of attack of the wing between which the ailerons lose their effect [rad]."""
    rounding: float
    """Aileron angle over which its size is rounded [rad]."""


class FinTables(NamedTuple):
    """One vertical fin with its rudder."""

    area: float
    """Area [m^2]."""
    position: FloatArray
    """Stationline, waterline, distance from the plane of symmetry [m]."""
    pressure: float
    """Dynamic pressure at the fin over that of the free stream."""
    force: Surfaces
    """Side-force coefficient against the fin's sideslip (from 0) and rudder angle [rad]."""
    drag: Curves
    """Drag coefficient less that at no sideslip, against the size of the fin's sideslip [rad]."""
    mach_gain: float
    """Relative increase of the slope at Mach 0.4."""
    sidewash: Surfaces
    """1 less the sidewash slope against angle of attack and size of the sideslip: rows mast 0, 30, 60, 90 deg, each F0
    F20 F40 F75."""
    sidewash_nacelle: FloatArray
    """Nacelle angles of these rows [rad], descending."""
    rotor_sidewash: Surfaces
    """K_betaR of the rotors against forward airspeed [m/s] and size of the sideslip."""
    rotor_sidewash_nacelle: FloatArray
    """Nacelle angles at which it is gone, and at which it acts in full [rad]."""
    roll_sidewash: float
    """Change of the fin's sideslip with roll rate times span over twice the airspeed."""
    least_speed: float
    """The forward speed that a fin's sideslip is taken with is not below this [m/s]."""


class LateralControlTables(NamedTuple):
    """Mixing of lateral stick and pedals."""

    collective_per_stick: Curves
    """Differential collective per full lateral stick [rad] against nacelle angle; right stick lowers the right one."""
    cyclic_per_pedal: Surfaces
    """Differential longitudinal cyclic per full pedal [rad] against airspeed [m/s] and nacelle angle."""
    aileron_per_stick: float
    """Aileron per full lateral stick [rad]."""
    rudder_per_pedal: float
    """Rudder per full pedal [rad]."""
    actuator_rate: float
    """Inverse time constant of the actuators [1/s]."""


class LateralMassTables(NamedTuple):
    """Moments of inertia of roll and yaw, as the nacelles tilt: values at nacelle angle 0, and slopes [1/rad]."""

    roll: FloatArray
    """Ixx [kg m^2]."""
    yaw: FloatArray
    """Izz."""
    product: FloatArray
    """Ixz, the integral of x z dm."""


class LateralTables(NamedTuple):
    """Everything that acts out of the plane of symmetry."""

    half: HalfTables
    """The halves."""
    sideslip: SideslipTables
    """Fuselage and tail."""
    wing: WingSideTables
    """Wing and ailerons."""
    fin: FinTables
    """Fins and rudders."""
    controls: LateralControlTables
    """Mixing and actuators."""
    mass: LateralMassTables
    """Inertia."""
