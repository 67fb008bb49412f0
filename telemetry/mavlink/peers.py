"""Ground stations: who is heard, who is sent to, and how much work each may cause."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import all as dialect

from telemetry.mavlink.framing import signature_time
from telemetry.mavlink.streams import StreamSchedule

Address = tuple[str, int]
MOST_PEERS = 8
"""Ground stations learned from what they send; configured targets come on top."""
PEER_EXPIRY_S = 10.0
"""A learned station that is silent for this long is forgotten [s]."""
HEARTBEAT_WARNING_S = 3.0
"""A station whose heartbeat is missing for this long is missed [s]."""
PEER_RATE, PEER_BURST = 1000.0, 500.0
"""Datagrams per second, and at once, that one station may have looked at."""
STRANGER_RATE, STRANGER_BURST = 200.0, 100.0
"""The same for all unknown addresses together."""
REPLY_RATE, REPLY_BURST = 500.0, 300.0
"""Answers per second, and at once, that one station may cause."""


class TokenBucket:
    """Lets through so many per second on average, and so many at once."""

    __slots__ = ("_burst", "_last", "_rate", "_tokens")

    def __init__(self, rate: float, burst: float, now: float) -> None:
        """Start full.

        Args:
            rate: Tokens per second.
            burst: Most tokens kept.
        """
        self._rate, self._burst, self._tokens, self._last = rate, burst, burst, now

    def take(self, now: float) -> bool:
        """Take one token if there is one."""
        tokens = min(self._burst, self._tokens + (now - self._last) * self._rate)
        self._last = now
        if tokens < 1.0:
            self._tokens = tokens
            return False
        self._tokens = tokens - 1.0
        return True


@dataclass(slots=True)
class Peer:
    """One ground station, or several programs behind one address."""

    address: Address
    """Where it is."""
    configured: bool
    """It was named by the user and is never forgotten."""
    encoder: Any
    """Numbers and packs what is sent to it (``MAVLink`` of pymavlink)."""
    schedule: StreamSchedule
    """What it is sent and when."""
    incoming: TokenBucket
    """How many of its datagrams are looked at."""
    replies: TokenBucket
    """How many answers it may cause."""
    last_heard: float = -1e9
    """Last valid frame, monotonic [s]."""
    last_heartbeat: float = -1e9
    """Last HEARTBEAT of a ground station there, monotonic [s]."""
    missed: bool = False
    """Its heartbeat is missing, and that was said."""
    greeted: bool = False
    """It was told who we are."""
    parameter_next: int = -1
    """Index of the next parameter of a list under way; -1 none."""
    ids: set[tuple[int, int]] = field(default_factory=set)
    """System and component ids heard from there."""


class PeerTable:
    """All ground stations by address."""

    def __init__(
        self, targets: tuple[Address, ...], *, own: tuple[int, int], fastest_hz: float, key: bytes | None, now: float
    ) -> None:
        """Begin with the configured targets.

        Args:
            targets: Where telemetry goes unasked.
            own: Own system and component id.
            fastest_hz: Frame rate.
            key: Signing key, or None.
        """
        self._own, self._fastest_hz, self._key = own, fastest_hz, key
        self._links = 0
        self.by_address: dict[Address, Peer] = {}
        """Every ground station."""
        self.strangers = TokenBucket(STRANGER_RATE, STRANGER_BURST, now)
        """How many datagrams of unknown addresses are looked at."""
        for target in targets:
            self.by_address[target] = self._new(target, configured=True, now=now)

    def learn(self, address: Address, now: float) -> Peer | None:
        """The station at an address, made if there is room; only to be called with a valid frame in hand.

        Args:
            address: Where the frame came from.
        """
        peer = self.by_address.get(address)
        if peer is None:
            if sum(not peer.configured for peer in self.by_address.values()) >= MOST_PEERS:
                return None
            peer = self.by_address[address] = self._new(address, configured=False, now=now)
        peer.last_heard = now
        return peer

    def forget_silent(self, now: float) -> None:
        """Drop learned stations that have been silent too long."""
        gone = [
            address
            for address, peer in self.by_address.items()
            if not peer.configured and now - peer.last_heard > PEER_EXPIRY_S
        ]
        for address in gone:
            del self.by_address[address]

    @property
    def heard(self) -> int:
        """Stations that ever answered."""
        return sum(peer.last_heard > 0.0 for peer in self.by_address.values())

    def pack(self, peer: Peer, message: Any) -> bytes:
        """Number, and sign where a key is set, one message for one station.

        Args:
            peer: The station.
            message: A pymavlink message; it may be packed again for others.
        """
        if self._key is not None:
            signing = peer.encoder.signing
            signing.timestamp = max(signing.timestamp, signature_time())
        packed: bytes = message.pack(peer.encoder)
        peer.encoder.seq = (peer.encoder.seq + 1) % 256
        return packed

    def _new(self, address: Address, *, configured: bool, now: float) -> Peer:
        encoder = dialect.MAVLink(None, srcSystem=self._own[0], srcComponent=self._own[1])
        if self._key is not None:
            encoder.signing.secret_key = self._key
            encoder.signing.link_id = self._links % 256
            encoder.signing.timestamp = signature_time()
            encoder.signing.sign_outgoing = True
        self._links += 1
        return Peer(
            address=address,
            configured=configured,
            encoder=encoder,
            schedule=StreamSchedule(now, fastest_hz=self._fastest_hz),
            incoming=TokenBucket(PEER_RATE, PEER_BURST, now),
            replies=TokenBucket(REPLY_RATE, REPLY_BURST, now),
        )
