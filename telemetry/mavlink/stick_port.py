"""Where sticks come in: whose they are, what they say, and what their buttons ask for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from telemetry.mavlink.exchange import ACCEPTED, Request
from telemetry.mavlink.framing import Frame
from telemetry.mavlink.notices import INFO, WARNING
from telemetry.mavlink.parameters import AID_PARAMETERS, LEVER_RANGE, LOSS_TIME, OWNER_TIME
from telemetry.mavlink.peers import Peer
from telemetry.mavlink.pilot_input import PilotId

if TYPE_CHECKING:
    from telemetry.mavlink.vehicle import Vehicle

MANUAL_CONTROL, OVERRIDE = 69, 70
"""Ids of the two messages that carry sticks."""
FLAP_STEPS = {"flaps_up": "up", "flaps_down": "down"}
"""Buttons that move the flaps to their next setting."""


class StickPort:
    """Takes sticks for a vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Connect.

        Args:
            vehicle: The vehicle that is flown.
        """
        self._vehicle = vehicle
        self._explained = False
        self._pilot: PilotId | None = None

    def take(self, message: Any, frame: Frame, peer: Peer, *, received_ns: int) -> None:
        """Take sticks from whoever holds them.

        Args:
            message: MANUAL_CONTROL or RC_CHANNELS_OVERRIDE.
            frame: Its frame.
            peer: Where it came from.
            received_ns: When it arrived, monotonic [ns].
        """
        vehicle, board, now = self._vehicle, self._vehicle.board, self._vehicle.now
        manual = frame.message_id == MANUAL_CONTROL
        target = message.target if manual else message.target_system
        if target not in {0, vehicle.config.system_id}:
            return
        pilot = PilotId(frame.system_id, frame.component_id, peer.address)
        before = vehicle.lock.owner
        if not vehicle.lock.claim(pilot, now, release_after=vehicle.store[OWNER_TIME]):
            if vehicle.lock.allowed(frame.system_id):
                board.say_seldom(f"refused {pilot}", WARNING, f"Sticks are held by {before}, not {pilot}", now)
            else:
                board.say_seldom("whitelist", WARNING, f"System {frame.system_id} may not fly", now)
            return
        silent = received_ns - vehicle.reader.sticks.received_ns > vehicle.store[LOSS_TIME] * 1e9
        if silent or pilot != self._pilot:  # what was held before must not come back with the first packet
            vehicle.reader.forget(buttons=pilot != self._pilot)
            self._pilot = pilot
        if before != vehicle.lock.owner:
            board.say(INFO, f"Sticks: {pilot}")
        if manual:
            bipolar = vehicle.store[LEVER_RANGE] == 1.0
            pressed = vehicle.reader.manual_control(message, received_ns=received_ns, pilot=pilot, bipolar=bipolar)
            for function in pressed:
                self._press(function)
        else:
            vehicle.reader.override(message, received_ns=received_ns, pilot=pilot)
        sticks = vehicle.reader.sticks
        vehicle.exchange.write_sticks(sticks)
        vehicle.exchange.header[ACCEPTED] += 1
        if not self._explained and max(abs(sticks.lateral), abs(sticks.yaw)) > 0.2:
            self._explained = True
            board.say(INFO, "Roll and yaw are shown but do not act")

    def _press(self, function: str) -> None:
        """A button that acts once went down."""
        if function in AID_PARAMETERS:
            if function in self._vehicle.config.aids:
                self._vehicle.request(Request("aid", function, 2.0))
        elif function == "freeze":
            self._vehicle.request(Request("freeze"))
        elif function in FLAP_STEPS:
            self._vehicle.request(Request("flaps", FLAP_STEPS[function]))
        elif function == "pilot":
            self._vehicle.request(Request("pilot", "next"))
