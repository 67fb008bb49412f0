"""Time histories and mode strips: which signals share a plot, and how rows become columns of a recording."""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun as rr

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN, SIGNAL_COUNT
from telemetry.log.format import LOG_SIGNALS
from telemetry.log.signal_groups import label, plot_groups
from telemetry.view.colours import SERIES
from telemetry.view.corridor import level_of

MODE_NAMES = ("HELICOPTER", "CONVERSION", "AIRPLANE")
"""States of the mode strip's first line."""
LEVEL_NAMES = ("CLEAR", "CAUTION", "WARNING", "EXCEEDANCE")
"""States of the corridor line."""
PILOT_NAMES = ("MOCM", "EXTERNAL", "HOLD")
"""States of the pilot line, by ``pilot_mode``."""
_REASONS = {
    "STICK": COLUMN.protection_stick_reason,
    "LEVER": COLUMN.protection_lever_reason,
    "NACELLES": COLUMN.protection_nacelle_reason,
    "LATERAL STICK": COLUMN.protection_lateral_stick_reason,
    "PEDALS": COLUMN.protection_pedal_reason,
}
ACTING_NAMES = (
    "NOT ACTING",
    *(
        f"ON {', '.join(name for place, name in enumerate(_REASONS) if acting >> place & 1)}"
        for acting in range(1, 1 << len(_REASONS))
    ),
)
"""States of the protection line, by the sum of 1 for the stick, 2 for the lever, 4 for the nacelles, 8 for the lateral
stick and 16 for the pedals."""
HELICOPTER_FROM_DEG = 85.0
"""At and above this nacelle angle the aircraft flies as a helicopter [deg]."""
EVENT_LEVELS = {"info": "INFO", "caution": "WARN", "warning": "ERROR", "exceedance": "CRITICAL"}
"""Rerun's level for each level of an event."""


PILOT_PLOTS = {
    "plots/pilot/airspeed": ("Airspeed", {"flown [kn]": "airspeed_kt", "reference [kn]": "airspeed_reference_kt"}),
    "plots/pilot/nacelle": ("Nacelle", {"flown [deg]": "nacelle_deg", "reference [deg]": "nacelle_reference_deg"}),
    "plots/pilot/controls": ("Controls", {"stick, -1 to 1": "stick", "lever, 0 to 1": "lever"}),
    "plots/pilot/flapping": ("Flapping", {"size [deg]": "flapping_deg", "fore-aft [deg]": "longitudinal_flapping_deg"}),
}
"""The pilot's plots: title, short enough for a small screen, and the signals by their name in the legend. They repeat
signals of the groups, because a small plot has room for two names, and a legend lists every line of its entity."""


class Plots:
    """Logs curves, modes and events to one recording."""

    def __init__(self, recording: Any) -> None:
        """Log names and colours.

        Args:
            recording: The ``rerun.RecordingStream``.
        """
        self._recording = recording
        self._groups = plot_groups()
        self._states: dict[str, str] = {}
        for group in self._groups:
            names = [label(LOG_SIGNALS[column].name, unit=False) for column in group.columns]
            colours = [SERIES[index % len(SERIES)] for index in range(len(names))]
            recording.log(group.path, rr.SeriesLines(names=names, colors=colours, widths=[1.6]), static=True)
        self._pilot_plots = {
            path: [getattr(COLUMN, name) for name in lines.values()] for path, (_, lines) in PILOT_PLOTS.items()
        }
        for path, (_, lines) in PILOT_PLOTS.items():
            lines_of = rr.SeriesLines(names=list(lines), colors=list(SERIES[: len(lines)]), widths=[1.6])
            recording.log(path, lines_of, static=True)
        for path, states, state_colours in (
            ("events/mode", MODE_NAMES, ((59, 130, 196), (201, 138, 43), (76, 159, 112))),
            ("events/corridor", LEVEL_NAMES, ((47, 125, 79), (224, 176, 48), (240, 128, 48), (224, 72, 72))),
            ("events/pilot", PILOT_NAMES, ((91, 107, 140), (140, 91, 134), (119, 119, 119))),
            ("events/protection", ACTING_NAMES, ((52, 58, 68), *[(150, 70, 170)] * (len(ACTING_NAMES) - 1))),
        ):
            configuration = rr.StateConfiguration(values=states, labels=states, colors=state_colours)
            recording.log(path, configuration, static=True)

    def send_rows(self, rows: FloatArray) -> None:
        """Add rows to the curves.

        Args:
            rows: Full rows, shape (rows, ROW_WIDTH), times ascending.
        """
        if not len(rows):
            return
        times = [
            rr.TimeColumn("sim_time", duration=rows[:, COLUMN.time_s]),
            rr.TimeColumn("step", sequence=rows[:, COLUMN.frame].astype(np.int64)),
        ]
        plots = {group.path: list(group.columns) for group in self._groups} | self._pilot_plots
        for path, shown in plots.items():
            values = np.ascontiguousarray(rows[:, shown]).reshape(-1)
            columns = rr.Scalars.columns(scalars=values).partition([len(shown)] * len(rows))
            self._recording.send_columns(path, indexes=times, columns=columns)

    def update_states(self, rows: FloatArray) -> None:
        """Log every change of mode, corridor level and pilot, at the frame in which it happened.

        Args:
            rows: Consecutive full rows.
        """
        if not len(rows):
            return
        keys = np.stack(
            [
                rows[:, COLUMN.on_downstop],
                rows[:, COLUMN.nacelle_deg] >= HELICOPTER_FROM_DEG,
                rows[:, COLUMN.corridor_level],
                rows[:, COLUMN.pilot_mode],
                *(rows[:, column] != 0.0 for column in _REASONS.values()),
            ],
            axis=1,
        )
        changed = np.flatnonzero(np.any(np.diff(keys, axis=0) != 0.0, axis=1)) + 1
        for index in (0, *changed):
            self._log_states(rows[index])

    def event(self, text: str, level: str) -> None:
        """Add a line to the event log at the recording's current time.

        Args:
            text: What happened.
            level: ``info``, ``caution``, ``warning`` or ``exceedance``.
        """
        self._recording.log("events/log", rr.TextLog(text, level=EVENT_LEVELS.get(level, "INFO")))

    def _log_states(self, row: FloatArray) -> None:
        now = {
            "mode": MODE_NAMES[mode_of(row)],
            "corridor": LEVEL_NAMES[level_of(row)],
            "pilot": PILOT_NAMES[pilot_of(row)],
            "protection": ACTING_NAMES[acting_on(row)],
        }
        for name, state in now.items():
            before = self._states.get(name)
            if before == state:
                continue
            self._states[name] = state
            set_row_time(self._recording, row)
            self._recording.log(f"events/{name}", rr.StateChange(state=state))
            if name == "mode" and before is not None:
                # The other two are events of the flight itself, which tells them with its own words.
                self.event(f"Mode: {state.lower()}", "info")


def mode_of(row: FloatArray) -> int:
    """How the aircraft is configured, by number in ``MODE_NAMES``."""
    return 2 if row[COLUMN.on_downstop] else int(row[COLUMN.nacelle_deg] < HELICOPTER_FROM_DEG)


def pilot_of(row: FloatArray) -> int:
    """Who flies, by number in ``PILOT_NAMES``."""
    pilot = row[COLUMN.pilot_mode]
    return int(pilot) if 0.0 <= pilot < len(PILOT_NAMES) else 1


def acting_on(row: FloatArray) -> int:
    """What the protection law changes in a row: a sum as in ``ACTING_NAMES``."""
    return sum(1 << place for place, column in enumerate(_REASONS.values()) if row[column])


def set_row_time(recording: Any, row: FloatArray) -> None:
    """Set the recording's time to a row's.

    Args:
        recording: The ``rerun.RecordingStream``.
    """
    recording.set_time("sim_time", duration=float(row[COLUMN.time_s]))
    recording.set_time("step", sequence=int(row[COLUMN.frame]))


def history_of(row: FloatArray) -> FloatArray:
    """The signals of a full row.

    Args:
        row: A row of ``SIGNALS`` then ``TIMING_SIGNALS``.
    """
    return row[:SIGNAL_COUNT]
