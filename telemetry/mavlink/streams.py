"""Which message goes to one ground station how often; each station has its own schedule."""

from __future__ import annotations

import heapq
import math

from telemetry.mavlink import messages as ids

DEFAULT_RATES_HZ: dict[int, float] = {
    ids.HEARTBEAT: 1.0,
    ids.SYS_STATUS: 2.0,
    ids.EXTENDED_SYS_STATE: 2.0,
    ids.ATTITUDE: 50.0,
    ids.ATTITUDE_QUATERNION: 50.0,
    ids.LOCAL_POSITION: 20.0,
    ids.GLOBAL_POSITION: 10.0,
    ids.VFR_HUD: 10.0,
    ids.NAMED_VALUE_FLOAT: 10.0,
    ids.DEBUG_FLOAT_ARRAY: 10.0,
    ids.RC_CHANNELS: 10.0,
    ids.SERVO_OUTPUT: 2.0,
    ids.ALTITUDE: 2.0,
    ids.GPS_RAW: 2.0,
    ids.WIND: 1.0,
    ids.BATTERY_STATUS: 1.0,
    ids.HOME_POSITION: 0.5,
    ids.SYSTEM_TIME: 1.0,
    ids.CURRENT_MODE: 1.0,
}
"""Messages per second where nobody asked for anything else."""


class StreamSchedule:
    """Due times of every stream to one ground station, on a fixed grid, so that rates do not drift."""

    def __init__(self, now: float, *, fastest_hz: float) -> None:
        """Start all streams at their default rates.

        Args:
            fastest_hz: Rate above which nothing is sent: the frame rate.
        """
        self._shortest = 1.0 / fastest_hz
        self._intervals: dict[int, float] = {}
        self._due: list[tuple[float, int, float]] = []
        # HEARTBEAT first: stations ignore what comes before it.
        for number in DEFAULT_RATES_HZ:
            self.set_interval(number, 0.0, now)

    def interval_us(self, message_id: int) -> int:
        """Interval of a stream [us]: -1 stopped, 0 no such stream.

        Args:
            message_id: MAVLink message id.
        """
        if message_id not in DEFAULT_RATES_HZ:
            return 0
        interval = self._intervals[message_id]
        return -1 if math.isinf(interval) else round(interval * 1e6)

    def set_interval(self, message_id: int, interval_us: float, now: float) -> None:
        """Change a stream; the first message of the new rate is due at once.

        Args:
            message_id: One of ``DEFAULT_RATES_HZ``.
            interval_us: Microseconds between messages; negative stops, 0 takes the default.
        """
        if interval_us < 0.0:
            interval = math.inf
        elif interval_us == 0.0:
            interval = 1.0 / DEFAULT_RATES_HZ[message_id]
        else:
            interval = max(interval_us * 1e-6, self._shortest)
        self._intervals[message_id] = interval
        self._due = [entry for entry in self._due if entry[1] != message_id]
        if math.isfinite(interval):
            self._due.append((now, message_id, interval))
        heapq.heapify(self._due)

    @property
    def next_due(self) -> float:
        """When the next message is due, monotonic [s]; infinite where nothing is streamed."""
        return self._due[0][0] if self._due else math.inf

    def take_due(self, now: float) -> list[int]:
        """Ids that are due, each once; what was missed is not made up for."""
        due: list[int] = []
        while self._due and self._due[0][0] <= now:
            moment, number, interval = self._due[0]
            steps = max(1, math.floor((now - moment) / interval) + 1)
            heapq.heapreplace(self._due, (moment + steps * interval, number, interval))
            due.append(number)
        return due
