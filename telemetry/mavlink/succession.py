"""What a MAVLink process puts by for the one that takes its place: whoever holds the sticks notices nothing but a text.

Parameters, arming, the owner of the sticks and what his hands held, the stations and what each asked for, the clock.
Kept in memory shared with the flight, so it is there however the process ended.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from telemetry.mavlink.pilot_input import PilotId
from telemetry.mavlink.streams import DEFAULT_RATES_HZ

if TYPE_CHECKING:
    from telemetry.mavlink.outbox import Outbox
    from telemetry.mavlink.peers import Peer
    from telemetry.mavlink.stick_port import StickPort


class Succession:
    """Puts by, and takes up."""

    def __init__(self, outbox: Outbox, port: StickPort) -> None:
        """Connect.

        Args:
            outbox: What the vehicle shares with its parts.
            port: Where sticks come in.
        """
        self._outbox, self._port = outbox, port
        self._newest: dict[str, Any] = {}

    def put_by(self) -> None:
        """Keep the present state, where it has changed."""
        outbox = self._outbox
        newest = {
            "parameters": list(outbox.store.values),
            "armed": outbox.state.armed,
            "before_reset_s": outbox.state.before_reset_s,
            "owner": _pilot_words(outbox.lock.owner),
            "pilot": _pilot_words(self._port.pilot),
            "bipolar": self._port.bipolar,
            "held_down": outbox.reader.held_down,
            "stations": [_station_words(peer) for peer in outbox.peers.by_address.values() if peer.last_heard > 0.0],
        }
        if newest != self._newest:
            self._newest = newest
            outbox.exchange.kept.put(json.dumps(newest).encode())

    def take_up(self, now: float) -> bool:
        """Go on where another process ended.

        Returns:
            False where there was none.
        """
        outbox = self._outbox
        text = outbox.exchange.kept.get()
        if not text:
            return False
        kept = json.loads(text)
        outbox.store.values = kept["parameters"]
        outbox.state.armed, outbox.state.before_reset_s = kept["armed"], kept["before_reset_s"]
        if (owner := _pilot(kept["owner"])) is not None:
            outbox.lock.hand_to(owner, now)
        self._port.pilot, self._port.bipolar = _pilot(kept["pilot"]), kept["bipolar"]
        outbox.reader.held_down = kept["held_down"]
        outbox.reader.sticks = outbox.exchange.read_sticks() or outbox.reader.sticks
        for host, number, intervals, proved in kept["stations"]:
            peer = outbox.peers.take_over((host, number), now, proved=proved)
            for message, interval in zip(DEFAULT_RATES_HZ, intervals, strict=True):
                peer.schedule.set_interval(message, interval, now)
        return True


def _station_words(peer: Peer) -> list[Any]:
    return [*peer.address, [peer.schedule.interval_us(number) for number in DEFAULT_RATES_HZ], peer.proved]


def _pilot_words(pilot: PilotId | None) -> list[Any] | None:
    return None if pilot is None else [pilot.system_id, pilot.component_id, *pilot.address]


def _pilot(words: list[Any] | None) -> PilotId | None:
    return None if words is None else PilotId(words[0], words[1], (words[2], words[3]))
