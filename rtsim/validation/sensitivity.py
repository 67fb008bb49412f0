"""How far each uncertain input moves each check."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rtsim.aircraft.xv15.data_reader import read_data
from rtsim.validation.check import Result
from rtsim.validation.declared import GROUPS, checks_of
from rtsim.validation.run import Progress, Validation, frozen, measured
from rtsim.worker_pool import work


@dataclass(frozen=True, slots=True, kw_only=True)
class Uncertain:
    """An input that is not known exactly."""

    name: str
    """In a few words, as the heading of a column."""
    key: str
    """Its entry in the aircraft's data, as of ``Xv15.load(changes=...)``."""
    low: Any
    """Least value that is defensible; with ``share`` as a factor on the value."""
    high: Any
    """Largest, or one of two other choices."""
    why: str
    """Why it is uncertain, and the range."""
    share: bool = False
    """``low`` and ``high`` are factors."""

    def value(self) -> Any:
        """The value in the aircraft's data."""
        *tables, entry = self.key.split(".")
        data, choices = read_data()
        for source in (choices, data):
            table: Any = source
            for part in tables:
                table = table.get(part, {})
            if entry in table:
                return table[entry]
        raise KeyError(self.key)

    def changes(self, end: Any) -> dict[str, Any]:
        """The change to one end of the range.

        Args:
            end: ``low`` or ``high``.
        """
        if not self.share:
            return {self.key: end}
        value = self.value()
        return {self.key: [end * part for part in value] if isinstance(value, list) else end * value}

    def range_text(self) -> str:
        """The range in words."""
        if not self.share:
            value = self.value()
            return f"{f'{value:.4g}' if type(value) is float else value}: {self.low} to {self.high}"
        value = self.value()
        shown = "table" if isinstance(value, list) else f"{value:.4g}"
        return f"{shown}: x {self.low:g} to x {self.high:g}"


UNCERTAIN = (
    Uncertain(name="tip loss", key="rotor.tip_loss_factor", low=0.95, high=0.985,
              why="0.96 to 0.98 is usual; wider here"),
    Uncertain(name="induced power", key="rotor.induced_power_factor", low=1.0, high=1.15,
              why="ideal inflow to the value usual for helicopters"),
    Uncertain(name="coning frequency", key="rotor.coning_frequency_per_rev", low=1.3, high=1.9,
              why="read by eye in a figure"),
    Uncertain(name="root drag", key="rotor.root_drag_coefficient", low=0.0, high=0.16,
              why="no section table of the shank; none to double"),
    Uncertain(name="stall delay", key="rotor.stall_delay", low="none", high="du_selig",
              why="another published law, and none"),
    Uncertain(name="delay exponent", key="rotor.stall_delay_exponent", low=0.8, high=1.6,
              why="range of the source, default 1; 1.8 was tuned to one of the tests compared here"),
    Uncertain(name="download velocity", key="wing.interference.induced_velocity_factor_at_wing", low=1.4, high=1.8,
              why="1.6 of GTRS; fully contracted wake 2, at the disc 1"),
    Uncertain(name="download fade", key="wing.immersed_fade_speed_kt", low=40.0, high=58.0,
              why="none printed from 40 kn up; the linear law of another source vanishes at 58 kn"),
    Uncertain(name="body drag", key="drag.fuselage_extra_drag_ft2", low=0.0, high=2.0,
              why="inferred from printed loads"),
    Uncertain(name="hub spring", key="rotor.hub_spring_Nm_per_rad_per_rotor", low=0.5, high=1.5, share=True,
              why="from memory in the source list"),
    Uncertain(name="side by side", key="rotor.side_by_side_XSS", low=0.5, high=1.5, share=True,
              why="printed, without its origin"),
    Uncertain(name="wake skew", key="rotor.white_blake_gradient", low=1.0, high=1.47,
              why="White and Blake 1.41; Coleman 1, Drees 1.33, Pitt and Peters 1.47"),
    Uncertain(name="gradient onset", key="rotor.white_blake_onset_advance_ratio", low=0.02, high=0.04,
              why="no source; chosen on the hover oscillations flown"),
    Uncertain(name="pylon K_PLAT", key="drag.pylon_k_plat", low=False, high=True, why="on this area inferred"),
    Uncertain(name="centre of gravity", key="cg.heli_SL_in", low=299.2, high=303.2,
              why="2 in of loading each way; 301.2 is the aft limit"),
    Uncertain(name="pitch inertia", key="mass.Iyy_heli_slugft2", low=0.9, high=1.1, share=True,
              why="14300 to 21360 slug ft2 are printed; 10 %"),
    Uncertain(name="tail pressure", key="htail.K_q", low=0.9, high=1.1, share=True,
              why="dynamic pressure at the tail, 10 %"),
    Uncertain(name="fin area", key="lateral.fin_area_each_ft2", low=20.25, high=25.25,
              why="both are printed in one report"),
    Uncertain(name="sidewash at fins", key="lateral.rotor_sidewash", low=False, high=True,
              why="one printed table, with the nacelles up inferred"),
    Uncertain(name="rotation", key="lateral.rotation", low=-1.0, high=1.0,
              why="outboard by the arrows of TM X-62407 fig 2.1; the other way for comparison"),
)  # fmt: skip
"""The uncertain inputs, in the order of the table."""


@dataclass(frozen=True, slots=True)
class Moved:
    """What one end of one range does to one check."""

    value: float
    """The model's number there."""
    change: float
    """Against the aircraft as it is; NaN where one of the two does not exist."""
    turned: bool
    """The verdict is another."""


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """Every check at both ends of every range."""

    inputs: tuple[Uncertain, ...]
    """The inputs."""
    moved: Mapping[str, tuple[tuple[Moved, Moved], ...]]
    """By check: for each input what its low and its high end do."""

    def turned(self, number: int) -> list[str]:
        """Checks whose verdict an input changes.

        Args:
            number: Its place among ``inputs``.
        """
        return [name for name, row in self.moved.items() if any(end.turned for end in row[number])]

    def to_json(self) -> dict[str, Any]:
        """The table by key."""
        inputs = [
            {"name": one.name, "key": one.key, "low": one.low, "high": one.high, "factors": one.share, "why": one.why}
            for one in self.inputs
        ]
        checks = {
            name: [[None if math.isnan(end.value) else end.value for end in pair] for pair in row]
            for name, row in self.moved.items()
        }
        return {"inputs": inputs, "values": checks}


CHANGED_GROUPS = tuple(group for group in GROUPS if group != "fidelity")
"""The LPV database is that of the aircraft as it is."""


def pieces_of(inputs: tuple[Uncertain, ...]) -> list[tuple[str, tuple[tuple[str, Any], ...]]]:
    """The pieces of work: groups for each changed aircraft, one aircraft after the other.

    Args:
        inputs: The inputs.
    """
    return [
        (group, frozen(one.changes(end)))
        for one in inputs
        for end in (one.low, one.high)
        for group in CHANGED_GROUPS
    ]  # fmt: skip


def sensitivity(
    base: Validation, *, jobs: int = 1, progress: Progress | None = None, inputs: tuple[Uncertain, ...] = UNCERTAIN
) -> Sensitivity:
    """Measure every check at both ends of every range, one input at a time.

    Args:
        base: The checks of the aircraft as it is.
        jobs: Processes.
        progress: Told what is done; each piece counts 1.
        inputs: The inputs.
    """
    names = [one.name for one in inputs for _ in range(2) for _ in CHANGED_GROUPS]
    found: dict[str, list[Moved]] = {}
    results = {result.check.id: result for result in base.results}
    pieces = pieces_of(inputs)
    for number, values in enumerate(work(measured, pieces, jobs=jobs)):
        for check, value in zip(checks_of(pieces[number][0]), values, strict=True):
            found.setdefault(check.id, []).append(_moved(results[check.id], value))
        if progress is not None:
            progress(1.0, f"Sensitivity: {names[min(number + 1, len(names) - 1)]}")
    pairs = {name: tuple(zip(row[::2], row[1::2], strict=True)) for name, row in found.items()}
    return Sensitivity(inputs, pairs)


def _moved(base: Result, value: float) -> Moved:
    if math.isnan(value) and math.isnan(base.value):
        return Moved(value, 0.0, turned=False)
    change = round(value - base.value, base.check.decimals) + 0.0
    return Moved(value, change, base.check.judged(value).status != base.status)
