"""Messages that show the flight: attitude, position, speeds, the tiltrotor's own values, the sticks."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import all as dialect

from rtsim.frame import TIMING_SIGNALS
from rtsim.units import KNOT, deg
from telemetry.exchange.globe import HomePosition
from telemetry.mavlink.fields import real, whole, wrapped
from telemetry.mavlink.state import INPUT_LIVE, PILOT_EXTERNAL, PILOT_HOLD, FlightState

_TIMING = {signal.name: place for place, signal in enumerate(TIMING_SIGNALS)}


def loop_value(state: FlightState, name: str) -> float:
    """A wall-clock column of the newest row.

    Args:
        state: The flight.
        name: Name of the column.
    """
    return float(state.timing[_TIMING[name]])


def _compass(angle_deg: float, per_degree: int) -> int:
    """A direction in whole parts of a degree, from 0 on."""
    return whole(per_degree * angle_deg, 0, 360 * per_degree) % (360 * per_degree)


class FlightMessages:
    """Builds the messages from the newest row."""

    def __init__(self, home: HomePosition, state: FlightState) -> None:
        """Connect.

        Args:
            home: Where the flight began on the globe.
            state: The flight, kept up to date by the vehicle.
        """
        self._home, self._state = home, state

    def attitude(self) -> list[Any]:
        """ATTITUDE."""
        value = self._state.value
        return [
            dialect.MAVLink_attitude_message(
                self._state.boot_ms,
                *(real(wrapped(angle)) for angle in self._angles()),
                *(real(deg(value(f"{axis}_rate_deg_s"))) for axis in ("roll", "pitch", "yaw")),
            )
        ]

    def _angles(self) -> tuple[float, float, float]:
        """Bank, pitch and heading [rad]."""
        bank, pitch, heading = (deg(self._state.value(name)) for name in ("bank_deg", "pitch_deg", "heading_deg"))
        return bank, pitch, heading

    def attitude_quaternion(self) -> list[Any]:
        """ATTITUDE_QUATERNION, the same attitude."""
        (cr, sr), (cp, sp), (cy, sy) = (
            (math.cos(0.5 * wrapped(angle)), math.sin(0.5 * wrapped(angle))) for angle in self._angles()
        )
        turned = (
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        )
        rates = (deg(self._state.value(f"{axis}_rate_deg_s")) for axis in ("roll", "pitch", "yaw"))
        return [dialect.MAVLink_attitude_quaternion_message(self._state.boot_ms, *map(real, (*turned, *rates)))]

    def _ground_velocity(self) -> tuple[float, float, float]:
        """North, east, down [m/s]."""
        speed, track = abs(self._state.value("ground_speed_kt")) * KNOT, deg(self._state.value("track_deg"))
        return speed * math.cos(track), speed * math.sin(track), -self._state.value("climb_rate_m_s")

    def local_position(self) -> list[Any]:
        """LOCAL_POSITION_NED: from the start on the ground below."""
        value = self._state.value
        fields = value("north_m"), value("east_m"), -value("altitude_m"), *self._ground_velocity()
        return [dialect.MAVLink_local_position_ned_message(self._state.boot_ms, *map(real, fields))]

    def _latitude_longitude(self) -> tuple[int, int]:
        """Position in 1e-7 degrees."""
        value = self._state.value
        latitude, longitude = self._home.place(value("north_m"), value("east_m"))
        return whole(latitude * 1e7, -900_000_000, 900_000_000), whole(longitude * 1e7, -1_800_000_000, 1_800_000_000)

    def _altitude_amsl(self) -> float:
        return self._state.value("altitude_m") + self._home.altitude_m

    def global_position(self) -> list[Any]:
        """GLOBAL_POSITION_INT."""
        value = self._state.value
        latitude, longitude = self._latitude_longitude()
        north, east, down = (whole(100.0 * speed, -32767, 32767) for speed in self._ground_velocity())
        return [
            dialect.MAVLink_global_position_int_message(
                self._state.boot_ms,
                latitude,
                longitude,
                whole(1000.0 * self._altitude_amsl(), -(2**31), 2**31 - 1),
                whole(1000.0 * value("altitude_m"), -(2**31), 2**31 - 1),
                north,
                east,
                down,
                _compass(value("heading_deg"), 100),
            )
        ]

    def vfr_hud(self) -> list[Any]:
        """VFR_HUD: airspeed and ground speed without sign."""
        value = self._state.value
        return [
            dialect.MAVLink_vfr_hud_message(
                real(abs(value("airspeed_kt")) * KNOT),
                real(abs(value("ground_speed_kt")) * KNOT),
                _compass(value("heading_deg"), 1),
                whole(100.0 * value("lever"), 0, 100),
                real(self._altitude_amsl()),
                real(value("climb_rate_m_s")),
            )
        ]

    def named_values(self) -> list[Any]:
        """NAMED_VALUE_FLOAT, one message per value."""
        state, value = self._state, self._state.value
        values = {
            b"nac_deg": value("nacelle_deg"),
            b"corr_lo": value("margin_low_kt"),
            b"corr_hi": value("margin_high_kt"),
            b"flap_deg": value("flapping_deg"),
            b"rpm_pct": state.rotor_speed_pct,
            b"trq_pct": state.torque_pct,
            b"wflap_deg": value("flap_deg"),
            b"in_age_ms": 1e3 * state.feedback.age,
            b"slip_deg": value("sideslip_deg"),
            b"ball_g": value("lateral_acceleration"),
        }
        stamp = state.boot_ms
        return [dialect.MAVLink_named_value_float_message(stamp, name, real(v)) for name, v in values.items()]

    def debug_array(self) -> list[Any]:
        """DEBUG_FLOAT_ARRAY; places as in docs/mavlink.md."""
        state, value = self._state, self._state.value
        numbers = [
            value("nacelle_deg"),
            state.nacelle_command_deg,
            value("margin_low_kt"),
            value("margin_high_kt"),
            value("flapping_deg"),
            value("collective_75_deg"),
            state.rotor_speed_pct,
            state.torque_pct,
            value("angle_of_attack_deg"),
            loop_value(state, "work_us") * 1e-3,
            1e3 * state.feedback.age,
            state.shown_stick,
            state.shown_lateral_stick,
            state.shown_pedal,
            value("corridor_level"),
            value("flap_deg"),
            value("sideslip_deg"),
            value("lateral_acceleration"),
            value("flapping_left_deg"),
            value("flapping_right_deg"),
            state.share_of_torque("mast_torque_left_inlb"),
            state.share_of_torque("mast_torque_right_inlb"),
        ]
        data = [real(number) for number in numbers] + [0.0] * (58 - len(numbers))
        return [dialect.MAVLink_debug_float_array_message(state.boot_us, b"xv15", 1, data)]

    def rc_channels(self) -> list[Any]:
        """RC_CHANNELS: the sticks as applied."""
        state = self._state
        channels = (
            1500.0 + 500.0 * state.shown_lateral_stick,
            1500.0 - 500.0 * state.shown_stick,
            1000.0 + 1000.0 * state.shown_lever,
            1500.0 + 500.0 * state.shown_pedal,
            1500.0 - 500.0 * state.feedback.nacelle_switch,
            1000.0 + 1000.0 * state.nacelle_command_deg / 90.0,
            {PILOT_EXTERNAL: 1500.0, PILOT_HOLD: 2000.0}.get(state.pilot, 1000.0),
            1000.0 + 1000.0 * float(state.armed),
        )
        raw = [whole(channel, 800, 2200) for channel in channels] + [65535] * 10
        rssi = 100 if int(state.feedback.input_state) == INPUT_LIVE else 0
        return [dialect.MAVLink_rc_channels_message(state.boot_ms, 8, *raw, rssi)]

    def servo_output(self) -> list[Any]:
        """SERVO_OUTPUT_RAW: elevator, cyclic, collective, nacelle, flaps, aileron, rudder; both rotors."""
        value = self._state.value
        collective, cyclic = value("collective_75_deg"), value("cyclic_deg")
        collectives = [collective + side * value("differential_collective_deg") for side in (-1.0, 1.0)]
        cyclics = [cyclic + side * value("differential_cyclic_deg") for side in (-1.0, 1.0)]
        outputs = (
            1500.0 + 500.0 * value("elevator_deg") / 20.0,
            1500.0 + 500.0 * cyclic / 10.0,
            1000.0 + 1000.0 * collective / 50.0,
            1000.0 + 1000.0 * value("nacelle_deg") / 90.0,
            1000.0 + 1000.0 * value("flap_deg") / 75.0,
            1500.0 + 500.0 * value("aileron_deg") / 20.0,
            1500.0 + 500.0 * value("rudder_deg") / 20.0,
            *(1000.0 + 1000.0 * angle / 50.0 for angle in collectives),
            *(1500.0 + 500.0 * angle / 10.0 for angle in cyclics),
        )
        raw = [whole(output, 800, 2200) for output in outputs]
        return [dialect.MAVLink_servo_output_raw_message(self._state.boot_us & 0xFFFFFFFF, 0, *raw)]

    def wind(self) -> list[Any]:
        """WIND_COV: where the steady wind blows to; how it varies is not known."""
        value = self._state.value
        wind = real(value("wind_north_m_s")), real(value("wind_east_m_s")), 0.0
        unknown = math.nan
        return [
            dialect.MAVLink_wind_cov_message(
                self._state.boot_us, *wind, unknown, unknown, real(self._altitude_amsl()), unknown, unknown
            )
        ]

    def altitude(self) -> list[Any]:
        """ALTITUDE."""
        height, amsl = real(self._state.value("altitude_m")), real(self._altitude_amsl())
        ground = self._home.altitude_m
        return [dialect.MAVLink_altitude_message(self._state.boot_us, amsl, amsl, height, height, ground, height)]

    def gps(self) -> list[Any]:
        """GPS_RAW_INT: a perfect receiver."""
        latitude, longitude = self._latitude_longitude()
        speed = abs(self._state.value("ground_speed_kt")) * KNOT
        altitude = whole(1000.0 * self._altitude_amsl(), -(2**31), 2**31 - 1)
        return [
            dialect.MAVLink_gps_raw_int_message(
                self._state.boot_us,
                3,
                latitude,
                longitude,
                altitude,
                100,
                100,
                whole(100.0 * speed, 0, 65534),
                _compass(self._state.value("track_deg"), 100),
                12,
                altitude,
            )
        ]
