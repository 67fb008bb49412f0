"""Laws by name: the built-in ones as objects, and users' own by ``MODULE:CLASS`` or entry point."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np

from rtsim.aircraft.condition import AircraftName
from rtsim.choices import CorridorName
from rtsim.command import CHANNELS, LATERAL_CHANNELS, SENSOR, Command, Intervention, Margins, ProtectionLaw, Sensors
from rtsim.lpv.database import Database
from rtsim.lpv.files.storage import load_database
from rtsim.plugins import PluginKind, find_plugin, make_plugin
from rtsim.protection import law_data as data
from rtsim.protection import law_kernels, limiter_kernels, sideways_limiter_kernels
from rtsim.protection.law_data import LawSettings
from rtsim.protection.limits import LIMIT_KINDS, load_limits
from rtsim.protection.monitor import sensor_array
from rtsim.protection.tables import LAW_NAMES, law_tables

LAW_PLUGIN = PluginKind(
    noun="a protection law",
    option="--protection",
    entry_point_group="rtsim.protection_laws",
    built_in=tuple(LAW_NAMES),
    method="step(sensors, command, margins, dt)",
    page="docs/protection.md",
)
"""A protection law as plug-in."""
_CLIPS = (
    data.REASON_FLAP,
    data.REASON_LOAD,
    data.REASON_PITCH,
    data.REASON_TORQUE,
    data.REASON_BANK,
    data.REASON_SIDESLIP,
)
_WARNING_TIME = 5.0


class BuiltInLaw:
    """A built-in law in the form of ``rtsim.command.ProtectionLaw``."""

    def __init__(
        self,
        law: str,
        *,
        boundary: CorridorName = "flight",
        database: Database | None = None,
        settings: LawSettings | None = None,
    ) -> None:
        """Load the law.

        Args:
            law: ``off``, ``monitor``, ``governor`` or ``full``.
            boundary: The corridor it keeps to.
            database: The aircraft it knows; None: the shipped XV-15.
            settings: Its numbers; None: the aircraft's.

        Raises:
            InputError: There is no such law.
        """
        self.name = law
        self._boundary: CorridorName = boundary
        self._settings = settings
        self._database = load_database() if database is None else database
        self._tables = law_tables(law, self._database, dt=0.02, boundary=boundary, settings=settings)
        self._dt = 0.02
        self._frame = 0
        self._state = np.zeros(data.LAW.size)
        self._work = np.zeros(data.WORK_SIZE)
        self._applied = np.zeros(len(CHANNELS))
        law_kernels.law_start(self._tables, self._state)
        # Compiled, or loaded, here: a law that is one of its parts would lose its first call to the time limit.
        nothing = (np.zeros(SENSOR.size), np.zeros(len(CHANNELS)), np.zeros(len(CHANNELS)), np.zeros(data.WORK_SIZE))
        law_kernels.protect(self._tables, self._state.copy(), 0, *nothing)

    def __deepcopy__(self, memo: dict[int, Any]) -> BuiltInLaw:
        """Copy what changes in flight and share what is read-only.

        Args:
            memo: Not used: nothing that is copied refers to anything else.
        """
        del memo
        twin = copy.copy(self)
        twin._state, twin._work, twin._applied = self._state.copy(), self._work.copy(), self._applied.copy()
        return twin

    @property
    def time_to_limit(self) -> float:
        """Predicted time until the corridor is left with the controls as they are; infinite where it is not [s]."""
        return float(self._state[data.LAW.time]) if self._state[data.LAW.side] != 0.0 else math.inf

    def step(
        self, sensors: Sensors, command: Command, margins: Margins, dt: float
    ) -> tuple[Command, list[Intervention]]:
        """Give the limited command and the interventions of this frame.

        Args:
            command: The pilot's command of this frame.
            margins: Not used: the law has its own boundaries.
            dt: Time since the last call [s].
        """
        del margins
        if dt != self._dt:
            self._tables = law_tables(
                self.name, self._database, dt=dt, boundary=self._boundary, settings=self._settings
            )
            self._dt = dt
        asked = np.array(command.values)
        known = sensor_array(sensors)
        law_kernels.protect(self._tables, self._state, self._frame, known, asked, self._applied, self._work)
        self._frame += 1
        limited = Command(*(float(value) for value in self._applied))
        return limited, self._interventions(sensors, asked)

    def _interventions(self, sensors: Sensors, asked: np.ndarray[tuple[int], Any]) -> list[Intervention]:
        state = self._state
        if self._tables.law == data.LAW_MONITOR:
            return self._warnings(asked)
        found = []
        for place, (channel, cause) in enumerate(zip(CHANNELS, data.CAUSES, strict=True)):
            reason = int(state[cause])
            if reason == data.REASON_NONE:
                continue
            sideways = channel in LATERAL_CHANNELS
            kind: Literal["limit", "reverse", "blend", "clip"] = "clip" if sideways or reason in _CLIPS else "blend"
            if channel == "nacelle_rate":
                kind = "reverse" if state[data.LAW.kind] != 0.0 else "limit"
            found.append(
                Intervention(
                    limit=LIMIT_KINDS[reason - 1],
                    channel=channel,
                    kind=kind,
                    before=float(asked[place]),
                    after=float(self._applied[place]),
                    margin=self._margin(reason, sensors),
                    time_to_limit=self.time_to_limit,
                )
            )
        return found

    def _warnings(self, asked: np.ndarray[tuple[int], Any]) -> list[Intervention]:
        """The monitor's only word: the corridor will be left soon."""
        ahead = self.time_to_limit
        if ahead >= _WARNING_TIME:
            return []
        rate = float(asked[2])
        reason = data.REASON_LOW if self._state[data.LAW.side] < 0.0 else data.REASON_HIGH
        margin = float(self._state[data.LAW.margin])
        return [Intervention(LIMIT_KINDS[reason - 1], "nacelle_rate", "warn", rate, rate, margin, ahead)]

    def _margin(self, reason: int, sensors: Sensors) -> float:
        """Margin to the limit that asked for an intervention; the least predicted one for the corridor."""
        limits = load_limits(self._database.profile)
        known = sensor_array(sensors)
        if reason == data.REASON_FLAP:
            return float(limits.flapping - sideways_limiter_kernels.worst_flapping(known))
        if reason == data.REASON_LOAD:
            load = sensors.load_factor
            return float(min(limits.load_factor_max - load, load - limits.load_factor_min))
        if reason == data.REASON_PITCH:
            return float(limits.pitch - abs(sensors.pitch))
        if reason == data.REASON_BANK:
            allowed = sideways_limiter_kernels.bank_limit(limits.sideways, sensors.nacelle_angle)
            return float(allowed - abs(sensors.bank))
        if reason == data.REASON_SIDESLIP:
            allowed = sideways_limiter_kernels.sideward_limit(limits.sideways, sensors.airspeed)
            speed = sideways_limiter_kernels.sideward_speed(known, self._tables.model.alpha_speed)
            return float(allowed - abs(speed))
        if reason == data.REASON_TORQUE:
            bound = limiter_kernels.torque_limit(limits.torque, sensors.airspeed, sensors.nacelle_angle)
            return float(1.0 - sideways_limiter_kernels.worst_torque(known) / bound)
        if reason == data.REASON_SINK:
            return float(
                limiter_kernels.allowed_sink(limits.sink, sensors.airspeed, sensors.altitude) + sensors.climb_rate
            )
        return float(self._state[data.LAW.margin])


@dataclass(frozen=True, slots=True)
class LawSpec:
    """A law by its name, found and ready to make; small and picklable, so that workers can make their own."""

    name: str
    """Built-in name, entry point or ``MODULE:CLASS``."""
    boundary: CorridorName = "flight"
    """Corridor that a built-in law keeps to."""
    aircraft: AircraftName = ""
    """The aircraft that a built-in law knows: a database file, empty for the shipped XV-15, or a condition."""

    @property
    def built_in(self) -> bool:
        """Whether it is one of the built-in laws."""
        return self.name in LAW_NAMES

    def make(self) -> ProtectionLaw:
        """Make a fresh law, as every flight begins with.

        Raises:
            InputError: There is no such law, or its class cannot be made.
        """
        if self.built_in:
            return BuiltInLaw(self.name, boundary=self.boundary, database=load_database(self.aircraft or None))
        target = find_plugin(self.name, LAW_PLUGIN)
        return cast("ProtectionLaw", make_plugin(target, self.name, LAW_PLUGIN))


def load_law(name: str, *, boundary: CorridorName = "flight", aircraft: AircraftName = "") -> LawSpec:
    """Find a law by name.

    Args:
        name: ``off``, ``monitor``, ``governor``, ``full``, the name of an entry point in the group
            ``rtsim.protection_laws``, or ``MODULE:CLASS``; modules are also looked for in the current directory.
        boundary: Corridor that a built-in law keeps to.
        aircraft: What a built-in law knows: a database file, empty for the shipped XV-15, or a condition.

    Returns:
        The law; ``make()`` gives a fresh one for a flight.

    Raises:
        InputError: There is no such law, or it has no method ``step``.
    """
    spec = LawSpec(name, boundary, aircraft)
    if not spec.built_in:
        find_plugin(name, LAW_PLUGIN)
    return spec


def load_laws(
    names: str | Sequence[str], *, boundary: CorridorName = "flight", aircraft: AircraftName = ""
) -> tuple[LawSpec, ...]:
    """Find a chain of laws.

    Args:
        names: The laws in the order in which they act, as a sequence or separated by commas.
        boundary: Corridor that built-in laws keep to.
        aircraft: What built-in laws know: a database file, empty for the shipped XV-15, or a condition.

    Returns:
        The laws; ``off`` is left out of a chain of several.

    Raises:
        InputError: One of them is none.
    """
    listed = [name.strip() for name in names.split(",")] if isinstance(names, str) else list(names)
    laws = tuple(load_law(name, boundary=boundary, aircraft=aircraft) for name in listed)
    if len(laws) == 1:
        return laws
    return tuple(law for law in laws if law.name != "off")
