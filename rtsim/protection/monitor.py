"""The margin monitor: one source of margins, levels and time to limit for laws, displays and verdicts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.choices import CorridorName
from rtsim.command import CHANNELS, SENSOR, Command, Sensors
from rtsim.corridor.boundaries import LEVEL_NAMES
from rtsim.corridor.corridor_kernels import turn_excess
from rtsim.frame import COLUMN, QUANTITY, UNIT_SCALES
from rtsim.lpv.database import Database
from rtsim.lpv.files.storage import load_database
from rtsim.protection import law_data, law_kernels, monitor_kernels
from rtsim.protection.boundary import load_boundary, model_corridor
from rtsim.protection.limits import WATCHED, LimitLevels, load_levels, load_limits
from rtsim.protection.monitor_kernels import DRIVEN, FAR, KIND, LIMIT, MonitorTables
from rtsim.protection.tables import law_tables, sample_boundary

SHOWN_AS = {
    "airspeed": "airspeed_indicated",
    "nacelle_angle": "nacelle",
    "flight_path_angle": "flight_path",
    "lateral_velocity": "lateral",
    "nacelle_ok": "failures",
}
"""Quantities of the frame that sensors show under another name."""
_ACTED = np.array([QUANTITY.asdict()[{"nacelle_rate": "nacelle_command_rate"}.get(name, name)] for name in CHANNELS])
_DRIVEN = np.array([QUANTITY.asdict()[name] for name in DRIVEN.asdict()])
_SENSED = np.array([QUANTITY.asdict()[SHOWN_AS.get(name, name)] for name in Sensors.__slots__])


@dataclass(frozen=True, slots=True)
class Reading:
    """All margins at one instant."""

    margins: dict[str, float]
    """Signed distance to each limit by name, positive inside: m/s, rad, rad/s; torque as a share of its limit."""
    levels: dict[str, str]
    """Level of each limit by name: ``clear``, ``caution``, ``warning`` or ``exceedance``."""
    normalized_distance: float
    """Signed distance to the nearer boundary in (10 kn, 10 deg) [-]."""
    time_to_limit: float
    """Predicted time until the corridor is left [s]; the horizon where it is not."""
    side: str
    """Where it will be left: ``low``, ``high`` or empty."""


@dataclass(frozen=True, slots=True)
class MarginHistory:
    """Margins over a flight; arrays have one row per frame and one column per name in ``WATCHED``."""

    time: FloatArray
    """Time (frames,) [s]."""
    margins: FloatArray
    """Signed distances, positive inside (frames, KIND.size), SI."""
    levels: FloatArray
    """0 clear, 1 caution, 2 warning, 3 exceedance (frames, KIND.size)."""
    normalized_distance: FloatArray
    """Signed distance to the nearer boundary in (10 kn, 10 deg) (frames,)."""
    time_to_limit: FloatArray
    """Predicted time until the corridor is left [s] (frames,)."""
    side: FloatArray
    """-1 low, 1 high, 0 none (frames,)."""
    limits: Mapping[str, Any] = field(default_factory=dict)
    """Least margin to every limit, and time beyond it."""

    def of(self, name: str) -> FloatArray:
        """Margin of one limit over time (frames,).

        Args:
            name: One of ``WATCHED``.
        """
        column: FloatArray = self.margins[:, WATCHED.index(name)]
        return column


class MarginWatch:
    """Margins and levels of rows that follow one another, and what they came to: the one way to watch a flight."""

    def __init__(self, tables: MonitorTables, limits: LimitLevels, dt: float) -> None:
        """Begin with all levels clear; compiles, or loads, what looks at rows.

        Args:
            tables: Limits and levels for the kernels.
            limits: The levels for people.
        """
        self.limits = limits
        """Unit and levels of each limit."""
        self._tables, self._dt = tables, dt
        self._state = np.zeros(monitor_kernels.LEVEL_STATE_SIZE)
        self._worst = np.full(KIND.size, np.inf)
        self._outside = np.zeros(KIND.size, dtype=np.int64)
        self.look(np.zeros((0, SENSOR.size)), np.zeros(0))

    def reset(self) -> None:
        """A new flight begins: all levels are clear."""
        self._state[:] = 0.0

    def look(
        self, sensors: FloatArray, ahead: FloatArray, driven: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Margins and levels of the next rows, each of shape (frames, KIND.size).

        Args:
            sensors: What is known (frames, SENSOR.size).
            ahead: Time to limit (frames,) [s].
            driven: What the frame knows besides, ``driven_of_rows``; None: nothing, and its limits are not watched.
        """
        if driven is None:
            driven = np.full((len(sensors), DRIVEN.size), np.nan)
        margins, levels = np.empty((len(sensors), KIND.size)), np.empty((len(sensors), KIND.size))
        monitor_kernels.watch(self._tables, sensors, driven, ahead, self._dt, self._state, margins, levels)
        self._worst = np.minimum(self._worst, margins.min(axis=0, initial=np.inf))
        self._outside += np.count_nonzero(margins < self.limits.outside, axis=0)
        return margins, levels

    def summary(self) -> dict[str, dict[str, Any]]:
        """Least margin, its unit, and time beyond the limit by limit, as ``rtsim fly --json`` prints them."""
        return {
            name: {
                "worst_margin": float(self._worst[k] / self.limits.scale[k]),
                "unit": self.limits.units[k],
                "outside_s": int(self._outside[k]) * self._dt,
            }
            for k, name in enumerate(WATCHED)
            if self._worst[k] < FAR and name != "nacelle_range"
        }


class MarginMonitor:
    """Watches every limit; the same kernels serve single instants and whole flights."""

    def __init__(
        self, boundary: CorridorName = "flight", *, database: Database | None = None, dt: float = 0.004
    ) -> None:
        """Load limits and boundaries.

        Args:
            boundary: The corridor to watch.
            database: The aircraft of the prediction and of the consistency margin; None: the shipped XV-15.
        """
        database = load_database() if database is None else database
        self.dt = dt
        self.tables = monitor_tables(boundary, database)
        self._limits = load_levels(database.profile)
        self._law = law_tables("monitor", database, dt=dt, boundary=boundary)
        self._law_state = np.zeros(law_data.LAW.size)
        self._levels = MarginWatch(self.tables, self._limits, dt)
        self._work = np.zeros(law_data.WORK_SIZE)
        self._frame = 0
        self.reset()

    def reset(self) -> None:
        """Start anew: no level active, nothing learned."""
        law_kernels.law_start(self._law, self._law_state)
        self._levels.reset()
        self._frame = 0

    def step(self, sensors: Sensors, command: Command) -> Reading:
        """Read all margins and advance the levels by one frame.

        Args:
            sensors: The aircraft at the start of the frame.
            command: What acts during it.
        """
        known = sensor_array(sensors)
        acting = np.array(command.values)
        law_kernels.protect(self._law, self._law_state, self._frame, known, acting, acting.copy(), self._work)
        self._frame += 1
        ahead = float(self._law_state[law_data.LAW.time])
        margins, levels = self._levels.look(known[None, :], np.array([ahead]))
        side = float(self._law_state[law_data.LAW.side])
        return Reading(
            margins=dict(zip(WATCHED, margins[0].tolist(), strict=True)),
            levels={name: LEVEL_NAMES[int(level)] for name, level in zip(WATCHED, levels[0], strict=True)},
            normalized_distance=float(
                monitor_kernels.normalized_distance(
                    self.tables, sensors.airspeed, sensors.nacelle_angle, turn_excess(sensors.bank)
                )
            ),
            time_to_limit=ahead,
            side="low" if side < 0.0 else "high" if side > 0.0 else "",
        )

    def history(self, rows: FloatArray) -> MarginHistory:
        """Monitor a flown flight from its frame rows, as the monitor would have in flight.

        Args:
            rows: Frame history (frames, SIGNAL_COUNT) from frame 0 on.
        """
        sensors = sensors_of_rows(rows)
        acting = rows[:, _ACTED] * UNIT_SCALES[_ACTED]
        frames = len(rows)
        ahead, side, distance = np.zeros(frames), np.zeros(frames), np.zeros(frames)
        monitor_kernels.predict(self._law, sensors, acting, ahead, side)
        monitor_kernels.distances(self.tables, sensors, distance)
        watch = MarginWatch(self.tables, self._limits, self.dt)
        time, (margins, levels) = rows[:, COLUMN.time_s].copy(), watch.look(sensors, ahead, driven_of_rows(rows))
        return MarginHistory(time, margins, levels, distance, ahead, side, watch.summary())


def monitor_tables(boundary: str, database: Database) -> MonitorTables:
    """Prepare limits and levels for the kernels.

    Args:
        boundary: The corridor to watch.
        database: The plant whose trims the chart is compared with.
    """
    corridor, limits, levels = (
        load_boundary(boundary, database),
        load_limits(database.profile),
        load_levels(database.profile),
    )
    return MonitorTables(
        chart=sample_boundary(corridor),
        corners=corridor.tables(),
        plant=sample_boundary(model_corridor(database, limits)),
        torque=limits.torque,
        sink=limits.sink,
        rotor=limits.rotor,
        sideways=limits.sideways,
        alpha_speed=limits.alpha_speed,
        numbers=np.array([getattr(limits, name) for name in LIMIT.asdict()]),
        threshold=levels.threshold,
        hysteresis=levels.hysteresis,
        rise=levels.rise,
        fall=levels.fall,
    )


def compile_watch() -> None:
    """Compile, or load, what watches the rows of a flight."""
    MarginWatch(monitor_tables("design", load_database()), load_levels(), 0.004)


def sensor_array(sensors: Sensors) -> FloatArray:
    """Sensor values as the kernels take them, shape (SENSOR.size,)."""
    return np.array([float(getattr(sensors, name)) for name in Sensors.__slots__])


def sensors_of_rows(rows: FloatArray) -> FloatArray:
    """Sensor values of a frame history (frames)."""
    sensors = np.empty((len(rows), SENSOR.size))
    monitor_kernels.sensors_of(np.ascontiguousarray(rows), _SENSED, UNIT_SCALES[_SENSED], sensors)
    return sensors


def driven_of_rows(rows: FloatArray) -> FloatArray:
    """What the rows say of engines and rotors besides the sensors, SI, shape (frames, DRIVEN.size)."""
    driven: FloatArray = np.ascontiguousarray(rows[:, _DRIVEN] * UNIT_SCALES[_DRIVEN])
    return driven
