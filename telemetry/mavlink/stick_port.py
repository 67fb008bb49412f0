"""Where sticks come in: whose they are, what they say, and what their buttons ask for."""

from __future__ import annotations

from typing import Any

from telemetry.mavlink.exchange import ACCEPTED, Request
from telemetry.mavlink.framing import Frame
from telemetry.mavlink.notices import INFO, WARNING
from telemetry.mavlink.outbox import Outbox
from telemetry.mavlink.parameters import AID_PARAMETERS, LEVER_RANGE, LOSS_TIME, OWNER_TIME
from telemetry.mavlink.peers import Peer
from telemetry.mavlink.pilot_input import PilotId, carries

MANUAL_CONTROL, OVERRIDE = 69, 70
"""Ids of the two messages that carry sticks."""
FLAP_STEPS = {"flaps_up": "up", "flaps_down": "down"}
"""Buttons that move the flaps to their next setting."""


class StickPort:
    """Takes sticks for a outbox."""

    def __init__(self, outbox: Outbox) -> None:
        """Connect.

        Args:
            outbox: What the vehicle shares with its parts.
        """
        self._outbox = outbox
        self.pilot: PilotId | None = None
        """Whose sticks came last."""
        self.bipolar = False
        """The range of the lever then."""

    def take(self, message: Any, frame: Frame, peer: Peer, *, received_ns: int) -> None:
        """Take sticks from whoever holds them.

        Args:
            message: MANUAL_CONTROL or RC_CHANNELS_OVERRIDE.
            frame: Its frame.
            peer: Where it came from.
            received_ns: When it arrived, monotonic [ns].
        """
        outbox, board, now = self._outbox, self._outbox.board, self._outbox.now
        manual = frame.message_id == MANUAL_CONTROL
        target = message.target if manual else message.target_system
        if target not in {0, outbox.config.system_id}:
            return
        pilot = PilotId(frame.system_id, frame.component_id, peer.address)
        before = outbox.lock.owner
        lasts_ns = int(outbox.store[LOSS_TIME] * 1e9)
        if not manual and not carries(message):
            if before == pilot and outbox.reader.gives_back(message):
                outbox.reader.override(message, received_ns=received_ns, pilot=pilot, lasts_ns=lasts_ns)
                outbox.exchange.write_sticks(outbox.reader.sticks)
            return  # none of our channels: that takes no sticks and keeps none
        if not outbox.lock.claim(pilot, now, release_after=outbox.store[OWNER_TIME]):
            if outbox.lock.allowed(frame.system_id):
                board.say_seldom(f"refused {pilot}", WARNING, f"Sticks are held by {before}, not {pilot}", now)
            else:
                outbox.tell_once(frame.system_id, f"System {frame.system_id} may not fly")
            return
        bipolar = outbox.store[LEVER_RANGE] == 1.0
        silent = received_ns - outbox.reader.sticks.received_ns > lasts_ns
        if silent or (pilot, bipolar) != (self.pilot, self.bipolar):
            # What was held before must not come back with the first packet, nor mean something else in another range.
            outbox.reader.forget(buttons=pilot != self.pilot)
            self.pilot, self.bipolar = pilot, bipolar
        if before != outbox.lock.owner:
            outbox.tell(INFO, f"Sticks: {pilot}")
        if manual:
            pressed = outbox.reader.manual_control(
                message, received_ns=received_ns, pilot=pilot, bipolar=bipolar, lasts_ns=lasts_ns
            )
            for function in pressed:
                self._press(function)
        else:
            outbox.reader.override(message, received_ns=received_ns, pilot=pilot, lasts_ns=lasts_ns)
        outbox.exchange.write_sticks(outbox.reader.sticks)
        outbox.exchange.header[ACCEPTED] += 1

    def _press(self, function: str) -> None:
        """A button that acts once went down."""
        if function in AID_PARAMETERS:
            if function in self._outbox.config.aids:
                self._outbox.request(Request("aid", function, 2.0))
        elif function == "freeze":
            self._outbox.request(Request("freeze"))
        elif function in FLAP_STEPS:
            self._outbox.request(Request("flaps", FLAP_STEPS[function]))
        elif function == "pilot":
            self._outbox.request(Request("pilot", "next"))
