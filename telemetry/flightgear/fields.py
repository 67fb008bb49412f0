"""What a packet says of a row: the motion as FlightGear means it, and what moves on the aircraft.

FlightGear has no field for a nacelle; the angle travels in ``speedbrake``, 1 at 90 deg. Shares of control surfaces
are positive with the trailing edge down or to the right, 1 at ``SURFACE_TRAVEL_DEG`` and ``FLAP_TRAVEL_DEG``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from rtsim.units import FOOT, GRAVITY, KNOT, deg
from telemetry.exchange.globe import HomePosition
from telemetry.flightgear.packet import OWN_HEIGHT, RUNNING
from telemetry.view.undercarriage import STANDING_HEIGHT, extended, stroke_used

Values = dict[str, float | Sequence[float]]
"""Numbers of a packet by field."""
NACELLE_FULL_DEG = 90.0
"""Nacelle angle that ``speedbrake`` calls 1 [deg]."""
SURFACE_TRAVEL_DEG = 20.0
"""Deflection of elevator, aileron and rudder that counts as 1 [deg]."""
FLAP_TRAVEL_DEG = 75.0
"""Deflection of the flaps that counts as 1 [deg]."""
_POUNDS_PER_GALLON = 6.7


def packet_values(row: FloatArray, home: HomePosition) -> Values:
    """Fields of the packet that shows a row.

    Args:
        row: A row of the flight; columns behind the signals are not looked at.
        home: Where the flight began on the globe.
    """
    return {**_motion(row, home), **_machine(row), **_surfaces(row)}


def velocity_over_ground(row: FloatArray) -> tuple[float, float, float]:
    """Velocity over the ground to north, east and down [m/s].

    Args:
        row: A row of the flight.
    """
    speed, track = abs(float(row[COLUMN.ground_speed_kt])) * KNOT, deg(float(row[COLUMN.track_deg]))
    return speed * math.cos(track), speed * math.sin(track), -float(row[COLUMN.climb_rate_m_s])


def _motion(row: FloatArray, home: HomePosition) -> Values:
    latitude, longitude = home.place(float(row[COLUMN.north_m]), float(row[COLUMN.east_m]))
    bank, pitch, heading = (
        deg(float(row[column])) for column in (COLUMN.bank_deg, COLUMN.pitch_deg, COLUMN.heading_deg)
    )
    roll_rate, pitch_rate, yaw_rate = (
        deg(float(row[column])) for column in (COLUMN.roll_rate_deg_s, COLUMN.pitch_rate_deg_s, COLUMN.yaw_rate_deg_s)
    )
    north, east, down = velocity_over_ground(row)
    body = _to_body((north, east, down), bank, pitch, heading)
    turning = pitch_rate * math.sin(bank) + yaw_rate * math.cos(bank)
    lateral, normal = float(row[COLUMN.lateral_acceleration]), float(row[COLUMN.load_factor])
    ahead = float(row[COLUMN.airspeed_rate_kt_s]) * KNOT * math.cos(pitch) + GRAVITY * math.sin(pitch)
    return {
        "latitude": deg(latitude),
        "longitude": deg(longitude),
        "altitude": home.altitude_m + STANDING_HEIGHT + float(row[COLUMN.altitude_m]),
        "agl": OWN_HEIGHT,
        "phi": bank,
        "theta": pitch,
        "psi": heading,
        "alpha": deg(float(row[COLUMN.angle_of_attack_deg])),
        "beta": deg(float(row[COLUMN.sideslip_deg])),
        "phidot": roll_rate + math.tan(pitch) * turning,
        "thetadot": pitch_rate * math.cos(bank) - yaw_rate * math.sin(bank),
        "psidot": turning / math.cos(pitch),
        "vcas": abs(float(row[COLUMN.airspeed_kt])),
        "climb_rate": -down / FOOT,
        "v_north": north / FOOT,
        "v_east": east / FOOT,
        "v_down": down / FOOT,
        "v_wind_body_north": body[0] / FOOT,
        "v_wind_body_east": body[1] / FOOT,
        "v_wind_body_down": body[2] / FOOT,
        "A_X_pilot": ahead / FOOT,
        "A_Y_pilot": GRAVITY * lateral / FOOT,
        "A_Z_pilot": -GRAVITY * normal / FOOT,
        "slip_deg": -math.degrees(math.atan2(lateral, max(normal, 0.1))),
    }


def _machine(row: FloatArray) -> Values:
    """Rotors, fuel and wheels; the left rotor is engine 0."""
    speed, burned = float(row[COLUMN.rotor_speed_rpm]), float(row[COLUMN.fuel_flow_lb_h])
    state, flow = RUNNING if burned > 0.0 else 0, 0.5 * burned / _POUNDS_PER_GALLON
    pressed = float(row[COLUMN.weight_on_wheels])
    down = extended(float(row[COLUMN.nacelle_deg]))
    return {
        "num_engines": 2,
        "eng_state": (state, state, 0, 0),
        "rpm": (speed, speed, 0.0, 0.0),
        "fuel_flow": (flow, flow, 0.0, 0.0),
        "num_tanks": 1,
        "fuel_quantity": (float(row[COLUMN.fuel_lb]) / _POUNDS_PER_GALLON, 0.0, 0.0, 0.0),
        "num_wheels": 3,
        "wow": (int(pressed > 0.0),) * 3,
        "gear_pos": (down,) * 3,
        "gear_compression": (stroke_used(pressed),) * 3,
        "speedbrake": float(row[COLUMN.nacelle_deg]) / NACELLE_FULL_DEG,
    }


def _surfaces(row: FloatArray) -> Values:
    flap = float(row[COLUMN.flap_deg]) / FLAP_TRAVEL_DEG
    aileron = float(row[COLUMN.aileron_deg]) / SURFACE_TRAVEL_DEG
    return {
        "elevator": float(row[COLUMN.elevator_deg]) / SURFACE_TRAVEL_DEG,
        "left_flap": flap,
        "right_flap": flap,
        "left_aileron": aileron,
        "right_aileron": -aileron,
        "rudder": float(row[COLUMN.rudder_deg]) / SURFACE_TRAVEL_DEG,
    }


def _to_body(
    vector: tuple[float, float, float], bank: float, pitch: float, heading: float
) -> tuple[float, float, float]:
    """A vector of north, east, down in body axes."""
    north, east, down = vector
    ahead = north * math.cos(heading) + east * math.sin(heading)
    right = east * math.cos(heading) - north * math.sin(heading)
    below = ahead * math.sin(pitch) + down * math.cos(pitch)
    return (
        ahead * math.cos(pitch) - down * math.sin(pitch),
        right * math.cos(bank) + below * math.sin(bank),
        below * math.cos(bank) - right * math.sin(bank),
    )
