"""Texts for people (STATUSTEXT): what is worth saying, with hysteresis, and never more than two per second."""

from __future__ import annotations

from collections import deque
from itertools import pairwise
from typing import NamedTuple

from telemetry.mavlink.peers import HEARTBEAT_WARNING_S, Peer, TokenBucket
from telemetry.mavlink.state import FlightState

CRITICAL, WARNING, NOTICE, INFO = 2, 4, 5, 6
"""MAV_SEVERITY."""
TEXT_LENGTH = 50
"""Longest text that fits one message [characters]."""
_TEXTS_PER_S, _TEXT_BURST, _MOST_WAITING = 2.0, 4.0, 12
_FLAPPING_WARNING_DEG, _FLAPPING_CLEAR_DEG = 10.0, 9.0
_TORQUE_WARNING_PCT, _TORQUE_CLEAR_PCT = 100.0, 97.0
_ROTOR_SLOW_PCT, _ROTOR_LOW_PCT, _ROTOR_HIGH_PCT, _ROTOR_CLEAR_PCT = 84.0, 95.0, 105.0, 1.0
"""Rotor speed outside these is worth a warning; ours, no operating limits were found."""
FLAP_SPEEDS = ((0.0, 260.0), (20.0, 220.0), (40.0, 170.0), (75.0, 100.0))
"""Flap setting [deg] and the fastest airspeed with it [kn] (NASA TM X-62407, TM 81244; as the aircraft's data)."""
_FLAP_SPEED_SLACK_KT = 1.0
_REPEAT_S = 5.0
_LEVELS = {1: ("caution", NOTICE), 2: ("warning", WARNING), 3: ("EXCEEDED", CRITICAL)}


class Notice(NamedTuple):
    """One text."""

    severity: int
    """MAV_SEVERITY."""
    text: str
    """At most 50 ASCII characters."""


class NoticeBoard:
    """Collects texts and hands them out at a readable rate."""

    def __init__(self, now: float) -> None:
        """Begin with nothing to say."""
        self._waiting: deque[Notice] = deque()
        self._bucket = TokenBucket(_TEXTS_PER_S, _TEXT_BURST, now)
        self._said: dict[str, float] = {}
        self._level = 0
        self._flapping = self._torque = self._rotor = self._flap_speed = False

    def say(self, severity: int, text: str) -> None:
        """Add a text; when too many wait, the least urgent and oldest is dropped.

        Args:
            severity: MAV_SEVERITY.
            text: The text; it is cut to 50 ASCII characters.
        """
        clean = "".join(letter if " " <= letter <= "~" else "?" for letter in text)[:TEXT_LENGTH]
        if any(notice.text == clean for notice in self._waiting):
            return
        self._waiting.append(Notice(severity, clean))
        if len(self._waiting) > _MOST_WAITING:
            self._waiting.remove(max(self._waiting, key=lambda notice: notice.severity))

    def say_seldom(self, key: str, severity: int, text: str, now: float) -> None:
        """Add a text unless the same kind was said in the last seconds.

        Args:
            key: The kind.
            severity: MAV_SEVERITY.
            text: The text.
        """
        if now - self._said.get(key, -1e9) >= _REPEAT_S:
            self._said[key] = now
            self.say(severity, text)

    def take(self, now: float) -> Notice | None:
        """The next text, if it is time for one."""
        if not self._waiting or not self._bucket.take(now):
            return None
        return self._waiting.popleft()

    @property
    def waiting(self) -> bool:
        """Whether there is anything to say."""
        return bool(self._waiting)

    def watch(self, state: FlightState, *, enabled: bool) -> None:
        """Say what newly matters in the flight.

        Args:
            state: The flight.
            enabled: Whether warnings are wanted.
        """
        level, state.worst_level = state.worst_level, int(state.value("corridor_level"))
        flapping, torque = state.flapping_deg, state.torque_pct
        high_flapping = flapping > (_FLAPPING_CLEAR_DEG if self._flapping else _FLAPPING_WARNING_DEG)
        high_torque = torque > (_TORQUE_CLEAR_PCT if self._torque else _TORQUE_WARNING_PCT)
        if enabled:
            if level > self._level:
                word, severity = _LEVELS[min(level, 3)]
                low = state.value("margin_low_kt") < state.value("margin_high_kt")
                side = "too slow" if low else "too fast"
                self.say(severity, f"Corridor {word}: {side}, {state.value('margin_kt'):.0f} kn")
            elif level == 0 < self._level:
                self.say(INFO, "Corridor clear")
            if high_flapping and not self._flapping:
                self.say(WARNING, f"Flapping {flapping:.1f} deg")
            if high_torque and not self._torque:
                self.say(WARNING, f"Mast torque {torque:.0f} %")
            self._watch_rotor_and_flaps(state)
        self._level, self._flapping, self._torque = level, high_flapping, high_torque

    def _watch_rotor_and_flaps(self, state: FlightState) -> None:
        """Say when the rotors without their governor, or flaps by hand, are where they should not be."""
        rotor = state.rotor_speed_pct
        slack = _ROTOR_CLEAR_PCT if self._rotor else 0.0
        low = _ROTOR_SLOW_PCT if state.value("on_downstop") else _ROTOR_LOW_PCT
        off_speed = not low + slack <= rotor <= _ROTOR_HIGH_PCT - slack
        if off_speed and not self._rotor:
            self.say(WARNING, f"Rotor speed {rotor:.0f} %")
        flap, airspeed = state.value("flap_deg"), state.value("airspeed_kt")
        limit = _flap_limit(flap)
        fast = airspeed > limit + (0.0 if self._flap_speed else _FLAP_SPEED_SLACK_KT)
        if fast and not self._flap_speed:
            self.say(WARNING, f"Flaps {flap:.0f} deg: {limit:.0f} kn is the limit")
        self._rotor, self._flap_speed = off_speed, fast

    def watch_peer(self, peer: Peer, now: float) -> None:
        """Say when a ground station's heartbeat goes missing and when it is back.

        Args:
            peer: The station.
        """
        if peer.last_heartbeat < 0.0:
            return
        missing = now - peer.last_heartbeat > HEARTBEAT_WARNING_S
        if missing and not peer.missed:
            self.say(WARNING, f"Ground station {peer.address[0]}:{peer.address[1]} silent")
        elif peer.missed and not missing:
            self.say(INFO, f"Ground station {peer.address[0]}:{peer.address[1]} back")
        peer.missed = missing


def _flap_limit(flap: float) -> float:
    """Fastest airspeed with the flaps so far out, linear between the published settings [kn]."""
    for (low, fast), (high, slow) in pairwise(FLAP_SPEEDS):
        if flap <= high:
            return fast + (slow - fast) * (flap - low) / (high - low)
    return FLAP_SPEEDS[-1][1]
