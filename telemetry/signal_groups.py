"""Which signals share a plot: those of one group and one unit, as ``rtsim.frame`` declares them."""

from __future__ import annotations

from dataclasses import dataclass

from telemetry.log_format import LOG_SIGNALS

FLAGS = frozenset({"frame", "time_s", "corridor_level", "on_downstop", "control_on_stop", "pilot_mode"})
"""Signals that are no curves: the time itself, and states, which are shown as such."""


@dataclass(frozen=True, slots=True)
class PlotGroup:
    """Signals of one group and unit: one plot."""

    path: str
    """Entity path in a Rerun recording."""
    title: str
    """Title of the plot."""
    columns: tuple[int, ...]
    """Numbers of its columns in a full row."""


def plot_groups() -> tuple[PlotGroup, ...]:
    """Every signal that is a curve, by group and unit, in declared order."""
    gathered: dict[tuple[str, str], list[int]] = {}
    for column, signal in enumerate(LOG_SIGNALS):
        if signal.name not in FLAGS:
            gathered.setdefault((signal.group, signal.unit), []).append(column)
    return tuple(
        PlotGroup(_path(group, unit), f"{group.capitalize()} [{unit or '-'}]", tuple(columns))
        for (group, unit), columns in gathered.items()
    )


def plot_path(signal_name: str) -> str:
    """The entity of a Rerun recording that carries a signal.

    Args:
        signal_name: Name of the column.
    """
    signal = next(signal for signal in LOG_SIGNALS if signal.name == signal_name)
    return _path(signal.group, signal.unit)


def label(signal_name: str) -> str:
    """A signal's name for people.

    Args:
        signal_name: Name of the column.
    """
    return signal_name.replace("_", " ")


def _path(group: str, unit: str) -> str:
    """Entity path of a group and unit, in characters that need no quotes."""
    plain = unit.replace("/", "_per_").replace(" ", "_") or "plain"
    return f"plots/{group}/{plain}"
