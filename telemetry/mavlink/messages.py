"""Makes every streamed message by its id, and those that say who the vehicle is. Units as in docs/mavlink.md."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any

from pymavlink.dialects.v20 import all as dialect

from rtsim.units import deg
from telemetry.mavlink.config import MavlinkConfig
from telemetry.mavlink.fields import whole, wrapped
from telemetry.mavlink.flight_messages import FlightMessages, loop_value
from telemetry.mavlink.modes import FlightMode, present_mode
from telemetry.mavlink.state import INPUT_LIVE, FlightState

BUS_VOLTAGE_MV = 28_000
"""Nominal direct-current bus of the aircraft [mV]; electrics are not modelled."""
HEARTBEAT, SYS_STATUS, SYSTEM_TIME, EXTENDED_SYS_STATE, CURRENT_MODE, HOME_POSITION = 0, 1, 2, 245, 436, 242
ATTITUDE, ATTITUDE_QUATERNION, LOCAL_POSITION, GLOBAL_POSITION, VFR_HUD = 30, 31, 32, 33, 74
NAMED_VALUE_FLOAT, DEBUG_FLOAT_ARRAY, RC_CHANNELS, SERVO_OUTPUT, ALTITUDE = 251, 350, 65, 36, 141
GPS_RAW, BATTERY_STATUS, AUTOPILOT_VERSION, AVAILABLE_MODES, MESSAGE_INTERVAL = 24, 147, 148, 435, 244
WIND = 231

_SENSORS = 0x1 | 0x2 | 0x4 | 0x8 | 0x10 | 0x20 | 0x200000  # gyro, accelerometer, magnetometer, baro, pitot, GPS, AHRS
_RC_RECEIVER, _PREARM = 0x10000, 0x10000000
_CAPABILITIES = 0x2 | 0x8 | 0x10 | 0x2000  # PARAM_FLOAT, COMMAND_INT, PARAM_ENCODE_BYTEWISE, MAVLINK2
_BOARD_UID = 0x58_56_31_35_00_00_00_01  # "XV15"


class MessageFactory:
    """Builds messages by id."""

    def __init__(self, config: MavlinkConfig, state: FlightState) -> None:
        """Connect.

        Args:
            config: Settings of the vehicle.
            state: The flight, kept up to date by the vehicle.
        """
        self._config, self._state = config, state
        flight = FlightMessages(config.home, state)
        self._builders: Mapping[int, Callable[[], list[Any]]] = {
            HEARTBEAT: self._heartbeat,
            SYS_STATUS: self._sys_status,
            SYSTEM_TIME: self._system_time,
            EXTENDED_SYS_STATE: self._extended_sys_state,
            ATTITUDE: flight.attitude,
            ATTITUDE_QUATERNION: flight.attitude_quaternion,
            LOCAL_POSITION: flight.local_position,
            GLOBAL_POSITION: flight.global_position,
            VFR_HUD: flight.vfr_hud,
            NAMED_VALUE_FLOAT: flight.named_values,
            DEBUG_FLOAT_ARRAY: flight.debug_array,
            RC_CHANNELS: flight.rc_channels,
            SERVO_OUTPUT: flight.servo_output,
            ALTITUDE: flight.altitude,
            GPS_RAW: flight.gps,
            WIND: flight.wind,
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
        elif state.stalled:
            status = dialect.MAV_STATE_EMERGENCY
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
        load = whole(loop_value(state, "work_us") * 1e-6 * state.rate_hz * 1000.0, 0, 1000)
        overruns = whole(loop_value(state, "overruns"), 0, 65535)
        dropped = whole(loop_value(state, "telemetry_dropped"), 0, 65535)
        return [
            dialect.MAVLink_sys_status_message(
                present, present, health, load, BUS_VOLTAGE_MV, -1, 100, 0, 0, overruns, dropped, 0, 0
            )
        ]

    def _system_time(self) -> list[Any]:
        return [dialect.MAVLink_system_time_message(time.time_ns() // 1000, self._state.boot_ms)]

    def _extended_sys_state(self) -> list[Any]:
        on_ground = self._state.started and self._state.value("altitude_m") <= 0.05
        landed = dialect.MAV_LANDED_STATE_ON_GROUND if on_ground else dialect.MAV_LANDED_STATE_IN_AIR
        return [dialect.MAVLink_extended_sys_state_message(self._state.vtol_state, landed)]

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
        half_yaw = 0.5 * wrapped(deg(home.heading_deg))
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
