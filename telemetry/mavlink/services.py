"""The protocols beside commands: parameters, missions (there are none), time synchronisation, ping, files (none).

Legend:
    message: The request.
    frame: Its frame.
    peer: Who asked.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import all as dialect

from rtsim.units import deg, rpm
from telemetry.mavlink.exchange import Request
from telemetry.mavlink.framing import Frame
from telemetry.mavlink.outbox import Outbox
from telemetry.mavlink.parameters import (
    AID_PARAMETERS,
    FLAP_COMMAND,
    NACELLE_COMMAND,
    PILOT,
    RESET,
    ROTOR_SPEED,
    THROTTLE_TRIM,
)
from telemetry.mavlink.peers import Peer
from telemetry.mavlink.state import PILOT_EXTERNAL, PILOT_HOLD, PILOT_MOCM

Answerer = Callable[[Any, Frame, Peer], None]
"""Answers a message, given with its frame and its sender."""

PARAMETERS_PER_TICK = 5
"""Parameters of a list sent to one station at a time."""
SETTLING_S = 0.3
"""How long a changed parameter is not overwritten by what the flight still says [s]."""
_PILOT_NAMES = {PILOT_MOCM: "mocm", PILOT_EXTERNAL: "external", PILOT_HOLD: "hold"}
_REAL32 = dialect.MAV_PARAM_TYPE_REAL32
_NOT_FOUND, _OUT_OF_RANGE = 1, 2  # MAV_PARAM_ERROR: does not exist, value out of range
_READ_ONLY = 3  # MAV_PARAM_ERROR: permission denied
_MISSION_RESULTS = {
    38: dialect.MAV_MISSION_UNSUPPORTED,  # MISSION_WRITE_PARTIAL_LIST
    39: dialect.MAV_MISSION_UNSUPPORTED,  # MISSION_ITEM
    37: dialect.MAV_MISSION_UNSUPPORTED,  # MISSION_REQUEST_PARTIAL_LIST
    40: dialect.MAV_MISSION_INVALID_SEQUENCE,  # MISSION_REQUEST
    44: dialect.MAV_MISSION_UNSUPPORTED,  # MISSION_COUNT: an upload
    45: dialect.MAV_MISSION_ACCEPTED,  # MISSION_CLEAR_ALL: nothing is there
    51: dialect.MAV_MISSION_INVALID_SEQUENCE,  # MISSION_REQUEST_INT
    73: dialect.MAV_MISSION_UNSUPPORTED,  # MISSION_ITEM_INT
}
_FTP_NAK, _FTP_FAIL = 129, 1


class Services:
    """Answers for a outbox."""

    def __init__(self, outbox: Outbox) -> None:
        """Connect.

        Args:
            outbox: What the vehicle shares with its parts.
        """
        self._outbox = outbox
        self._settling: dict[str, float] = {}
        self.answers: dict[int, Answerer] = {
            20: self.read_parameter,
            21: self.list_parameters,
            23: self.set_parameter,
            43: self.mission_count,
            110: self.refuse_file_transfer,
            111: self.timesync,
            117: self.log_list,
            119: self.log_data,
            183: self.version,
            320: self.extended_parameters,
            321: self.extended_parameters,
            **dict.fromkeys(_MISSION_RESULTS, self.mission_result),
        }
        """What answers each message, by its id."""

    # Parameters

    def list_parameters(self, message: Any, frame: Frame, peer: Peer) -> None:  # noqa: ARG002 - as every answer
        """Begin to send all parameters; a list under way goes on."""
        peer.parameter_next = max(peer.parameter_next, 0)

    def continue_list(self, peer: Peer) -> None:
        """Send the next few parameters of a list.

        Args:
            peer: Who asked for it.
        """
        store = self._outbox.store
        for _ in range(PARAMETERS_PER_TICK):
            if not 0 <= peer.parameter_next < len(store):
                peer.parameter_next = -1
                return
            self._outbox.send(peer, self._value_message(peer.parameter_next))
            peer.parameter_next += 1

    def read_parameter(self, message: Any, frame: Frame, peer: Peer) -> None:
        """Answer PARAM_REQUEST_READ, by index or name."""
        store = self._outbox.store
        name = _name(message.param_id)
        place = store.index.get(name, -1) if message.param_index < 0 else message.param_index
        if 0 <= place < len(store):
            self._outbox.reply(peer, self._value_message(place))
        else:
            self._parameter_error(frame, peer, name, message.param_index, _NOT_FOUND)

    def set_parameter(self, message: Any, frame: Frame, peer: Peer) -> None:
        """Answer PARAM_SET: everybody hears the value now in force."""
        outbox = self._outbox
        name = _name(message.param_id)
        place = outbox.store.index.get(name)
        if place is None:
            self._parameter_error(frame, peer, name, -1, _NOT_FOUND)
            return
        before = outbox.store[name]
        error = 0
        if not outbox.lock.allowed(frame.system_id):
            error = _READ_ONLY
        elif message.param_type != _REAL32 or outbox.store.set(name, _shortest(message.param_value)) is None:
            error = _OUT_OF_RANGE
        if error:
            self._parameter_error(frame, peer, name, place, error)
            outbox.reply(peer, self._value_message(place))
            return
        self.hand_over(name, outbox.now)
        if outbox.store[name] == before:
            outbox.reply(peer, self._value_message(place))
        else:
            outbox.broadcast(self._value_message(place))

    def tell_all_parameters(self) -> None:
        """Hand every value to the flight (after a load) and show them to everybody."""
        outbox = self._outbox
        for parameter in outbox.store.declared:
            if parameter.stored:
                self.hand_over(parameter.name, outbox.now)
        for peer in outbox.peers.by_address.values():
            if peer.last_heard > 0.0:
                peer.parameter_next = 0

    def follow_flight(self, now: float) -> None:
        """Let the parameters of pilot and aids say what is true, also after buttons, keys and modes."""
        outbox = self._outbox
        if not outbox.state.started:
            return
        present = {AID_PARAMETERS[aid][0]: float(on) for aid, on in outbox.factory.aids_on.items()}
        present[PILOT] = float(outbox.state.pilot)
        for name, value in present.items():
            if outbox.store[name] != value and now >= self._settling.get(name, 0.0):
                outbox.store.set(name, value)
                outbox.broadcast(self._value_message(outbox.store.index[name]))

    def show_commands(self, values: Mapping[str, float]) -> None:
        """Let parameters that are commands say where the flight stands, as it does at a start.

        Those set since a station asked for the reset stay: they act after it.

        Args:
            values: By name.
        """
        outbox = self._outbox
        kept, self._outbox.set_after_reset = self._outbox.set_after_reset or set(), None
        for name, value in values.items():
            if name not in kept and outbox.store[name] != value:
                outbox.store.set(name, value)
                outbox.broadcast(self._value_message(outbox.store.index[name]))

    def hand_over(self, name: str, now: float) -> None:
        """Pass a changed parameter on to the flight.

        Args:
            name: The parameter.
        """
        outbox = self._outbox
        value = outbox.store[name]
        self._settling[name] = now + SETTLING_S
        if name == RESET:
            if value == 1.0:
                outbox.request(Request("reset"))
            outbox.store.set(RESET, 0.0)
            return
        if self._outbox.set_after_reset is not None:
            self._outbox.set_after_reset.add(name)
        if name == PILOT:
            outbox.request(Request("pilot", _PILOT_NAMES[int(value)]))
            return
        if name == NACELLE_COMMAND:
            outbox.request(Request("nacelle", "", deg(value)))
            return
        if name == FLAP_COMMAND:
            outbox.request(Request("flaps", "", deg(value)))
            return
        if name == THROTTLE_TRIM:
            outbox.request(Request("throttle", "", value / 100.0))
            return
        if name == ROTOR_SPEED:
            outbox.request(Request("rotor_speed", "", rpm(value)))
            return
        for aid, (parameter, _) in AID_PARAMETERS.items():
            if parameter == name:
                outbox.request(Request("aid", aid, value))
                return
        outbox.request(Request("parameter", name, value))

    def _value_message(self, place: int) -> Any:
        parameter, value = self._outbox.store.at(place)
        return dialect.MAVLink_param_value_message(
            parameter.name.encode(), value, _REAL32, len(self._outbox.store), place
        )

    def _parameter_error(self, frame: Frame, peer: Peer, name: str, place: int, error: int) -> None:
        place = place if -1 <= place <= 32767 else -1
        text = name.encode("ascii", "replace")[:16]
        self._outbox.reply(
            peer, dialect.MAVLink_param_error_message(frame.system_id, frame.component_id, text, place, error)
        )

    # Missions: none, said at once, since silence costs a ground station many seconds

    def mission_count(self, message: Any, frame: Frame, peer: Peer) -> None:
        """Answer MISSION_REQUEST_LIST: nothing is stored."""
        answer = dialect.MAVLink_mission_count_message(frame.system_id, frame.component_id, 0, message.mission_type)
        self._outbox.reply(peer, answer)

    def mission_result(self, message: Any, frame: Frame, peer: Peer) -> None:
        """Answer any other mission request."""
        result = _MISSION_RESULTS[frame.message_id]
        answer = dialect.MAVLink_mission_ack_message(
            frame.system_id, frame.component_id, result, getattr(message, "mission_type", 0)
        )
        self._outbox.reply(peer, answer)

    # What there is none of: logs to download (the flight's own log stays where it is flown), parameters of text

    def log_list(self, message: Any, frame: Frame, peer: Peer) -> None:  # noqa: ARG002 - as every answer
        """Answer LOG_REQUEST_LIST: there are none."""
        self._outbox.reply(peer, dialect.MAVLink_log_entry_message(0, 0, 0, 0, 0))

    def log_data(self, message: Any, frame: Frame, peer: Peer) -> None:  # noqa: ARG002 - as every answer
        """Answer LOG_REQUEST_DATA: no bytes."""
        self._outbox.reply(peer, dialect.MAVLink_log_data_message(message.id, message.ofs, 0, [0] * 90))

    def extended_parameters(self, message: Any, frame: Frame, peer: Peer) -> None:  # noqa: ARG002 - as every answer
        """Answer PARAM_EXT_REQUEST_LIST and _READ: none of them."""
        self._outbox.reply(peer, dialect.MAVLink_param_ext_value_message(b"", b"", _REAL32, 0, 0))

    def version(self, message: Any, frame: Frame, peer: Peer) -> None:  # noqa: ARG002 - as every answer
        """Answer AUTOPILOT_VERSION_REQUEST, the old way to ask."""
        self._outbox.reply(peer, self._outbox.factory.autopilot_version())

    # Clocks

    def timesync(self, message: Any, frame: Frame, peer: Peer) -> None:  # noqa: ARG002 - as every answer
        """Answer a TIMESYNC request with the simulated time."""
        if message.tc1 == 0:
            now_ns = self._outbox.state.boot_ns(self._outbox.now)
            self._outbox.reply(peer, dialect.MAVLink_timesync_message(now_ns, message.ts1))

    def ping(self, message: Any, frame: Frame, peer: Peer) -> None:
        """Answer a PING to its sender.

        Args:
            message: The ping.
        """
        if message.target_system == 0 and message.target_component == 0:
            answer = dialect.MAVLink_ping_message(message.time_usec, message.seq, frame.system_id, frame.component_id)
            self._outbox.reply(peer, answer)

    def refuse_file_transfer(self, message: Any, frame: Frame, peer: Peer) -> None:
        """Say no to a file request, so that the client goes on without waiting."""
        asked = bytes(message.payload)
        sequence = (int.from_bytes(asked[:2], "little") + 1) & 0xFFFF
        payload = bytearray(251)
        payload[0:2] = sequence.to_bytes(2, "little")
        payload[2], payload[3], payload[4], payload[5] = asked[2], _FTP_NAK, 1, asked[3]
        payload[12] = _FTP_FAIL
        answer = dialect.MAVLink_file_transfer_protocol_message(0, frame.system_id, frame.component_id, list(payload))
        self._outbox.reply(peer, answer)


def _shortest(value: float) -> float:
    """The shortest decimal that a float32 stands for, so that 0.3 is 0.3 again."""
    return float(str(np.float32(value)))


def _name(raw: Any) -> str:
    """A parameter name as it travels: text, or bytes with zeros after it."""
    text = raw.decode("ascii", "replace") if isinstance(raw, bytes) else str(raw)
    return text.split("\0", 1)[0]
