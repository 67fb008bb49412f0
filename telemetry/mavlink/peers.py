"""Ground stations: who is heard, who is sent to, and how much work and traffic each may cause.

A sender's address can be forged, so a frame from a new one earns next to nothing: until somebody there has shown that
he hears us, he is a stranger, is sent at most three bytes for each that came, and can crowd out nobody but strangers.
Every ground station shows it within a round trip by answering our PING. On this machine, where nobody outside can forge
an address, talking on to us will do; so will a right signature.
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import os
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import all as dialect

from telemetry.mavlink.framing import signature_time
from telemetry.mavlink.streams import StreamSchedule

Address = tuple[str, int]
MOST_PEERS = 8
"""Ground stations learned from what they send; configured targets come on top."""
MOST_STRANGERS = 32
"""Addresses that have shown nothing yet; the one silent for longest makes room."""
PEER_EXPIRY_S, TALKER_EXPIRY_S = 10.0, 3.0
"""A learned station that is silent for this long is forgotten, sooner where it never answered a PING [s]."""
HEARTBEAT_WARNING_S = 3.0
"""A station whose heartbeat is missing for this long is missed [s]."""
PEER_RATE, PEER_BURST = 1000.0, 500.0
"""Datagrams per second, and at once, that one station may have looked at."""
STRANGER_RATE, STRANGER_BURST = 200.0, 100.0
"""The same for a stranger that is known."""
UNKNOWN_RATE, UNKNOWN_BURST, _UNKNOWN_GROUPS = 10.0, 10.0, 64
"""The same for all unknown addresses of one group; which group an address is in, no sender knows."""
REPLY_RATE, REPLY_BURST = 500.0, 300.0
"""Answers per second, and at once, that one station may cause."""
BYTES_RATE, BYTES_BURST = 100_000.0, 100_000.0
"""Bytes per second, and at once, that one station is sent; the streams take a tenth of it."""
STRANGER_RETURN = 3.0
"""Bytes a stranger is sent for each that came from it."""
_MOST_CREDIT = 4000.0
TALK_S, _TALK_GAP_S = 1.0, 3.0
"""A sender of this machine that talked to us for so long, with no longer gaps, is a station [s]."""
_SEAL_S = 30.0


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

    def take(self, now: float, tokens: float = 1.0) -> bool:
        """Take tokens if there are so many.

        Args:
            tokens: How many.
        """
        there = min(self._burst, self._tokens + (now - self._last) * self._rate)
        self._last = now
        self._tokens = there if there < tokens else there - tokens
        return there >= tokens


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
    volume: TokenBucket
    """How many bytes it is sent."""
    proved: bool = False
    """It was named by the user, has answered something only it can know, or signs."""
    accepted: bool = False
    """It is sent telemetry."""
    credit: float = 0.0
    """Bytes it may still be sent while it is a stranger."""
    addressed: bool = False
    """It has asked something of us, not only of everybody."""
    talks_since: float = 1e9
    """Since when it has been talking without a gap, monotonic [s]."""
    challenged: float = -1e9
    """When it was last asked to show that it hears us, monotonic [s]."""
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
        """Every ground station that is sent telemetry."""
        self.strangers: dict[Address, Peer] = {}
        """Whoever else was heard, the one silent for longest first."""
        self._secret = os.urandom(16)
        self._unknown = [TokenBucket(UNKNOWN_RATE, UNKNOWN_BURST, now) for _ in range(_UNKNOWN_GROUPS)]
        for target in targets:
            peer = self._new(target, now=now)
            peer.configured = peer.proved = True
            self._admit(peer, now)

    def looked_at(self, address: Address, now: float) -> bool:
        """Whether a datagram is within its sender's budget.

        Args:
            address: Where it came from.
        """
        peer = self.by_address.get(address) or self.strangers.get(address)
        if peer is not None:
            return peer.incoming.take(now)
        return self._unknown[self._seal(address, 0)[0] % _UNKNOWN_GROUPS].take(now)

    def learn(self, address: Address, now: float, *, size: int) -> Peer:
        """Who is at an address; only to be called with a valid frame in hand.

        Args:
            address: Where the frame came from.
            size: Length of the datagram [bytes].
        """
        peer = self.by_address.get(address)
        if peer is None:
            peer = self.strangers.pop(address, None)
            if peer is None:
                peer = self._new(address, now=now)
                if len(self.strangers) >= MOST_STRANGERS:
                    del self.strangers[next(iter(self.strangers))]
            self.strangers[address] = peer
            peer.credit = min(peer.credit + STRANGER_RETURN * size, _MOST_CREDIT)
            if now - peer.last_heard > _TALK_GAP_S:
                peer.talks_since = now
        peer.last_heard = now
        return peer

    def seal(self, peer: Peer, now: float, *, age: int = 0) -> tuple[int, int]:
        """What only somebody who hears us at this address can know: two numbers for a PING.

        Args:
            peer: Who is at the address.
            age: 0 the present one, 1 the one before.
        """
        sealed = self._seal(peer.address, int(now / _SEAL_S) - age)
        return int.from_bytes(sealed[:8], "little"), int.from_bytes(sealed[8:12], "little")

    def accept(self, peer: Peer, now: float) -> bool:
        """Make a stranger a station where it has shown itself to be one and there is room.

        Args:
            peer: Who.

        Returns:
            Whether it became one just now.
        """
        talks = (
            peer.addressed
            and peer.last_heard - peer.talks_since >= TALK_S
            and ipaddress.ip_address(peer.address[0]).is_loopback
        )
        if peer.accepted or not (peer.proved or talks):
            return False
        if sum(not each.configured for each in self.by_address.values()) >= MOST_PEERS:
            return False
        self._admit(peer, now)
        return True

    def take_over(self, address: Address, now: float, *, proved: bool) -> Peer:
        """Take a station over from another process of this vehicle.

        Args:
            address: Where it is.
            proved: It has shown that it hears us.
        """
        peer = self.by_address.get(address)
        if peer is None:
            peer = self._new(address, now=now)
            self._admit(peer, now)
        peer.proved, peer.greeted, peer.last_heard = proved, True, now
        return peer

    def forget_silent(self, now: float) -> None:
        """Drop learned stations and strangers that have been silent too long."""
        for table in (self.by_address, self.strangers):
            for address, peer in list(table.items()):
                patience = PEER_EXPIRY_S if peer.proved or not peer.accepted else TALKER_EXPIRY_S
                if not peer.configured and now - peer.last_heard > patience:
                    del table[address]

    @property
    def heard(self) -> int:
        """Stations that ever answered."""
        return sum(peer.last_heard > 0.0 for peer in self.by_address.values())

    def pack(self, peer: Peer, message: Any, now: float) -> bytes | None:
        """Number, and sign where a key is set, one message for one station.

        Args:
            peer: The station.
            message: A pymavlink message; it may be packed again for others.

        Returns:
            The datagram; None where that would be more than may be sent there.
        """
        if self._key is not None:
            signing = peer.encoder.signing
            signing.timestamp = max(signing.timestamp, signature_time())
        packed: bytes = message.pack(peer.encoder)
        if not peer.accepted:
            if peer.credit < len(packed):
                return None
            peer.credit -= len(packed)
        elif not peer.volume.take(now, len(packed)) and message.get_msgId() != dialect.MAVLINK_MSG_ID_HEARTBEAT:
            return None
        peer.encoder.seq = (peer.encoder.seq + 1) % 256
        return packed

    def _admit(self, peer: Peer, now: float) -> None:
        self.strangers.pop(peer.address, None)
        self.by_address[peer.address] = peer
        peer.accepted = True
        peer.incoming = TokenBucket(PEER_RATE, PEER_BURST, now)
        peer.schedule = StreamSchedule(now, fastest_hz=self._fastest_hz)

    def _seal(self, address: Address, period: int) -> bytes:
        """What nobody but us can work out, for an address and a time."""
        return hmac.digest(self._secret, f"{address[0]}:{address[1]} {period}".encode(), hashlib.sha256)

    def _new(self, address: Address, *, now: float) -> Peer:
        encoder = dialect.MAVLink(None, srcSystem=self._own[0], srcComponent=self._own[1])
        if self._key is not None:
            encoder.signing.secret_key = self._key
            encoder.signing.link_id = self._links % 256
            encoder.signing.timestamp = signature_time()
            encoder.signing.sign_outgoing = True
        self._links += 1
        return Peer(
            address=address,
            configured=False,
            encoder=encoder,
            schedule=StreamSchedule(now, fastest_hz=self._fastest_hz),
            incoming=TokenBucket(STRANGER_RATE, STRANGER_BURST, now),
            replies=TokenBucket(REPLY_RATE, REPLY_BURST, now),
            volume=TokenBucket(BYTES_RATE, BYTES_BURST, now),
        )
