"""The frame: one row of named signals per step, declared here once and read by everyone else.

The recorder, Rerun, MAVLink, plots and reports take names, units and groups from ``SIGNALS``;
kernels write through ``COLUMN``. A row describes the aircraft at the *start* of the frame (time
``frame * dt``) together with the command that acts during it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.places import Places
from rtsim.units import DEGREE, HORSEPOWER, INCH_POUND, KNOT, POUND_FORCE, RPM


class Unit(NamedTuple):
    """A unit of the columns."""

    suffix: str
    """What it adds to a name."""
    scale: float
    """One of it in SI."""


UNITS: dict[str, Unit] = {
    "": Unit("", 1.0),
    "s": Unit("_s", 1.0),
    "us": Unit("_us", 1e-6),
    "m": Unit("_m", 1.0),
    "m/s": Unit("_m_s", 1.0),
    "rad/s": Unit("_rad_s", 1.0),
    "kn": Unit("_kt", KNOT),
    "kn/s": Unit("_kt_s", KNOT),
    "deg": Unit("_deg", DEGREE),
    "deg/s": Unit("_deg_s", DEGREE),
    "lb": Unit("_lb", POUND_FORCE),
    "shp": Unit("_shp", HORSEPOWER),
    "in lb": Unit("_inlb", INCH_POUND),
    "lb/h": Unit("_lb_h", POUND_FORCE / 3600.0),
    "rpm": Unit("_rpm", RPM),
}
"""Units of signals, as shown on axes."""


@dataclass(frozen=True, slots=True)
class Signal:
    """One column of the frame."""

    name: str
    """Column name; the unit is part of it unless the signal is dimensionless."""
    unit: str
    """Unit as shown on axes; empty where dimensionless."""
    group: str
    """The plot and table it belongs to."""
    description: str
    """One sentence for people."""

    @property
    def quantity(self) -> str:
        """The name without its unit."""
        return self.name.removesuffix(UNITS[self.unit].suffix)


SIGNALS: tuple[Signal, ...] = (
    Signal("frame", "", "time", "Number of the frame, from 0."),
    Signal("time_s", "s", "time", "Simulated time at the start of the frame, frame * dt."),
    Signal(
        "airspeed_kt",
        "kn",
        "speed",
        "Horizontal true airspeed ahead with gusts, signed; equals calibrated airspeed at sea level.",
    ),
    Signal("airspeed_reference_kt", "kn", "speed", "Airspeed reference after its 1.5 rad/s filter."),
    Signal("nacelle_deg", "deg", "nacelle", "Nacelle angle: 90 helicopter, 0 airplane."),
    Signal(
        "nacelle_reference_deg", "deg", "nacelle", "Nacelle angle the command asks for, before the 3 rad/s actuator."
    ),
    Signal("altitude_m", "m", "altitude", "Height above the ground."),
    Signal("pitch_deg", "deg", "attitude", "Pitch attitude, nose up positive."),
    Signal("flapping_deg", "deg", "flapping", "Magnitude of gimbal flapping relative to the mast."),
    Signal("stick", "", "controls", "Longitudinal stick after protection, -1 aft to 1 forward."),
    Signal("lever", "", "controls", "Power lever after protection, 0 to 1."),
    Signal("pilot_stick", "", "controls", "Longitudinal stick as the pilot gave it."),
    Signal("pilot_lever", "", "controls", "Power lever as the pilot gave it."),
    Signal(
        "pilot_nacelle_rate_rad_s",
        "rad/s",
        "nacelle",
        "Nacelle rate as the pilot gave it (SI, so that a replay gets it to the last bit).",
    ),
    Signal(
        "nacelle_command_rate_deg_s",
        "deg/s",
        "nacelle",
        "Nacelle rate that acts, after protection, detents and limits.",
    ),
    Signal("nacelle_rate_deg_s", "deg/s", "nacelle", "Rate of the nacelle angle."),
    Signal("airspeed_command_kt", "kn", "speed", "Airspeed of the scenario before its filter."),
    Signal("altitude_reference_m", "m", "altitude", "Altitude to hold."),
    Signal("airspeed_rate_kt_s", "kn/s", "speed", "Rate of the airspeed."),
    Signal(
        "ground_speed_kt",
        "kn",
        "speed",
        "Horizontal speed over the ground, negative where it is more rearward than sideways.",
    ),
    Signal("climb_rate_m_s", "m/s", "altitude", "Vertical speed, up positive."),
    Signal("distance_m", "m", "position", "Distance flown over the ground."),
    Signal("flight_path_deg", "deg", "attitude", "Angle of the air-relative flight path above the horizon."),
    Signal("angle_of_attack_deg", "deg", "attitude", "Fuselage angle of attack with gusts, as used for scheduling."),
    Signal("pitch_rate_deg_s", "deg/s", "attitude", "Body pitch rate."),
    Signal("body_u_m_s", "m/s", "position", "Air-relative velocity along the body x axis (forward), gusts excepted."),
    Signal("body_w_m_s", "m/s", "position", "Air-relative velocity along the body z axis (down), gusts excepted."),
    Signal("load_factor", "", "loads", "Normal load factor, 1 in level flight."),
    Signal("coning_deg", "deg", "flapping", "Coning angle of the blades, precone included."),
    Signal("longitudinal_flapping_deg", "deg", "flapping", "Cosine gimbal flapping; positive tilts the disc forward."),
    Signal("lateral_flapping_deg", "deg", "flapping", "Sine gimbal flapping; positive lifts the outboard edge."),
    Signal("collective_75_deg", "deg", "controls", "Collective pitch at 75 % radius."),
    Signal("cyclic_deg", "deg", "controls", "Longitudinal cyclic pitch theta1s; negative tilts the disc forward."),
    Signal("elevator_deg", "deg", "controls", "Elevator, trailing edge down positive."),
    Signal("flap_deg", "deg", "controls", "Flap deflection of the flap schedule."),
    Signal("thrust_per_rotor_lb", "lb", "loads", "Thrust of one rotor along its mast."),
    Signal("power_shp", "shp", "power", "Shaft power of both rotors."),
    Signal("engine_power_shp", "shp", "power", "Engine power: shaft power of both rotors / 0.93."),
    Signal("mast_torque_inlb", "in lb", "power", "Torque of one mast."),
    Signal("rotor_speed_rpm", "rpm", "power", "Rotor speed (held by an ideal governor)."),
    Signal("margin_kt", "kn", "corridor", "Signed margin to the nearer corridor boundary."),
    Signal("margin_low_kt", "kn", "corridor", "Airspeed above the low-speed boundary."),
    Signal("margin_high_kt", "kn", "corridor", "Airspeed below the high-speed boundary."),
    Signal("nacelle_forward_deg", "deg", "corridor", "Nacelle travel towards airplane mode before a boundary."),
    Signal("nacelle_aft_deg", "deg", "corridor", "Nacelle travel towards helicopter mode before a boundary."),
    Signal(
        "corridor_level",
        "",
        "corridor",
        "0 clear, 1 caution, 2 warning, 3 exceedance (after persistence and hysteresis).",
    ),
    Signal("on_downstop", "", "nacelle", "1 while the nacelles rest on the airplane-mode stop."),
    Signal("control_on_stop", "", "controls", "1 while a stick, lever, pedals, cyclic or elevator is on a stop."),
    Signal("pilot_mode", "", "controls", "Who flies: 0 MOCM, 1 external command, 2 hold."),
    Signal("airspeed_indicated_kt", "kn", "speed", "Airspeed as the sensor shows it to pilot and laws."),
    Signal("gust_u_m_s", "m/s", "air", "Gust added to the air-relative velocity along body x."),
    Signal("gust_w_m_s", "m/s", "air", "Gust added to the air-relative velocity along body z."),
    Signal("gust_q_deg_s", "deg/s", "air", "Pitch gust added to the air-relative pitch rate."),
    Signal("failures", "", "failures", "Active failures, a sum of the bits in docs/faults.md."),
    Signal("protection_stick", "", "protection", "Stick after minus before protection."),
    Signal("protection_lever", "", "protection", "Lever after minus before protection."),
    Signal("protection_nacelle_rate_deg_s", "deg/s", "protection", "Nacelle rate after minus before protection."),
    Signal(
        "protection_stick_reason",
        "",
        "protection",
        "Limit that changed the stick: 0 none, else its number in docs/protection.md.",
    ),
    Signal("protection_lever_reason", "", "protection", "Limit that changed the lever, by the same numbers."),
    Signal("protection_nacelle_reason", "", "protection", "Limit that changed the nacelle rate, by the same numbers."),
    Signal(
        "time_to_limit_s",
        "s",
        "protection",
        "Predicted time until the corridor is left with the controls as they are; 6 where not, or unwatched.",
    ),
    Signal("fuel_lb", "lb", "fuel", "Fuel left; what is burned does not make the aircraft lighter."),
    Signal("fuel_flow_lb_h", "lb/h", "fuel", "Fuel that all engines burn."),
    Signal(
        "engine_power_available_shp",
        "shp",
        "power",
        "Engine power at take-off rating at this altitude, or what a failure leaves.",
    ),
    Signal("thrust_coefficient_over_solidity", "", "rotor", "CT/sigma of one rotor: its load, rotor convention."),
    Signal("advance_ratio", "", "rotor", "Speed of the air across the rotor disc over tip speed."),
    Signal("weight_on_wheels", "", "altitude", "Force of the ground on the wheels over the weight."),
    Signal("ground_effect", "", "rotor", "Ground effect: 0 far from the ground, 1 hovering on the wheels."),
    Signal("bank_deg", "deg", "attitude", "Bank angle, right positive."),
    Signal("heading_deg", "deg", "course", "Heading, clockwise from north, 0 to 360."),
    Signal("roll_rate_deg_s", "deg/s", "attitude", "Body roll rate, right positive."),
    Signal("yaw_rate_deg_s", "deg/s", "attitude", "Body yaw rate, nose right positive."),
    Signal("turn_rate_deg_s", "deg/s", "attitude", "Rate of the heading, right positive."),
    Signal(
        "sideslip_deg",
        "deg",
        "attitude",
        "Sideslip with gusts, wind from the right positive: atan2(v, sqrt(u^2 + w^2 + V0^2)), V0 as for scheduling.",
    ),
    Signal("lateral_kt", "kn", "speed", "Sideways airspeed in the horizontal plane with gusts, right positive."),
    Signal("lateral_acceleration", "", "loads", "Specific force along body y over g, right positive: the slip ball."),
    Signal("north_m", "m", "position", "Place north of the start."),
    Signal("east_m", "m", "position", "Place east of the start."),
    Signal("track_deg", "deg", "course", "Course over the ground, 0 to 360; the heading where there is none."),
    Signal("flapping_right_deg", "deg", "flapping", "Magnitude of the right rotor's flapping."),
    Signal("flapping_left_deg", "deg", "flapping", "Magnitude of the left rotor's flapping."),
    Signal("mast_torque_right_inlb", "in lb", "power", "Torque of the right mast."),
    Signal("mast_torque_left_inlb", "in lb", "power", "Torque of the left mast."),
    Signal("aileron_deg", "deg", "controls", "Aileron: half difference of the flaperons, right one up positive."),
    Signal("rudder_deg", "deg", "controls", "Rudder, positive turns the nose right."),
    Signal("differential_collective_deg", "deg", "controls", "Half difference of collective pitch, right less left."),
    Signal("differential_cyclic_deg", "deg", "controls", "Half difference of longitudinal cyclic, right less left."),
    Signal("gust_v_m_s", "m/s", "air", "Gust added to the air-relative velocity along body y."),
    Signal("gust_p_deg_s", "deg/s", "air", "Roll gust added to the air-relative roll rate."),
    Signal("gust_r_deg_s", "deg/s", "air", "Yaw gust added to the air-relative yaw rate."),
    Signal("wind_north_m_s", "m/s", "wind", "Wind at the aircraft towards the north."),
    Signal("wind_east_m_s", "m/s", "wind", "Wind at the aircraft towards the east."),
    Signal("lateral_stick", "", "controls", "Lateral stick after protection, -1 left to 1 right."),
    Signal("pedal", "", "controls", "Pedals after protection, -1 left to 1 right."),
    Signal("pilot_lateral_stick", "", "controls", "Lateral stick as the pilot gave it."),
    Signal("pilot_pedal", "", "controls", "Pedals as the pilot gave them."),
    Signal("protection_lateral_stick", "", "protection", "Lateral stick after minus before protection."),
    Signal("protection_pedal", "", "protection", "Pedals after minus before protection."),
    Signal(
        "protection_lateral_stick_reason",
        "",
        "protection",
        "Limit that changed the lateral stick, by the same numbers.",
    ),
    Signal("protection_pedal_reason", "", "protection", "Limit that changed the pedals, by the same numbers."),
    Signal("bank_reference_deg", "deg", "attitude", "Bank of the coordinated turn asked for, after its filter."),
    Signal("heading_reference_deg", "deg", "course", "Heading asked for, after its filter, 0 to 360."),
    Signal("lateral_reference_kt", "kn", "speed", "Sideways airspeed asked for along body y, after its filter."),
    Signal("track_error_m", "m", "position", "Place to the right of the line over the ground that is held; 0: none."),
    Signal("point_error_m", "m", "position", "Distance from the point over the ground that is held; 0: none."),
    Signal(
        "differential_longitudinal_flapping_deg",
        "deg",
        "flapping",
        "Half difference of cosine flapping, right less left.",
    ),
    Signal(
        "differential_lateral_flapping_deg", "deg", "flapping", "Half difference of sine flapping, right less left."
    ),
)
"""Every signal of the history, in the order of the columns and of the history hash."""

TIMING_SIGNALS: tuple[Signal, ...] = (
    Signal("lateness_us", "us", "loop", "Frame start minus its deadline."),
    Signal("work_us", "us", "loop", "Wall time from frame start to ring push."),
    Signal("work_cpu_us", "us", "loop", "Thread CPU time from frame start to ring push."),
    Signal("overruns", "", "loop", "Frames so far that finished after the next deadline."),
    Signal("telemetry_dropped", "", "loop", "Rows so far that the view was too slow to take."),
)
"""Wall-clock columns of a live flight; logged beside the history and never part of its hash."""

NACELLES_JAMMED = 1
"""Bit of the column ``failures`` that says that the nacelles do not follow their commands."""
SIGNAL_NAMES: tuple[str, ...] = tuple(signal.name for signal in SIGNALS)
SIGNAL_COUNT = len(SIGNALS)

COLUMN = Places(*SIGNAL_NAMES)
"""Column number by signal name: ``COLUMN.airspeed_kt``; usable inside compiled kernels."""
QUANTITY = Places(*(signal.quantity for signal in SIGNALS))
"""The same columns in SI, by the name without its unit: ``QUANTITY.airspeed``. The frame works with these."""

UNIT_SCALES: FloatArray = np.array([UNITS[signal.unit].scale for signal in SIGNALS])
"""What a column's number is multiplied by to be in SI, shape (SIGNAL_COUNT,)."""


def history_sha256(chunks: Sequence[FloatArray]) -> str:
    """Hash a frame history: little-endian float64, whole columns in declared order.

    Args:
        chunks: Consecutive pieces of the history, each of shape (frames, SIGNAL_COUNT).

    Returns:
        The SHA-256 as 64 hexadecimal digits.
    """
    digest = hashlib.sha256()
    for column in range(SIGNAL_COUNT):
        for chunk in chunks:
            digest.update(np.ascontiguousarray(chunk[:, column], dtype="<f8").tobytes())
    return digest.hexdigest()
