"""What the parts of a vehicle share: settings and state, and the ways out to the stations and to the flight."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from telemetry.mavlink.config import MavlinkConfig, read_signing_key
from telemetry.mavlink.exchange import SENT, Exchange, Request
from telemetry.mavlink.messages import MessageFactory
from telemetry.mavlink.modes import offered_modes
from telemetry.mavlink.notices import WARNING, NoticeBoard
from telemetry.mavlink.parameters import ParameterStore
from telemetry.mavlink.peers import Address, Peer, PeerTable
from telemetry.mavlink.pilot_input import OwnerLock, StickReader
from telemetry.mavlink.state import FlightState

_MOST_TOLD = 16
"""Nobody may fill the flight's log by being refused again and again."""


class Outbox:
    """Settings, state and stations of a vehicle; sends, and asks the flight."""

    def __init__(
        self, config: MavlinkConfig, exchange: Exchange, *, send: Callable[[bytes, Address], None], now: float
    ) -> None:
        """Make what is shared.

        Args:
            config: The vehicle's settings.
            exchange: Shared memory to the flight.
            send: Sends a datagram; must not wait and not raise.
        """
        self.config = config
        self.now = now
        """Time of the newest call, monotonic [s]."""
        self.state = FlightState(config.rate_hz, config.ratings)
        self.store = ParameterStore(config.aids, config.parameters)
        self.factory = MessageFactory(config, self.state)
        self.modes = offered_modes(config.aids)
        self.board = NoticeBoard(now)
        self.lock = OwnerLock(config.whitelist)
        self.reader = StickReader(config.axes, config.buttons)
        self.signing_key = key = read_signing_key(config.signing_key_file) if config.signing_key_file else None
        targets = tuple((target.host, target.port) for target in config.targets)
        self.peers = PeerTable(
            targets, own=(config.system_id, config.component_id), fastest_hz=config.rate_hz, key=key, now=now
        )
        self.exchange = exchange
        """Shared memory to the flight."""
        self.set_after_reset: set[str] | None = None
        """Parameters set since a reset was asked for, which act after it; None where none was."""
        self._send = send
        self._told: set[object] = set()

    def tell(self, severity: int, text: str) -> None:
        """Say something at every station that is worth an event of the flight too.

        Args:
            severity: MAV_SEVERITY.
            text: One line; stations show 50 characters of it.
        """
        self.board.say(severity, text)
        self.exchange.put_note(text)

    def tell_once(self, key: object, text: str) -> None:
        """Tell, once, what would otherwise go unnoticed.

        Args:
            key: What it is about.
            text: One line.
        """
        if key not in self._told and len(self._told) < _MOST_TOLD:
            self._told.add(key)
            self.tell(WARNING, text)

    def request(self, request: Request) -> None:
        """Ask the flight for something.

        Args:
            request: What.
        """
        if request.kind == "reset":
            self.set_after_reset = set()
        if not self.exchange.put_request(request):
            self.board.say_seldom("queue", WARNING, "The flight does not listen", self.now)

    def send(self, peer: Peer, message: Any) -> None:
        """Send a message to one station.

        Args:
            peer: The station.
            message: A pymavlink message.
        """
        packed = self.peers.pack(peer, message, self.now)
        if packed is not None:
            self._send(packed, peer.address)
            self.exchange.header[SENT] += 1

    def reply(self, peer: Peer, message: Any) -> None:
        """Answer one station, unless it has used up its answers for now.

        Args:
            peer: The station.
            message: A pymavlink message.
        """
        if peer.replies.take(self.now):
            self.send(peer, message)

    def broadcast(self, message: Any) -> None:
        """Send a message to every station.

        Args:
            message: A pymavlink message.
        """
        for peer in self.peers.by_address.values():
            self.send(peer, message)
