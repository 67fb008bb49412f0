"""Sends MANUAL_CONTROL to a MAVLink vehicle, any vehicle, and keeps what it says about itself."""

from __future__ import annotations

import contextlib
import math
import socket
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import all as dialect

from rtsim.errors import InputError
from telemetry.exchange.endpoint import Endpoint
from telemetry.joystick.mapping import Controls
from telemetry.mavlink.framing import LARGEST_DATAGRAM, decode, frames

SYSTEM_ID, COMPONENT_ID = 255, 190
"""A ground station, as every vehicle expects it."""
_SILENCE_S = 3.0
_RC_CHANNELS, _REQUEST_MESSAGE = 65, 512


@dataclass(slots=True)
class VehicleView:
    """What the vehicle said last."""

    system_id: int = 0
    """Its system id; 0 while none was heard."""
    address: tuple[str, int] | None = None
    """Where it is."""
    heard: float = -1e9
    """When it was heard last, monotonic [s]."""
    armed: bool = False
    """Whether it is armed."""
    custom_mode: int = 0
    """Its mode, as in HEARTBEAT."""
    applied_lever: float | None = None
    """Power lever that acts there, 0 to 1; None while it has not told."""
    values: dict[str, float] = field(default_factory=dict)
    """Named values, airspeed [kn], altitude [m], climb rate [m/s], pitch [deg]."""
    texts: list[str] = field(default_factory=list)
    """Its newest texts, the last one last."""

    @property
    def present(self) -> bool:
        """Whether it was heard lately."""
        return time.monotonic() - self.heard < _SILENCE_S


class Sender:
    """A UDP end that finds a vehicle and flies it."""

    def __init__(self, *, listen: Endpoint | None, connect: Endpoint | None) -> None:
        """Open the socket.

        Args:
            listen: Where to wait for a vehicle, as ground stations do.
            connect: Where to call a vehicle; None waits for one.

        Raises:
            InputError: The port is taken.
        """
        self.vehicle = VehicleView()
        """The vehicle."""
        self._connect = (connect.host, connect.port) if connect else None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            if self._connect is not None:
                self._socket.connect(self._connect)  # from now on the system drops what others send
            elif listen is not None:
                self._socket.bind((listen.host, listen.port))
        except OSError as failure:
            self._socket.close()
            if connect is not None:
                raise InputError(
                    f"cannot be reached ({failure.strerror})", key="--connect", value=str(connect)
                ) from failure
            raise InputError(
                f"the port cannot be opened ({failure.strerror})",
                key="--listen",
                value=str(listen),
                mend="a ground station may have it: send MAVLink to a second port (rtsim fly ... --mavlink "
                "127.0.0.1:14551) and listen there",
            ) from failure
        self._socket.setblocking(False)
        self._encoder = dialect.MAVLink(None, srcSystem=SYSTEM_ID, srcComponent=COMPONENT_ID)
        self._decoder = dialect.MAVLink(None)
        self._beat = -1e9
        self._waited = False
        self.sent = 0
        """MANUAL_CONTROL messages sent."""

    @property
    def port(self) -> int:
        """UDP port in use."""
        return int(self._socket.getsockname()[1])

    @property
    def knows_lever(self) -> bool:
        """Whether the vehicle has told where its power lever is; until then nothing is sent that could move it."""
        return self.vehicle.applied_lever is not None

    def poll(self) -> None:
        """Take what came, and say once a second that we are here."""
        while True:
            try:
                data, address = self._socket.recvfrom(LARGEST_DATAGRAM)
            except (BlockingIOError, InterruptedError):
                break
            except OSError:
                continue  # an ICMP error of something sent earlier
            for frame in frames(data):
                message = decode(frame, self._decoder)
                if message is not None:
                    self._take(message, frame.system_id, frame.component_id, address)
        now = time.monotonic()
        if now - self._beat >= 1.0 and self._target() is not None:
            self._beat = now
            self._send(
                dialect.MAVLink_heartbeat_message(
                    dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
                )
            )
            if self._waited and not self.knows_lever:
                self._command(_REQUEST_MESSAGE, _RC_CHANNELS)
            self._waited = self.vehicle.system_id != 0

    def fly(self, controls: Controls) -> None:
        """Send sticks and buttons, and what was pressed.

        Args:
            controls: The sticks now.
        """
        if self.vehicle.system_id == 0:
            return
        self._act(controls.pressed)
        self._send(dialect.MAVLink_manual_control_message(self.vehicle.system_id, *controls.manual_control()))
        self.sent += 1

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _act(self, pressed: Iterable[str]) -> None:
        system = self.vehicle.system_id
        if "arm" in pressed:
            self._command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0.0 if self.vehicle.armed else 1.0)
        if "reset" in pressed:
            real32 = dialect.MAV_PARAM_TYPE_REAL32
            self._send(dialect.MAVLink_param_set_message(system, 1, b"XV_RESET", 1.0, real32))

    def _command(self, number: int, value: float) -> None:
        self._send(dialect.MAVLink_command_long_message(self.vehicle.system_id, 1, number, 0, value, 0, 0, 0, 0, 0, 0))

    def _target(self) -> tuple[str, int] | None:
        return self._connect or self.vehicle.address

    def _send(self, message: Any) -> None:
        target = self._target()
        if target is None:
            return
        packed = message.pack(self._encoder)
        self._encoder.seq = (self._encoder.seq + 1) % 256
        with contextlib.suppress(OSError):  # sticks are sent again in 20 ms
            if self._connect is not None:
                self._socket.send(packed)
            else:
                self._socket.sendto(packed, target)

    def _take(self, message: Any, system: int, component: int, address: tuple[str, int]) -> None:
        view, name = self.vehicle, message.get_type()
        known = (system, address) == (view.system_id, view.address)
        if not known and (view.present or name != "HEARTBEAT"):
            return  # one vehicle at a time, where it was found
        if name == "HEARTBEAT":
            if component != 1 or message.type == dialect.MAV_TYPE_GCS:
                return
            if not known:
                view.applied_lever = None  # another vehicle's lever is somewhere else
            view.system_id, view.address = system, address
            view.armed = bool(message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
            view.custom_mode = message.custom_mode
        elif name == "PING" and message.target_system == 0:
            self._send(dialect.MAVLink_ping_message(message.time_usec, message.seq, system, component))
        view.heard = time.monotonic()
        self._keep(message, name)

    def _keep(self, message: Any, name: str) -> None:
        """Keep what the vehicle says about itself."""
        view = self.vehicle
        if name == "RC_CHANNELS":
            view.applied_lever = min(max((message.chan3_raw - 1000) / 1000.0, 0.0), 1.0)
        elif name == "NAMED_VALUE_FLOAT":
            if message.name in view.values or len(view.values) < 64:
                view.values[message.name] = message.value
        elif name == "VFR_HUD":
            view.values |= {
                "airspeed_kt": message.airspeed * 3600.0 / 1852.0,
                "altitude_m": message.alt,
                "climb_m_s": message.climb,
            }
        elif name == "ATTITUDE":
            view.values |= {
                "pitch_deg": math.degrees(message.pitch),
                "bank_deg": math.degrees(message.roll),
                "heading_deg": math.degrees(message.yaw) % 360.0,
            }
        elif name == "STATUSTEXT":
            view.texts = [*view.texts[-5:], message.text]
