"""Commands of ground stations: each gets an answer, and every number is checked before it is used."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import all as dialect

from rtsim.errors import InputError, OutputError
from rtsim.units import deg
from telemetry.mavlink import messages as ids
from telemetry.mavlink.exchange import Request
from telemetry.mavlink.modes import requests_for
from telemetry.mavlink.notices import INFO, NOTICE, WARNING
from telemetry.mavlink.outbox import Outbox
from telemetry.mavlink.parameters import ARM_NEUTRAL, LOSS_TIME
from telemetry.mavlink.peers import Peer
from telemetry.mavlink.services import Services
from telemetry.mavlink.streams import DEFAULT_RATES_HZ

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = range(5)
"""MAV_RESULT."""
ARM, SET_MODE, TRANSITION, SET_ACTUATOR, REBOOT, STORAGE = 400, 176, 3000, 187, 246, 245
REQUEST_MESSAGE, SET_INTERVAL, GET_INTERVAL, CAPABILITIES = 512, 511, 510, 520
LONGEST_INTERVAL_US = 2.0**31 - 128.0
"""Longest interval that MESSAGE_INTERVAL can state and a float32 can carry [us]."""
_FORCE = 21196.0
_NOT_GIVEN = 2**31 - 1


class CommandContext(NamedTuple):
    """One command under way."""

    values: Sequence[float]
    """Its seven parameters; NaN where the sender left one open."""
    peer: Peer
    """Where it came from."""
    now: float
    """Monotonic time [s]."""


def command_values(message: Any) -> list[float]:
    """The seven parameters of a COMMAND_LONG or COMMAND_INT; NaN where the sender left one open.

    Args:
        message: The command.
    """
    values = [message.param1, message.param2, message.param3, message.param4]
    if message.get_msgId() == dialect.MAVLINK_MSG_ID_COMMAND_LONG:
        values += [message.param5, message.param6, message.param7]
    else:  # whole numbers have no NaN: the largest one stands for it
        values += [math.nan if place == _NOT_GIVEN else place for place in (message.x, message.y)] + [message.z]
    return [float(value) for value in values]


class Answer(NamedTuple):
    """What becomes of a command."""

    result: int
    """MAV_RESULT."""
    messages: tuple[Any, ...] = ()
    """Sent to the requester after the acknowledgement."""


class CommandHandler:
    """Carries out commands for a outbox."""

    def __init__(self, outbox: Outbox, services: Services) -> None:
        """Connect.

        Args:
            outbox: What the vehicle shares with its parts.
            services: What keeps the parameters.
        """
        self._outbox = outbox
        self._services = services
        # The second entry: only systems that may fly are obeyed.
        self._handlers: dict[int, tuple[Callable[[CommandContext], Answer], bool]] = {
            ARM: (self._arm, True),
            SET_MODE: (self._set_mode, True),
            TRANSITION: (self._transition, True),
            SET_ACTUATOR: (self._set_actuator, True),
            REBOOT: (self._reboot, True),
            STORAGE: (self._storage, True),
            REQUEST_MESSAGE: (self._request_message, False),
            SET_INTERVAL: (self._set_interval, True),
            GET_INTERVAL: (self._get_interval, False),
            CAPABILITIES: (self._capabilities, False),
        }

    def answer(self, command: int, context: CommandContext, *, system_id: int) -> Answer:
        """Carry out a command.

        Args:
            command: MAV_CMD.
            context: Its parameters and sender.
            system_id: The sender's system id.
        """
        handler, guarded = self._handlers.get(command, (None, False))
        if handler is None:
            return Answer(UNSUPPORTED)
        if guarded and not self._outbox.lock.allowed(system_id):
            return Answer(DENIED)
        return handler(context)

    def set_mode(self, custom_mode: int) -> int:
        """Change the flight mode, for DO_SET_MODE and the SET_MODE message.

        Args:
            custom_mode: As in HEARTBEAT.

        Returns:
            MAV_RESULT.
        """
        outbox = self._outbox
        for mode in outbox.modes:
            if mode.custom_mode == custom_mode:
                if not outbox.state.started:
                    return TEMPORARILY_REJECTED
                for request in requests_for(mode, outbox.factory.aids_on):
                    outbox.request(request)
                outbox.board.say(INFO, f"Mode {mode.name}")
                return ACCEPTED
        return DENIED

    def _arm(self, context: CommandContext) -> Answer:
        outbox = self._outbox
        wanted, force = context.values[0], context.values[1]
        if wanted not in {0.0, 1.0}:
            return Answer(DENIED)
        if not outbox.state.started:
            return Answer(TEMPORARILY_REJECTED)
        if wanted == 1.0 and force != _FORCE and not outbox.state.armed:
            sticks = outbox.reader.sticks
            live = context.now - sticks.received_ns * 1e-9 < outbox.store[LOSS_TIME] and sticks.sequence > 0
            furthest = max(abs(sticks.stick), abs(sticks.lateral), abs(sticks.yaw))
            if live and furthest > outbox.store[ARM_NEUTRAL]:
                outbox.board.say_seldom("arm", WARNING, "Not armed: centre the sticks", context.now)
                return Answer(TEMPORARILY_REJECTED)
        if outbox.state.armed != bool(wanted):
            outbox.state.armed = bool(wanted)
            outbox.tell(INFO, "Armed" if wanted else "Disarmed")
        return Answer(ACCEPTED)

    def _set_mode(self, context: CommandContext) -> Answer:
        base = _integer(context.values[0], 0, 255)
        main = _integer(context.values[1], 0, 255)
        sub = _integer(context.values[2], 0, 255, open_means=0)
        if base is None or main is None or sub is None or not base & dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return Answer(DENIED)
        return Answer(self.set_mode(sub << 24 | main << 16))

    def _transition(self, context: CommandContext) -> Answer:
        target = context.values[0]
        if target not in {3.0, 4.0}:
            return Answer(DENIED)
        if not self._outbox.state.started:
            return Answer(TEMPORARILY_REJECTED)
        self._outbox.request(Request("transition", "", target))
        self._outbox.board.say(INFO, "Converting to " + ("airplane" if target == 4.0 else "helicopter"))
        return Answer(ACCEPTED)

    def _set_actuator(self, context: CommandContext) -> Answer:
        value = context.values[0]
        if _integer(context.values[6], 0, 0, open_means=0) is None or any(
            math.isfinite(other) and other != 0.0 for other in context.values[1:6]
        ):
            return Answer(UNSUPPORTED)  # there is one actuator in one set
        if not -1.0 <= value <= 1.0:
            return Answer(DENIED)
        if not self._outbox.state.started:
            return Answer(TEMPORARILY_REJECTED)
        self._outbox.request(Request("nacelle", "", deg(45.0 * (1.0 + value))))
        return Answer(ACCEPTED)

    def _reboot(self, context: CommandContext) -> Answer:
        if not self._outbox.config.reboot_resets:
            return Answer(UNSUPPORTED)
        if context.values[0] != 1.0:
            return Answer(DENIED)
        self._outbox.request(Request("reset"))
        return Answer(ACCEPTED)

    def _storage(self, context: CommandContext) -> Answer:
        outbox, path = self._outbox, self._outbox.config.parameter_file
        action = context.values[0]
        if action not in {0.0, 1.0, 2.0}:
            return Answer(DENIED)
        if action != 2.0 and path is None:
            return Answer(UNSUPPORTED)
        try:
            if action == 1.0:
                outbox.store.save(path or "")
            elif action == 0.0:
                outbox.store.load(path or "")
            else:
                outbox.store.defaults()
        except (OSError, InputError, OutputError) as failure:
            outbox.board.say(WARNING, f"Parameters: {failure}")
            return Answer(FAILED)
        if action != 1.0:
            self._services.tell_all_parameters()
        outbox.board.say(NOTICE, ("Parameters loaded", "Parameters stored", "Parameters at defaults")[int(action)])
        return Answer(ACCEPTED)

    def _request_message(self, context: CommandContext) -> Answer:
        outbox = self._outbox
        number = _integer(context.values[0], 0, 0xFFFFFF)
        if number is None:
            return Answer(DENIED)
        if number == ids.AUTOPILOT_VERSION:
            return Answer(ACCEPTED, (outbox.factory.autopilot_version(),))
        if number == ids.AVAILABLE_MODES:
            place = _integer(context.values[1], 0, len(outbox.modes), open_means=0)
            if place is None:
                return Answer(DENIED)
            places = range(1, len(outbox.modes) + 1) if place == 0 else (place,)
            return Answer(ACCEPTED, tuple(outbox.factory.available_modes(outbox.modes, each) for each in places))
        if number == ids.MESSAGE_INTERVAL:
            return self._interval_of(context.values[1], context.peer)
        if not outbox.factory.can_build(number):
            return Answer(UNSUPPORTED)
        if not outbox.state.started and number != ids.HEARTBEAT:
            return Answer(TEMPORARILY_REJECTED)
        return Answer(ACCEPTED, tuple(outbox.factory.build(number)))

    def _set_interval(self, context: CommandContext) -> Answer:
        if not context.peer.accepted:
            return Answer(TEMPORARILY_REJECTED)  # nothing is streamed there yet
        number = _integer(context.values[0], 0, 0xFFFFFF)
        interval = context.values[1]
        if number is None or not (interval == -1.0 or 0.0 <= interval <= LONGEST_INTERVAL_US):
            return Answer(DENIED)
        if number == ids.HEARTBEAT:
            return Answer(DENIED)  # the link lives by it
        if number not in DEFAULT_RATES_HZ:
            return Answer(UNSUPPORTED)
        context.peer.schedule.set_interval(number, interval, context.now)
        return Answer(ACCEPTED)

    def _get_interval(self, context: CommandContext) -> Answer:
        return self._interval_of(context.values[0], context.peer)

    def _interval_of(self, value: float, peer: Peer) -> Answer:
        number = _integer(value, 0, 0xFFFF)
        if number is None:
            return Answer(DENIED)
        return Answer(ACCEPTED, (dialect.MAVLink_message_interval_message(number, peer.schedule.interval_us(number)),))

    def _capabilities(self, context: CommandContext) -> Answer:
        if context.values[0] != 1.0:
            return Answer(DENIED)
        return Answer(ACCEPTED, (self._outbox.factory.autopilot_version(),))


def _integer(value: float, low: int, high: int, *, open_means: int | None = None) -> int | None:
    """A parameter that must be a whole number in a range; None where it is not.

    NaN is legal in commands and means "not given"; ``open_means`` is what it stands for.
    """
    if math.isnan(value):
        return open_means
    if not math.isfinite(value) or value != math.floor(value) or not low <= value <= high:
        return None
    return int(value)
