"""Parameters of the nonlinear model as the kernels read them: SI, radians, nacelle angle 90 deg = helicopter."""

from __future__ import annotations

from typing import NamedTuple

from rtsim.aircraft.table_kernels import Curves, Surfaces
from rtsim.aircraft.xv15.lateral_tables import LateralTables
from rtsim.arrays import FloatArray


class Configuration(NamedTuple):
    """What changes from one trim condition to another."""

    mass: float
    """Aircraft mass [kg]."""
    density: float
    """Air density [kg/m^3]."""
    sound_speed: float
    """Speed of sound [m/s]."""
    rotor_speed: float
    """Rotor speed that the governor holds [rad/s]."""
    flap: float
    """Flap deflection [rad]; negative means the flap schedule. The flap inputs add to it."""


class RotorTables(NamedTuple):
    """One rotor."""

    radius: float
    """Radius [m]."""
    blades: float
    """Number of blades."""
    stations: FloatArray
    """Radial stations [m]."""
    widths: FloatArray
    """Width of each radial panel [m]."""
    lifting: FloatArray
    """1 inside the tip loss radius, 0 outside."""
    chord: FloatArray
    """Chord at the stations [m]."""
    twist: FloatArray
    """Twist at the stations relative to 75 % radius [rad]."""
    root_drag: FloatArray
    """Extra drag coefficient of the thick root."""
    section_start: float
    """First angle of attack of the section tables [rad]."""
    section_step: float
    """Their spacing in angle of attack [rad]."""
    mach_start: float
    """Their first Mach number."""
    mach_step: float
    """Their spacing in Mach number."""
    section: FloatArray
    """Nodes of lift and drag coefficient, shape (stations, angles, Mach numbers, 2)."""
    cos_azimuth: FloatArray
    """Cosines of the azimuth stations (0 aft, counter-clockwise)."""
    sin_azimuth: FloatArray
    """Sines of the azimuth stations."""
    precone: float
    """Precone [rad]."""
    pitch_flap: float
    """Pitch increase per flap-up angle (delta-3)."""
    blade_inertia: float
    """Flapping inertia of one blade [kg m^2]."""
    coning_frequency_squared: float
    """Square of the coning frequency per rev at the reference rotor speed."""
    hub_spring: float
    """Moment of the hub per gimbal tilt [N m/rad]."""
    induced_factor: float
    """Induced velocity over its momentum-theory value."""
    apparent_mass: float
    """Apparent-mass coefficient of the mean inflow."""
    gradient_apparent_mass: float
    """Apparent-mass coefficient of the inflow gradients."""
    skew_gradient: float
    """Fore-aft inflow gradient over mean inflow at 90 deg of wake skew."""
    skew_gradient_onset: float
    """Advance ratio about which that gradient appears; 0: it is there from hover on."""
    side_by_side: Curves
    """Relative change of the induced velocity by the other rotor against in-plane advance ratio."""
    ground_relief: float
    """Share of the induced velocity that the ground takes away, hovering on the wheels."""


class WingTables(NamedTuple):
    """Wing, flaps and their interference with the rotors."""

    area: float
    """Reference area [m^2]."""
    chord: float
    """Reference chord [m]."""
    lift: Curves
    """CL: rows airplane F0 F20 F40 F75, then helicopter F0 F20 F40 F75; argument [rad]."""
    drag: Curves
    """CD, rows as for lift."""
    moment: Curves
    """Cm about the aerodynamic centre: rows F0 F20 F40 F75; argument nacelle angle [rad]."""
    flap_nodes: FloatArray
    """Flap deflections of the tables [rad]."""
    upwash: FloatArray
    """Coefficients of X_RW in 1, mast angle, mast angle squared [rad], times K_XRW."""
    mach_gain: float
    """Relative increase of the lift at Mach 0.4."""
    immersed_area: Curves
    """Wing area in the rotor wake in hover, both sides [m^2], against nacelle angle."""
    immersed_fade_speed: float
    """Airspeed at which the wing has left the wake [m/s]."""
    immersed_velocity_factor: float
    """Wake velocity at the wing over mean induced velocity."""
    position: FloatArray
    """Stationline, waterline of the aerodynamic centre [m]."""
    immersed_position: FloatArray
    """Stationline, waterline of the download [m]."""


class BodyTables(NamedTuple):
    """Fuselage, pylons, spinners, jets and fins."""

    fuselage: Curves
    """L/q [m^2], D/q [m^2], M/q [m^3] against angle of attack [rad]."""
    position: FloatArray
    """Fuselage reference point: stationline, waterline [m]."""
    pylon_area: Curves
    """Drag area of the pylons [m^2] against nacelle angle [rad]."""
    pylon_incidence_factor: Curves
    """Factor on it against the angle between mast and free stream [rad]."""
    spinner_area: float
    """Spinner drag area at zero incidence, both [m^2]."""
    spinner_incidence_area: float
    """Spinner drag area growth with the cube of the sine of the mast incidence, both [m^2]."""
    fin_area: float
    """Drag area of the vertical fins [m^2]."""
    jet_static: float
    """Jet thrust of both engines without power at rest [N]."""
    jet_per_power: float
    """Its growth with the rotors' shaft power [N/W]."""
    jet_ram: float
    """Its fall with airspeed: air taken in [kg/s]."""


class TailTables(NamedTuple):
    """Horizontal tail in downwash and rotor wake."""

    area: float
    """Area [m^2]."""
    position: FloatArray
    """Stationline, waterline [m]."""
    pressure_factor: float
    """K_q of the dynamic pressure at the tail."""
    lift: Surfaces
    """CL against tail angle of attack and elevator [rad]."""
    drag: Curves
    """CD against tail angle of attack [rad]."""
    downwash: Curves
    """Downwash [rad]: rows mast 0, 15, 30, 60, 90 deg, each F0, F20, F40; argument fuselage angle of attack."""
    downwash_nacelle: FloatArray
    """Nacelle angles of the downwash and dynamic-pressure tables [rad], descending mast angle order: 90 .. 0 deg."""
    pressure_ratio: Surfaces
    """eta against fuselage angle of attack [rad] and airspeed [m/s] at those nacelle angles."""
    rotor_wake: Surfaces
    """Rotor-wake velocity at the tail over mean induced velocity, mast 0, 15, 30 (60: zero)."""
    wake_nacelle: FloatArray
    """Nacelle angles of the rotor-wake table [rad], descending."""


class ControlTables(NamedTuple):
    """Mixing of stick and lever, flap schedule, actuators."""

    cyclic_per_stick: Curves
    """Longitudinal cyclic per full stick [rad] against nacelle angle [rad] (positive number)."""
    cyclic_limit: float
    """Limit of the longitudinal cyclic [rad]."""
    elevator_per_stick: float
    """Elevator per full stick [rad]."""
    elevator_limit: float
    """Limit of the elevator [rad]."""
    collective_range: Curves
    """Rows: collective at lever 0 and at lever 1 [rad] against nacelle angle [rad]."""
    actuator_rate: FloatArray
    """Inverse time constants of collective, cyclic, elevator [1/s]."""
    default_flap: float
    """Flap deflection off the downstop and below the retraction speed [rad]."""
    flap_retraction: FloatArray
    """Airspeeds between which the flaps retract on the downstop [m/s]."""
    downstop_nacelle: float
    """Nacelle angle up to which the nacelles count as on the downstop [rad]."""


class MassTables(NamedTuple):
    """Inertia and centre of gravity as the nacelles tilt."""

    pitch_inertia_airplane: float
    """Iyy at nacelle angle 0 [kg m^2]."""
    pitch_inertia_slope: float
    """Growth of Iyy with nacelle angle [kg m^2/rad]."""
    nacelle_inertia: float
    """Inertia of both nacelles about the pivot [kg m^2]."""
    gravity_centre_helicopter: FloatArray
    """Stationline, waterline of the centre of gravity at nacelle angle 90 deg [m]."""
    gravity_shift: FloatArray
    """X and Z of the shift law [m]."""
    pivot: FloatArray
    """Stationline, waterline of the nacelle pivot [m]."""
    mast_length: float
    """Pivot to hub [m]."""


class AircraftTables(NamedTuple):
    """Everything the nonlinear model's kernels read."""

    configuration: Configuration
    """Mass, air, rotor speed, flap."""
    rotor: RotorTables
    """One rotor."""
    wing: WingTables
    """Wing."""
    body: BodyTables
    """Fuselage, pylons, spinners, jets, fins."""
    tail: TailTables
    """Horizontal tail."""
    controls: ControlTables
    """Mixing and actuators."""
    mass: MassTables
    """Inertia and geometry."""
    lateral: LateralTables
    """What acts out of the plane of symmetry."""
