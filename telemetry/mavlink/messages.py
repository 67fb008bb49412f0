"""Makes every streamed message from the state of the flight. Units and signs as in docs/mavlink.md.

Every outgoing number is clamped to its field: a value that does not fit would end the process while packing.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any

from pymavlink.dialects.v20 import all as dialect

from rtsim.frame import TIMING_SIGNALS
from rtsim.units import KNOT, deg, to_deg
from telemetry.mavlink.config import MavlinkConfig
from telemetry.mavlink.modes import FlightMode, present_mode
from telemetry.mavlink.state import INPUT_LIVE, PILOT_EXTERNAL, PILOT_HOLD, FlightState

METRES_PER_DEGREE = 6_371_000.0 * math.pi / 180.0
"""Length of a degree of latitude on a sphere [m]."""
BUS_VOLTAGE_MV = 28_000
"""Nominal direct-current bus of the aircraft [mV]; electrics are not modelled."""
HEARTBEAT, SYS_STATUS, SYSTEM_TIME, EXTENDED_SYS_STATE, CURRENT_MODE, HOME_POSITION = 0, 1, 2, 245, 436, 242
ATTITUDE, ATTITUDE_QUATERNION, LOCAL_POSITION, GLOBAL_POSITION, VFR_HUD = 30, 31, 32, 33, 74
NAMED_VALUE_FLOAT, DEBUG_FLOAT_ARRAY, RC_CHANNELS, SERVO_OUTPUT, ALTITUDE = 251, 350, 65, 36, 141
GPS_RAW, BATTERY_STATUS, AUTOPILOT_VERSION, AVAILABLE_MODES, MESSAGE_INTERVAL = 24, 147, 148, 435, 244

_SENSORS = 0x1 | 0x2 | 0x4 | 0x8 | 0x10 | 0x20 | 0x200000  # gyro, accelerometer, magnetometer, baro, pitot, GPS, AHRS
_RC_RECEIVER, _PREARM = 0x10000, 0x10000000
_CAPABILITIES = 0x2 | 0x8 | 0x10 | 0x2000  # PARAM_FLOAT, COMMAND_INT, PARAM_ENCODE_BYTEWISE, MAVLINK2
_TIMING = {signal.name: place for place, signal in enumerate(TIMING_SIGNALS)}
_BOARD_UID = 0x58_56_31_35_00_00_00_01  # "XV15"


def whole(value: float, low: int, high: int) -> int:
    """A number as an integer that fits its field.

    Args:
        value: Any number; NaN becomes 0 (or the nearest allowed).
        low: Smallest value of the field.
        high: Largest value of the field.
    """
    if math.isnan(value):
        value = 0.0
    return round(min(max(value, low), high))


def real(value: float) -> float:
    """A number as a float32 that can be packed.

    Args:
        value: Any number; what is not finite becomes 0, what is huge is cut.
    """
    return min(max(value, -3.0e38), 3.0e38) if math.isfinite(value) else 0.0


class MessageFactory:
    """Builds messages by id."""

    def __init__(self, config: MavlinkConfig, state: FlightState) -> None:
        """Connect.

        Args:
            config: Settings of the vehicle.
            state: The flight, kept up to date by the vehicle.
        """
        self._config, self._state = config, state
        self._heading = config.home.heading_deg % 360.0
        self._metres_per_degree_east = METRES_PER_DEGREE * max(math.cos(deg(config.home.latitude_deg)), 0.01)
        self._builders: Mapping[int, Callable[[], list[Any]]] = {
            HEARTBEAT: self._heartbeat,
            SYS_STATUS: self._sys_status,
            SYSTEM_TIME: self._system_time,
            EXTENDED_SYS_STATE: self._extended_sys_state,
            ATTITUDE: self._attitude,
            ATTITUDE_QUATERNION: self._attitude_quaternion,
            LOCAL_POSITION: self._local_position,
            GLOBAL_POSITION: self._global_position,
            VFR_HUD: self._vfr_hud,
            NAMED_VALUE_FLOAT: self._named_values,
            DEBUG_FLOAT_ARRAY: self._debug_array,
            RC_CHANNELS: self._rc_channels,
            SERVO_OUTPUT: self._servo_output,
            ALTITUDE: self._altitude,
            GPS_RAW: self._gps,
            BATTERY_STATUS: self._battery,
            HOME_POSITION: self._home,
            CURRENT_MODE: self._current_mode,
        }

    def can_build(self, message_id: int) -> bool:
        """Whether a message of this id is streamed.

        Args:
            message_id: MAVLink message id.
        """
        return message_id in self._builders

    def build(self, message_id: int) -> list[Any]:
        """The message, or messages, of an id from the newest state.

        Args:
            message_id: One for which ``can_build`` holds.
        """
        return self._builders[message_id]()

    @property
    def aids_on(self) -> dict[str, bool]:
        """The pilot aids and whether each is on."""
        bits = int(self._state.feedback.aids)
        return {name: bool(bits >> place & 1) for place, name in enumerate(self._config.aids)}

    @property
    def mode(self) -> FlightMode:
        """The present flight mode."""
        return present_mode(self._state.pilot, self.aids_on)

    @property
    def identity(self) -> tuple[int, ...]:
        """What HEARTBEAT says; a change of it is told at once."""
        message = self._heartbeat()[0]
        return message.base_mode, message.custom_mode, message.system_status

    def autopilot_version(self) -> Any:
        """AUTOPILOT_VERSION: who we are and what we can do."""
        numbers = [int(part) for part in self._config.version.split("+")[0].split(".")[:3] if part.isdigit()]
        major, minor, patch = [*numbers, 0, 0, 0][:3]
        version = (major & 0xFF) << 24 | (minor & 0xFF) << 16 | (patch & 0xFF) << 8  # lowest byte 0: development
        custom = self._config.version.encode("ascii", "replace")[:8].ljust(8, b"\0")
        return dialect.MAVLink_autopilot_version_message(
            _CAPABILITIES, version, 0, 0, 0, list(custom), [0] * 8, [0] * 8, 0, 0, _BOARD_UID
        )

    def available_modes(self, modes: tuple[FlightMode, ...], place: int) -> Any:
        """AVAILABLE_MODES for one mode.

        Args:
            modes: All modes offered.
            place: Which one, from 1.
        """
        mode = modes[place - 1]
        return dialect.MAVLink_available_modes_message(
            len(modes), place, mode.standard, mode.custom_mode, 0, mode.name.encode()
        )

    def _heartbeat(self) -> list[Any]:
        state, mode = self._state, self.mode
        base = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        if state.armed:
            base |= dialect.MAV_MODE_FLAG_SAFETY_ARMED
        if mode.manual:
            base |= dialect.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
        else:
            base |= dialect.MAV_MODE_FLAG_AUTO_ENABLED | dialect.MAV_MODE_FLAG_GUIDED_ENABLED
        if any(self.aids_on.values()) or not mode.manual:
            base |= dialect.MAV_MODE_FLAG_STABILIZE_ENABLED
        if not state.started:
            status = dialect.MAV_STATE_BOOT
        elif not state.armed:
            status = dialect.MAV_STATE_STANDBY
        else:
            status = dialect.MAV_STATE_CRITICAL if state.input_lost else dialect.MAV_STATE_ACTIVE
        generic = self._config.autopilot == "generic"
        autopilot = dialect.MAV_AUTOPILOT_GENERIC if generic else dialect.MAV_AUTOPILOT_PX4
        return [
            dialect.MAVLink_heartbeat_message(
                dialect.MAV_TYPE_VTOL_TILTROTOR, autopilot, base, mode.custom_mode, status, 3
            )
        ]

    def _sys_status(self) -> list[Any]:
        state = self._state
        live = int(state.feedback.input_state) == INPUT_LIVE
        present = _SENSORS | _RC_RECEIVER | _PREARM
        health = _SENSORS | _PREARM | (_RC_RECEIVER if live else 0)
        load = whole(self._loop("work_us") * 1e-6 * state.rate_hz * 1000.0, 0, 1000)
        overruns = whole(self._loop("overruns"), 0, 65535)
        dropped = whole(self._loop("telemetry_dropped"), 0, 65535)
        return [
            dialect.MAVLink_sys_status_message(
                present, present, health, load, BUS_VOLTAGE_MV, -1, 100, 0, 0, overruns, dropped, 0, 0
            )
        ]

    def _loop(self, name: str) -> float:
        return float(self._state.timing[_TIMING[name]])

    def _system_time(self) -> list[Any]:
        return [dialect.MAVLink_system_time_message(time.time_ns() // 1000, self._state.boot_ms)]

    def _extended_sys_state(self) -> list[Any]:
        on_ground = self._state.started and self._state.value("altitude_m") <= 0.05
        landed = dialect.MAV_LANDED_STATE_ON_GROUND if on_ground else dialect.MAV_LANDED_STATE_IN_AIR
        return [dialect.MAVLink_extended_sys_state_message(self._state.vtol_state, landed)]

    def _attitude(self) -> list[Any]:
        value = self._state.value
        return [
            dialect.MAVLink_attitude_message(
                self._state.boot_ms,
                0.0,
                real(deg(value("pitch_deg"))),
                _wrapped(deg(self._heading)),
                0.0,
                real(deg(value("pitch_rate_deg_s"))),
                0.0,
            )
        ]

    def _attitude_quaternion(self) -> list[Any]:
        half_pitch = 0.5 * deg(self._state.value("pitch_deg"))
        half_yaw = 0.5 * _wrapped(deg(self._heading))
        cp, sp, cy, sy = math.cos(half_pitch), math.sin(half_pitch), math.cos(half_yaw), math.sin(half_yaw)
        rate = real(deg(self._state.value("pitch_rate_deg_s")))
        return [
            dialect.MAVLink_attitude_quaternion_message(
                self._state.boot_ms, cp * cy, -sp * sy, sp * cy, cp * sy, 0.0, rate, 0.0
            )
        ]

    def _ground_velocity(self) -> tuple[float, float, float]:
        """North, east, down [m/s]."""
        speed = self._state.value("ground_speed_kt") * KNOT
        heading = deg(self._heading)
        return speed * math.cos(heading), speed * math.sin(heading), -self._state.value("climb_rate_m_s")

    def _ground_position(self) -> tuple[float, float]:
        """North and east of the start [m]."""
        distance, heading = self._state.value("distance_m"), deg(self._heading)
        return distance * math.cos(heading), distance * math.sin(heading)

    def _local_position(self) -> list[Any]:
        north, east = self._ground_position()
        fields = north, east, -self._state.value("altitude_m"), *self._ground_velocity()
        return [dialect.MAVLink_local_position_ned_message(self._state.boot_ms, *map(real, fields))]

    def _latitude_longitude(self) -> tuple[int, int]:
        """Position in 1e-7 degrees."""
        north, east = self._ground_position()
        latitude = self._config.home.latitude_deg + north / METRES_PER_DEGREE
        longitude = self._config.home.longitude_deg + east / self._metres_per_degree_east
        longitude = (longitude + 180.0) % 360.0 - 180.0
        return whole(latitude * 1e7, -900_000_000, 900_000_000), whole(longitude * 1e7, -1_800_000_000, 1_800_000_000)

    def _altitude_amsl(self) -> float:
        return self._state.value("altitude_m") + self._config.home.altitude_m

    def _global_position(self) -> list[Any]:
        latitude, longitude = self._latitude_longitude()
        north, east, down = (whole(100.0 * speed, -32767, 32767) for speed in self._ground_velocity())
        return [
            dialect.MAVLink_global_position_int_message(
                self._state.boot_ms,
                latitude,
                longitude,
                whole(1000.0 * self._altitude_amsl(), -(2**31), 2**31 - 1),
                whole(1000.0 * self._state.value("altitude_m"), -(2**31), 2**31 - 1),
                north,
                east,
                down,
                whole(100.0 * self._heading, 0, 35999),
            )
        ]

    def _vfr_hud(self) -> list[Any]:
        value = self._state.value
        return [
            dialect.MAVLink_vfr_hud_message(
                real(abs(value("airspeed_kt")) * KNOT),
                real(abs(value("ground_speed_kt")) * KNOT),
                whole(self._heading, 0, 359),
                whole(100.0 * value("lever"), 0, 100),
                real(self._altitude_amsl()),
                real(value("climb_rate_m_s")),
            )
        ]

    def _named_values(self) -> list[Any]:
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
        }
        stamp = state.boot_ms
        return [dialect.MAVLink_named_value_float_message(stamp, name, real(v)) for name, v in values.items()]

    def _debug_array(self) -> list[Any]:
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
            self._loop("work_us") * 1e-3,
            1e3 * state.feedback.age,
            state.shown_stick,
            state.feedback.lateral,
            state.feedback.yaw,
            value("corridor_level"),
            value("flap_deg"),
        ]
        data = [real(number) for number in numbers] + [0.0] * (58 - len(numbers))
        return [dialect.MAVLink_debug_float_array_message(state.boot_us, b"xv15", 1, data)]

    def _rc_channels(self) -> list[Any]:
        state = self._state
        channels = (
            1500.0 + 500.0 * state.feedback.lateral,
            1500.0 - 500.0 * state.shown_stick,
            1000.0 + 1000.0 * state.shown_lever,
            1500.0 + 500.0 * state.feedback.yaw,
            1500.0 - 500.0 * state.feedback.nacelle_switch,
            1000.0 + 1000.0 * state.nacelle_command_deg / 90.0,
            {PILOT_EXTERNAL: 1500.0, PILOT_HOLD: 2000.0}.get(state.pilot, 1000.0),
            1000.0 + 1000.0 * float(state.armed),
        )
        raw = [whole(channel, 800, 2200) for channel in channels] + [65535] * 10
        rssi = 100 if int(state.feedback.input_state) == INPUT_LIVE else 0
        return [dialect.MAVLink_rc_channels_message(state.boot_ms, 8, *raw, rssi)]

    def _servo_output(self) -> list[Any]:
        value = self._state.value
        outputs = (
            1500.0 + 500.0 * value("elevator_deg") / 20.0,
            1500.0 + 500.0 * value("cyclic_deg") / 10.0,
            1000.0 + 1000.0 * value("collective_75_deg") / 50.0,
            1000.0 + 1000.0 * value("nacelle_deg") / 90.0,
            1000.0 + 1000.0 * value("flap_deg") / 75.0,
        )
        raw = [whole(output, 800, 2200) for output in outputs] + [0, 0, 0]
        return [dialect.MAVLink_servo_output_raw_message(self._state.boot_us & 0xFFFFFFFF, 0, *raw)]

    def _altitude(self) -> list[Any]:
        height, amsl = real(self._state.value("altitude_m")), real(self._altitude_amsl())
        ground = self._config.home.altitude_m
        return [dialect.MAVLink_altitude_message(self._state.boot_us, amsl, amsl, height, height, ground, height)]

    def _gps(self) -> list[Any]:
        latitude, longitude = self._latitude_longitude()
        north, east, _ = self._ground_velocity()
        speed = math.hypot(north, east)
        course = to_deg(math.atan2(east, north)) % 360.0 if speed > 0.1 else self._heading
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
                whole(100.0 * course, 0, 35999),
                12,
                altitude,
            )
        ]

    def _battery(self) -> list[Any]:
        voltages = [BUS_VOLTAGE_MV] + [65535] * 9
        return [
            dialect.MAVLink_battery_status_message(
                0,
                dialect.MAV_BATTERY_FUNCTION_ALL,
                dialect.MAV_BATTERY_TYPE_UNKNOWN,
                32767,
                voltages,
                -1,
                -1,
                -1,
                100,
                0,
                dialect.MAV_BATTERY_CHARGE_STATE_OK,
            )
        ]

    def _home(self) -> list[Any]:
        home = self._config.home
        half_yaw = 0.5 * _wrapped(deg(self._heading))
        return [
            dialect.MAVLink_home_position_message(
                whole(home.latitude_deg * 1e7, -900_000_000, 900_000_000),
                whole(home.longitude_deg * 1e7, -1_800_000_000, 1_800_000_000),
                whole(home.altitude_m * 1e3, -(2**31), 2**31 - 1),
                0.0,
                0.0,
                0.0,
                [math.cos(half_yaw), 0.0, 0.0, math.sin(half_yaw)],
                math.nan,
                math.nan,
                math.nan,
                self._state.boot_us,
            )
        ]

    def _current_mode(self) -> list[Any]:
        mode = self.mode
        return [dialect.MAVLink_current_mode_message(mode.standard, mode.custom_mode, 0)]


def _wrapped(angle: float) -> float:
    """An angle between -pi and pi [rad]."""
    return math.atan2(math.sin(angle), math.cos(angle))
