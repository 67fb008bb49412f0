"""Which signals share a plot: those of one group and one unit, as ``rtsim.frame`` declares them."""

from __future__ import annotations

from dataclasses import dataclass

from rtsim.frame import UNITS, Signal
from telemetry.log.format import LOG_SIGNALS

FLAGS = frozenset({"frame", "time_s", "corridor_level", "on_downstop", "control_on_stop", "pilot_mode"})
"""Signals that are no curves: the time itself, and states, which are shown as such."""


_UNIT_ENDINGS = sorted((unit.suffix for unit in UNITS.values() if unit.suffix), key=len, reverse=True)
"""How signals end in their unit, longer ones first."""
_TITLES = {
    "plots/position/m_per_s": "Velocity in body axes",
    "plots/controls/plain": "Sticks, lever and pedals",
    "plots/rotor/plain": "Rotor load CT/sigma, advance ratio",
    "plots/controls/deg": "Control angles",
    "plots/corridor/kn": "Margins to the corridor",
    "plots/corridor/deg": "Nacelle travel to the corridor",
    "plots/nacelle/deg_per_s": "Nacelle rate",
    "plots/air/m_per_s": "Gusts",
    "plots/air/deg_per_s": "Gusts in roll, pitch and yaw",
    "plots/attitude/deg_per_s": "Body rates and turn rate",
    "plots/course/deg": "Heading and course",
    "plots/loads/plain": "Load factors",
    "plots/power/in_lb": "Mast torque",
    "plots/wind/m_per_s": "Wind towards north and east",
    "plots/protection/plain": "Changed by protection",
    "plots/protection/reason": "Limits acted for",
}
"""Titles of plots whose group's name says too little."""


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
            gathered.setdefault((_path(signal), signal.unit), []).append(column)
    return tuple(
        PlotGroup(path, _title(path, unit, columns), tuple(columns)) for (path, unit), columns in gathered.items()
    )


def label(signal_name: str, *, unit: bool = True) -> str:
    """A signal's name for people.

    Args:
        signal_name: Name of the column.
        unit: Keep the unit that ends the name; without it where the axis or the title says it.
    """
    name = signal_name
    if not unit:
        ending = next((ending for ending in _UNIT_ENDINGS if name.endswith(ending)), "")
        name = name.removesuffix(ending)
    return name.replace("_", " ")


def _title(path: str, unit: str, columns: list[int]) -> str:
    """The group, or the signal where it is the only one, with the unit."""
    first = LOG_SIGNALS[columns[0]]
    words = label(first.name, unit=False) if len(columns) == 1 else _TITLES.get(path, first.group)
    return f"{words[0].upper()}{words[1:]} [{unit or '-'}]"


def _path(signal: Signal) -> str:
    """Entity path of a signal's group and unit, in characters that need no quotes; reasons are numbers of limits."""
    plain = signal.unit.replace("/", "_per_").replace(" ", "_") or "plain"
    return f"plots/{signal.group}/{'reason' if signal.name.endswith('_reason') else plain}"
