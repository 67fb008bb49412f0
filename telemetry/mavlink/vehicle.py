"""The vehicle itself, without a socket: datagrams in, datagrams out, rows and feedback beside them.

The process around it (``vehicle_process``) owns the socket and the clock; tests drive this object directly.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import all as dialect

from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from telemetry.mavlink import messages as ids
from telemetry.mavlink.commands import ACCEPTED, UNSUPPORTED, CommandContext, CommandHandler, command_values
from telemetry.mavlink.config import MavlinkConfig
from telemetry.mavlink.exchange import (
    ALIVE,
    ARMED,
    DISCARDED,
    PEERS,
    RECEIVED,
    Exchange,
)
from telemetry.mavlink.framing import Frame, decode, frames
from telemetry.mavlink.notices import CRITICAL, INFO, NOTICE, WARNING
from telemetry.mavlink.outbox import Outbox
from telemetry.mavlink.parameters import (
    FLAP_COMMAND,
    NACELLE_COMMAND,
    OWNER_TIME,
    ROTOR_SPEED,
    THROTTLE_TRIM,
    WARNINGS,
    ParameterStore,
)
from telemetry.mavlink.peers import MOST_PEERS, Address, Peer
from telemetry.mavlink.services import Services
from telemetry.mavlink.signatures import SignatureCheck
from telemetry.mavlink.state import INPUT_LIVE, INPUT_LOST
from telemetry.mavlink.stick_port import MANUAL_CONTROL, OVERRIDE, StickPort
from telemetry.mavlink.succession import Succession

LONGEST_PAUSE_S = 0.02
"""Changes in the flight are noticed at least this often [s]."""
_LIST_PAUSE_S = 0.004
_CHALLENGE_S = 0.3
_WAITING_TEXTS = {
    1: "Stick stays at trim: centre yours first",
    4: "Lateral stick stays centred: centre yours first",
    8: "Pedals stay centred: centre yours first",
}
_GROUND_HEARTBEAT, _PING, _SET_MODE, _COMMAND_INT, _COMMAND_LONG = 0, 4, 11, 75, 76


class Vehicle(Outbox):
    """One XV-15 as ground stations see it."""

    def __init__(
        self, config: MavlinkConfig, exchange: Exchange, *, send: Callable[[bytes, Address], None], now: float
    ) -> None:
        """Put the vehicle together.

        Args:
            config: Its settings.
            exchange: Shared memory to the flight.
            send: Sends a datagram; must not wait and not raise.

        Raises:
            InputError: A setting, the signing key or the stored parameters are wrong.
        """
        super().__init__(config, exchange, send=send, now=now)
        self._signatures: SignatureCheck | None = None
        if self.signing_key is not None:
            self._signatures = SignatureCheck(self.signing_key, Path(f"{config.signing_key_file}.seen"))
            if self._signatures.trouble:
                self.tell_once("seen", f"Signatures from before this start are refused: {self._signatures.trouble}")
        self.services = Services(self)
        self._commands = CommandHandler(self, self.services)
        self._stick_port = StickPort(self)
        self._answers = {
            **self.services.answers,
            _PING: self._take_ping,
            _SET_MODE: self._take_set_mode,
            _COMMAND_INT: self._take_command,
            _COMMAND_LONG: self._take_command,
        }
        self._handled = {*self._answers, _GROUND_HEARTBEAT, MANUAL_CONTROL, OVERRIDE}
        self._decoder = dialect.MAVLink(None)
        self._identity: tuple[int, ...] = ()
        self._vtol_state = 0
        self._input_state = self._waiting = 0
        self._succession = Succession(self, self._stick_port)
        self._resumed = self._succession.take_up(now)
        if config.parameter_file and not self._resumed:
            self._load_parameters(config.parameter_file)

    # Datagrams

    def receive(self, datagram: bytes, address: Address, *, received_ns: int, now: float) -> None:
        """Act on one datagram.

        Args:
            datagram: What came.
            address: From where.
            received_ns: When, monotonic [ns].
        """
        self.now = now
        self.exchange.header[RECEIVED] += 1
        if len(datagram) < 8 or datagram[0] not in {0xFD, 0xFE} or not self.peers.looked_at(address, now):
            self.exchange.header[DISCARDED] += 1
            return
        peer: Peer | None = None
        for frame in frames(datagram):
            if not self._may_act(frame, address):
                continue
            if peer is None:
                peer = self.peers.learn(address, now, size=len(datagram))
            peer.proved = peer.proved or (self._signatures is not None and frame.signed)
            if frame.message_id in self._handled:
                message = decode(frame, self._decoder)
                if message is not None:
                    self._dispatch(message, frame, peer, received_ns=received_ns, now=now)
        if peer is None:
            self.exchange.header[DISCARDED] += 1
        else:
            self._meet(peer)

    def _may_act(self, frame: Frame, address: Address) -> bool:
        """Whether a frame comes from somebody else and is signed where that is asked for."""
        where = f"{address[0]}:{address[1]}"
        if frame.system_id in {0, self.config.system_id}:
            self.tell_once((address, frame.system_id), f"Ignored {where}: system {frame.system_id} is no station's id")
            return False
        if self._signatures is None:
            return True
        if not self._signatures.accepts(frame):
            why = "its signature is wrong, old or dated ahead" if frame.signed else "not signed"
            self.tell_once((address, frame.signed), f"Ignored {where}: {why}")
            return False
        # A radio may speak without a key, but that earns no telemetry.
        return frame.signed or address in self.peers.by_address

    def _meet(self, peer: Peer) -> None:
        """Make a station of a sender that has shown itself to be one; ask the others to."""
        if self.peers.accept(peer, self.now):
            peer.greeted = False
        if peer.accepted:
            if not peer.greeted:
                peer.greeted = True
                self._greet(peer)
        elif peer.proved:
            self.tell_once("full", f"No room for {peer.address[0]}:{peer.address[1]}: {MOST_PEERS} stations are here")
        elif self.now - peer.challenged >= _CHALLENGE_S:
            peer.challenged = self.now
            self.send(peer, self.factory.build(ids.HEARTBEAT)[0])
            self.send(peer, dialect.MAVLink_ping_message(*self.peers.seal(peer, self.now), 0, 0))

    def _dispatch(self, message: Any, frame: Frame, peer: Peer, *, received_ns: int, now: float) -> None:
        """Hand a message to whoever answers it."""
        number = frame.message_id
        target = getattr(message, "target_system", getattr(message, "target", 0))
        peer.addressed = peer.addressed or target == self.config.system_id
        if number in {MANUAL_CONTROL, OVERRIDE}:
            self._stick_port.take(message, frame, peer, received_ns=received_ns)
            return
        if number == _GROUND_HEARTBEAT:
            if message.type == dialect.MAV_TYPE_GCS:
                peer.last_heartbeat = now
            return
        if self._is_for_us(message):
            self._answers[number](message, frame, peer)

    def _is_for_us(self, message: Any) -> bool:
        """Whether a message is addressed to us or to everybody."""
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in {0, self.config.system_id} and component in {0, self.config.component_id}

    def _take_command(self, message: Any, frame: Frame, peer: Peer) -> None:
        context = CommandContext(command_values(message), peer, self.now)
        answer = self._commands.answer(message.command, context, system_id=frame.system_id)
        self.reply(
            peer,
            dialect.MAVLink_command_ack_message(
                message.command, answer.result, 255, 0, frame.system_id, frame.component_id
            ),
        )
        for extra in answer.messages:
            self.reply(peer, extra)
        if answer.result == ACCEPTED:
            self._tell_changes()

    def _take_ping(self, message: Any, frame: Frame, peer: Peer) -> None:
        """A question, or the answer to ours, which shows that somebody hears us there."""
        if message.target_system == 0:
            self.services.ping(message, frame, peer)
        elif (message.time_usec, message.seq) in {self.peers.seal(peer, self.now, age=age) for age in (0, 1)}:
            peer.proved = True

    def _take_set_mode(self, message: Any, frame: Frame, peer: Peer) -> None:
        """The old way to change modes; acknowledged like the command that replaced it."""
        allowed = self.lock.allowed(frame.system_id)
        result = self._commands.set_mode(message.custom_mode) if allowed else UNSUPPORTED
        self.reply(
            peer,
            dialect.MAVLink_command_ack_message(frame.message_id, result, 255, 0, frame.system_id, frame.component_id),
        )

    # The flight

    def observe(self, rows: FloatArray, now: float) -> None:
        """Take new rows of the flight.

        Args:
            rows: Full rows, oldest first; may be empty.
        """
        starts = not self.state.started and not self._resumed
        if self.state.observe(rows, now):
            self.board.say(INFO, "Flight reset")
            starts = True
        if starts and self.state.started:
            self.services.show_commands(
                {
                    NACELLE_COMMAND: min(max(round(self.state.value("nacelle_deg"), 1), 0.0), 90.0),
                    FLAP_COMMAND: min(max(round(self.state.value("flap_deg"), 1), 0.0), 75.0),
                    THROTTLE_TRIM: 0.0,
                    ROTOR_SPEED: round(self.state.value("rotor_speed_rpm"), 1),
                }
            )

    # Sending

    def tick(self, now: float) -> float:
        """Do what is due.

        Returns:
            When to call again at the latest, monotonic [s].
        """
        self.now = now
        for severity, text in self.exchange.take_texts():
            self.board.say(severity, text)
        feedback = self.exchange.read_feedback()
        if feedback is not None:
            self.state.feedback = feedback
        if self.state.watch_flight(int(self.exchange.header[ALIVE]), now):
            if self.state.stalled:
                self.board.say(CRITICAL, "The flight does not answer: values are old")
            else:
                self.board.say(NOTICE, "The flight answers again")
        if self.state.started:
            self.state.update_vtol_state()
        self._follow_input()
        self._tell_changes()
        self.services.follow_flight(now)
        if self.state.started:
            self.board.watch(self.state, enabled=self.store[WARNINGS] == 1.0)
        self._look_after_peers(now)
        self._stream(now)
        notice = self.board.take(now)
        if notice is not None:
            self.broadcast(dialect.MAVLink_statustext_message(notice.severity, notice.text.encode()))
        header = self.exchange.header
        header[PEERS], header[ARMED] = self.peers.heard, int(self.state.armed)
        self._succession.put_by()
        listing = any(peer.parameter_next >= 0 for peer in self.peers.by_address.values())
        due = min((peer.schedule.next_due for peer in self.peers.by_address.values()), default=math.inf)
        return min(due, now + (_LIST_PAUSE_S if listing else LONGEST_PAUSE_S))

    def farewell(self) -> None:
        """Tell every station that the flight is over."""
        self.state.armed = False
        for severity, text in self.exchange.take_texts():
            self.board.say(severity, text)
        self.board.say(INFO, "Flight over")
        while (notice := self.board.take(self.now)) is not None:
            self.broadcast(dialect.MAVLink_statustext_message(notice.severity, notice.text.encode()))
        heartbeat = self.factory.build(ids.HEARTBEAT)[0]
        heartbeat.system_status = dialect.MAV_STATE_POWEROFF
        self.broadcast(heartbeat)

    def _stream(self, now: float) -> None:
        """Send every stream that is due; each message is made once for all stations."""
        made: dict[int, list[Any]] = {}
        for peer in self.peers.by_address.values():
            if peer.parameter_next >= 0:
                self.services.continue_list(peer)
            for number in peer.schedule.take_due(now):
                if number != ids.HEARTBEAT and (self.state.stalled or not self.state.started):
                    continue  # what is not known any more is not repeated as if it were
                if number not in made:
                    made[number] = self.factory.build(number)
                for message in made[number]:
                    self.send(peer, message)

    def _tell_changes(self) -> None:
        """HEARTBEAT and EXTENDED_SYS_STATE at once when what they say changes."""
        identity = self.factory.identity
        if identity != self._identity:
            self._identity = identity
            self.broadcast(self.factory.build(ids.HEARTBEAT)[0])
        if self.state.started and self.state.vtol_state != self._vtol_state:
            self._vtol_state = self.state.vtol_state
            self.broadcast(self.factory.build(ids.EXTENDED_SYS_STATE)[0])

    def _follow_input(self) -> None:
        """Say when sticks are lost and when they are back."""
        present = int(self.state.feedback.input_state)
        if present == INPUT_LOST and self._input_state == INPUT_LIVE:
            self.board.say(WARNING, "Sticks lost: centred, lever and nacelle held")
        elif present == INPUT_LIVE and self._input_state == INPUT_LOST:
            self.board.say(INFO, "Sticks regained")
        self._input_state = present
        waiting, self._waiting = self._waiting, int(self.state.feedback.waiting)
        if self._waiting & ~waiting & 2:
            lever = 100.0 * self.state.feedback.lever
            self.board.say_seldom("lever", NOTICE, f"Lever stays at {lever:.0f} %: move yours through it", self.now)
        for bit, text in _WAITING_TEXTS.items():
            if self._waiting & ~waiting & bit:
                self.board.say_seldom(text, NOTICE, text, self.now)

    def _look_after_peers(self, now: float) -> None:
        owner = self.lock.owner
        if self.lock.release_if_silent(now, release_after=self.store[OWNER_TIME]):
            self.tell(INFO, f"Sticks free, {owner} is silent")
        self.peers.forget_silent(now)
        for peer in self.peers.by_address.values():
            self.board.watch_peer(peer, now)

    def _greet(self, peer: Peer) -> None:
        self.send(peer, self.factory.build(ids.HEARTBEAT)[0])
        text = f"XV-15 SIM, rtsim {self.config.version}: {self.config.title}"
        self.send(peer, dialect.MAVLink_statustext_message(INFO, text.encode("ascii", "replace")[:50]))

    def _load_parameters(self, path: str) -> None:
        """Start with stored values; the flight hears of those that differ from what it was told."""
        try:
            self.store.load(path)
        except (InputError, OSError) as failure:
            self.board.say(WARNING, f"Parameters not loaded: {failure}")
            return
        told = ParameterStore(self.config.aids, self.config.parameters)
        for parameter in self.store.declared:
            if self.store[parameter.name] != told[parameter.name]:
                self.services.hand_over(parameter.name, time.monotonic())
