"""The margin monitor: one source of margins, levels and time to limit for laws, displays and verdicts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.choices import CorridorName
from rtsim.command import SENSOR, Command, Sensors
from rtsim.corridor.boundaries import LEVEL_NAMES
from rtsim.frame import COLUMN, NACELLES_JAMMED, QUANTITY, UNIT_SCALES
from rtsim.lpv.database import Database
from rtsim.lpv.files.storage import load_database
from rtsim.protection import law_data, law_kernels, monitor_kernels
from rtsim.protection.boundary import load_boundary, model_corridor
from rtsim.protection.limits import WATCHED, LimitLevels, load_levels, load_limits
from rtsim.protection.monitor_kernels import KIND_COUNT, MonitorTables
from rtsim.protection.tables import law_tables, sample_boundary
from rtsim.units import DEGREE, KNOT

SHOWN_AS = {"airspeed": "airspeed_indicated", "nacelle_angle": "nacelle", "flight_path_angle": "flight_path"}
"""Quantities of the frame that sensors show under another name."""


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
    """Signed distances, positive inside (frames, KIND_COUNT), SI."""
    levels: FloatArray
    """0 clear, 1 caution, 2 warning, 3 exceedance (frames, KIND_COUNT)."""
    normalized_distance: FloatArray
    """Signed distance to the nearer boundary in (10 kn, 10 deg) (frames,)."""
    time_to_limit: FloatArray
    """Predicted time until the corridor is left [s] (frames,)."""
    side: FloatArray
    """-1 low, 1 high, 0 none (frames,)."""
    limit_levels: LimitLevels
    """When each limit counts as exceeded."""

    def of(self, name: str) -> FloatArray:
        """Margin of one limit over time (frames,).

        Args:
            name: One of ``WATCHED``.
        """
        column: FloatArray = self.margins[:, WATCHED.index(name)]
        return column

    def summary(self) -> dict[str, dict[str, float]]:
        """Least margin, time outside and highest level of each limit.

        Returns:
            By limit: ``worst`` in the unit of the levels' data (kn, deg, %, ...), ``outside_s``, ``level``.
        """
        step = float(self.time[1] - self.time[0]) if len(self.time) > 1 else 0.0
        found = {}
        for k, name in enumerate(WATCHED):
            margins = self.margins[:, k]
            found[name] = {
                "worst": float(margins.min()) / float(self.limit_levels.scale[k]),
                "outside_s": step * int(np.count_nonzero(margins < self.limit_levels.threshold[k, 2])),
                "level": float(self.levels[:, k].max()),
            }
        return found


class MarginMonitor:
    """Watches every limit; the same kernels serve single instants and whole flights."""

    def __init__(
        self, boundary: CorridorName = "flight", *, database: Database | None = None, dt: float = 0.004
    ) -> None:
        """Load limits and boundaries.

        Args:
            boundary: The corridor to watch.
            database: The aircraft of the prediction and of the consistency margin; None: the shipped XV-15.
            dt: Length of a frame [s].
        """
        database = load_database() if database is None else database
        self.dt = dt
        self.tables = monitor_tables(boundary, database)
        self._limits = load_levels(database.profile)
        self._law = law_tables("monitor", database, dt=dt, boundary=boundary)
        self._law_state = np.zeros(law_data.LAW_STATE_SIZE)
        self._levels = np.zeros(monitor_kernels.LEVEL_STATE_SIZE)
        self._work = np.zeros(law_data.WORK_SIZE)
        self._frame = 0
        self.reset()

    def reset(self) -> None:
        """Start anew: no level active, nothing learned."""
        law_kernels.law_start(self._law, self._law_state)
        self._levels[:] = 0.0
        self._frame = 0

    def step(self, sensors: Sensors, command: Command) -> Reading:
        """Read all margins and advance the levels by one frame.

        Args:
            sensors: The aircraft at the start of the frame.
            command: What acts during it.
        """
        known = sensor_array(sensors)
        acting = np.array([command.stick, command.lever, command.nacelle_rate])
        law_kernels.protect(self._law, self._law_state, self._frame, known, acting, acting.copy(), self._work)
        self._frame += 1
        margins, levels = np.zeros(KIND_COUNT), np.zeros(KIND_COUNT)
        ahead = float(self._law_state[law_data.L_TIME])
        monitor_kernels.limit_margins(self.tables, known, ahead, margins)
        monitor_kernels.levels_step(self.tables, margins, self.dt, self._levels, levels)
        side = float(self._law_state[law_data.L_SIDE])
        return Reading(
            margins=dict(zip(WATCHED, margins.tolist(), strict=True)),
            levels={name: LEVEL_NAMES[int(level)] for name, level in zip(WATCHED, levels, strict=True)},
            normalized_distance=float(
                monitor_kernels.normalized_distance(self.tables, sensors.airspeed, sensors.nacelle_angle)
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
        acting = np.column_stack(
            [rows[:, COLUMN.stick], rows[:, COLUMN.lever], rows[:, COLUMN.nacelle_command_rate_deg_s] * DEGREE]
        )
        frames = len(rows)
        ahead, side, distance = np.zeros(frames), np.zeros(frames), np.zeros(frames)
        margins, levels = np.zeros((frames, KIND_COUNT)), np.zeros((frames, KIND_COUNT))
        monitor_kernels.predict(self._law, sensors, acting, ahead, side)
        state = np.zeros(monitor_kernels.LEVEL_STATE_SIZE)
        monitor_kernels.watch(self.tables, sensors, ahead, self.dt, state, margins, levels)
        monitor_kernels.distances(self.tables, sensors, distance)
        return MarginHistory(rows[:, COLUMN.time_s].copy(), margins, levels, distance, ahead, side, self._limits)


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
        flapping=limits.flapping,
        load_factor_max=limits.load_factor_max,
        load_factor_min=limits.load_factor_min,
        pitch=limits.pitch,
        nacelle_forward=limits.nacelle_forward,
        nacelle_aft=limits.nacelle_aft,
        nacelle_rate=limits.nacelle_rate,
        threshold=levels.threshold,
        hysteresis=levels.hysteresis,
        rise=levels.rise,
        fall=levels.fall,
    )


def compile_watch() -> None:
    """Compile, or load, what watches the rows of a flight."""
    tables = monitor_tables("design", load_database())
    none, sensors = np.zeros((0, KIND_COUNT)), np.zeros((0, SENSOR.size))
    levels = np.zeros(monitor_kernels.LEVEL_STATE_SIZE)
    monitor_kernels.watch(tables, sensors, np.zeros(0), 0.004, levels, none, none)


def sensor_array(sensors: Sensors) -> FloatArray:
    """Sensor values as the kernels take them, shape (SENSOR.size,).

    Args:
        sensors: The sensor values.
    """
    return np.array([float(getattr(sensors, name)) for name in Sensors.__slots__])


def sensors_of_rows(rows: FloatArray) -> FloatArray:
    """Sensor values of a frame history (frames).

    Args:
        rows: Frame history (frames, SIGNAL_COUNT).
    """
    places = [getattr(QUANTITY, SHOWN_AS.get(name, name)) for name in Sensors.__slots__ if name != "nacelle_ok"]
    sensors = np.empty((len(rows), SENSOR.size))
    sensors[:, : len(places)] = rows[:, places] * UNIT_SCALES[places]
    sensors[:, SENSOR.nacelle_ok] = rows[:, COLUMN.failures].astype(np.int64) & NACELLES_JAMMED == 0
    return sensors


def severity(depth: float, duration: float, *, lost: bool = False) -> str:
    """Judge an exceedance of the corridor after the fact.

    Args:
        depth: How far outside [m/s].
        duration: How long [s].
        lost: Control was lost.

    Returns:
        ``none``, ``minor`` (at most 5 kn and 2 s), ``major``, or ``critical`` (more than 15 kn, or control lost).
    """
    if lost or depth > 15.0 * KNOT:
        return "critical"
    if depth <= 0.0:
        return "none"
    return "minor" if depth <= 5.0 * KNOT and duration <= 2.0 else "major"
