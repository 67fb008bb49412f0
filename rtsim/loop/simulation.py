"""The closed loop as an object: reset, step, run, snapshot, restore. It knows no clock, no file and no socket."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rtsim.aids.aids_kernels import MEMORY
from rtsim.aids.design import SWITCHES, switch_of
from rtsim.aids.lateral_design import LATERAL_AIDS
from rtsim.aircraft.variables import INPUT
from rtsim.arguments import instance, whole_number
from rtsim.arrays import FloatArray
from rtsim.atmosphere.air import add_gust, set_turbulence
from rtsim.atmosphere.specification import Gust, Turbulence
from rtsim.choices import PilotMode, SwitchName
from rtsim.command import SENSOR, Command, Margins, Reference, Sensors
from rtsim.errors import InputError, suggestion
from rtsim.faults.fault import Fault, FaultSwitch, check_sides
from rtsim.faults.fault_kernels import fault_apply
from rtsim.faults.schedule import fault_change
from rtsim.frame import QUANTITY, SIGNAL_COUNT
from rtsim.kernels.compiled import interpreted
from rtsim.loop.data import CLOCK, END, END_REASONS, KNOWN, MODES, STATION, SimulationState, SimulationTables
from rtsim.loop.flying import WHOLE, Flying, new_normals
from rtsim.loop.frame_kernels import ASK, COMPLETE, CONSULT, LIMIT, OBSERVE, SCRIPT
from rtsim.loop.setup import (
    FlightSetup,
    Parts,
    build_parts,
    lateral_aid_error,
    needed_aid_error,
    prepare,
    restart,
)
from rtsim.lpv.database import Database
from rtsim.pilot.layout_kernels import TARGET
from rtsim.programme import Programme
from rtsim.protection.chain import ChainSnapshot, LawChain, compiled_law
from rtsim.protection.law_data import LAW
from rtsim.protection.laws import load_laws
from rtsim.systems.flap_kernels import FLAP_SETTING
from rtsim.systems.requests import (
    check_flap_setting,
    check_slow_rotors,
    flap_setting,
    next_flap_setting,
    set_held_speed,
    trim_throttle,
)

Disturbance = Gust | Turbulence | FaultSwitch
"""What can be done to a flight from outside besides its commands; each is a recorded event."""

__all__ = ["END_REASONS", "MODES", "Disturbance", "FlightSetup", "Programme", "Simulation", "Snapshot"]


@dataclass(frozen=True, slots=True)
class Snapshot:
    """All state of a simulation at the start of a frame."""

    state: SimulationState
    """Copies of every array the frame changes."""
    random_stream: dict[str, Any]
    """State of the generators of pilot noise and turbulence."""
    laws: ChainSnapshot | None = None
    """State of the protection laws written in Python; None where there is none."""


class Simulation:
    """One aircraft, its pilot and its programme, advanced frame by frame.

    The same compiled frame serves ``step`` and ``run``; both give the same numbers bit for bit.
    """

    def __init__(self, setup: FlightSetup, *, parts: Parts | None = None, laws: LawChain | None = None) -> None:
        """Load the parts and put the aircraft at the start.

        Args:
            setup: What flies, how and from where.
            parts: Its parts, where the caller changed some; None: as ``build_parts`` makes them.
            laws: Laws in Python in place of the setup's protection.

        Raises:
            InputError: The start has no trim or lies outside the database.
        """
        instance(setup, FlightSetup, "setup", "make one: FlightSetup(programme=...)")
        instance(setup.programme, Programme, "setup.programme", "make one: Programme.hold(...)")
        self.setup = setup
        self._parts: Parts = build_parts(setup) if parts is None else parts
        self.flying: Flying = prepare(setup, self._parts)
        """The flight as it is flown."""
        self._state, self._scratch = self.flying.state, self.flying.scratch
        self._observed = True
        if laws is None:
            options = setup.options
            chain = load_laws(options.protection, boundary=options.corridor_name, aircraft=options.aircraft)
            if compiled_law(chain) is None:
                laws = LawChain(chain, dt=self.tables.dt, profile=self.database.profile)
        self.laws = laws
        """The protection laws that are called from Python, one by one; None where a compiled law flies, or none."""

    @property
    def tables(self) -> SimulationTables:
        """Everything that is flown with; read-only, since the frame keeps its addresses."""
        return self.flying.tables

    @property
    def dt(self) -> float:
        """Length of a frame [s]."""
        return self.tables.dt

    @property
    def frame_index(self) -> int:
        """Number of the frame that starts now."""
        return int(self._state.clock[CLOCK.frame])

    @property
    def time(self) -> float:
        """Time at the start of this frame, frame * dt [s]."""
        return self.frame_index * self.tables.dt

    @property
    def finished(self) -> bool:
        """The flight ended by itself; ``end_reason`` says why."""
        return self.flying.ended

    @property
    def end_reason(self) -> str:
        """Why the flight ended by itself; empty while it has not."""
        return self.flying.end_reason

    @property
    def mode(self) -> PilotMode:
        """Who flies."""
        number = int(self._state.clock[CLOCK.mode])
        return next(name for name, value in MODES.items() if value == number)

    @property
    def database(self) -> Database:
        """The LPV database in use, with the aircraft's profile."""
        return self._parts.database

    @property
    def database_hash(self) -> str:
        """Hash of the aircraft: of the LPV database and, where it has one of its own, of its profile."""
        return self._parts.database_hash

    def warm_up(self) -> None:
        """Compile or load what the coming frames need; the state stays untouched."""
        snapshot = self.snapshot()
        self.step()
        self.restore(snapshot)

    def reset(self) -> None:
        """Go back to frame 0, random stream included."""
        restart(self.flying, self.setup, self._parts)
        if self.laws is not None:
            self.laws.reset()
        self._observed = True

    def sensors(self) -> Sensors:
        """The aircraft at the start of this frame as pilots and laws may know it."""
        self._observe()
        return sensors_of(self._scratch.sensors)

    def reference(self) -> Reference:
        """What the programme asks for in this frame."""
        self._observe()
        target = self._scratch.target
        wanted = self.setup.programme.at(self.time)
        return Reference(
            airspeed=float(target[TARGET.airspeed]),
            airspeed_rate=float(target[TARGET.airspeed_rate]),
            nacelle_angle=wanted.nacelle_angle,
            nacelle_rate=float(target[TARGET.nacelle_rate]),
            altitude=float(target[TARGET.altitude]),
            heading=self.setup.options.heading,
        )

    def margins(self) -> Margins:
        """Distances to the corridor boundaries at the start of this frame, by the airspeed that is indicated."""
        self._observe()
        low, high, forward, aft = (float(value) for value in self._scratch.shown[1:])
        return Margins(low=low, high=high, nacelle_forward=forward, nacelle_aft=aft)

    def pilot_command(self) -> Command:
        """The built-in MOCM's command for the frame that starts now, with what scripted hands do."""
        self.flying.do(CONSULT | SCRIPT if self._observed else OBSERVE | CONSULT | SCRIPT)
        self._observed = True
        return Command(*self._scratch.command[STATION.pilot].tolist())

    def step(
        self, command: Command | None = None, *, applied: Command | None = None, scripted: bool = False
    ) -> FloatArray:
        """Fly one frame.

        Args:
            command: The pilot's output; None: the built-in MOCM, or the held command in mode ``hold``.
            applied: The command that goes to aids and protection in its place; None: the pilot's own.
            scripted: The flight's script changes the command that is given.

        Returns:
            The frame's row, shape (SIGNAL_COUNT,), a new array.
        """
        row: FloatArray = np.empty(SIGNAL_COUNT)
        for key, given in (("command", command), ("applied", applied)):
            if given is not None and type(given) is not Command:
                instance(given, Command, key, "give Command(stick, lever, nacelle_rate, lateral_stick, pedal)")
        if command is None and applied is None:
            self._fly(row, 1, WHOLE)
            return row
        stations = self._scratch.command
        if command is None:
            self.flying.do(OBSERVE | ASK | SCRIPT)
        else:
            stations[STATION.pilot] = stations[STATION.hands] = _numbers(command)
        if applied is not None:
            stations[STATION.hands] = _numbers(applied)
        self._fly(row, 1, OBSERVE | LIMIT | COMPLETE | (SCRIPT if scripted else 0))
        return row

    def run(self, frames: int, rows: FloatArray | None = None) -> FloatArray:
        """Fly frames in compiled code; only laws in Python are asked in between.

        Args:
            frames: How many; fewer are flown if the flight ends by itself.
            rows: Written instead of a new array, shape (at least frames, SIGNAL_COUNT).

        Returns:
            The rows, shape (frames flown, SIGNAL_COUNT).
        """
        frames = whole_number(frames, "frames")
        rows = np.empty((frames, SIGNAL_COUNT)) if rows is None else rows
        if rows.ndim != 2 or len(rows) < frames or rows.shape[1] != SIGNAL_COUNT or not rows.flags.c_contiguous:
            allowed = f"at least {frames} x {SIGNAL_COUNT}, contiguous"
            raise InputError("has the wrong shape", key="rows", value=rows.shape, allowed=allowed)
        return rows[: self._fly(rows.reshape(-1), frames, WHOLE)]

    def _fly(self, rows: FloatArray, frames: int, stages: int) -> int:
        """Fly frames, the first with these stages, asking the laws in Python where they are due."""
        self._observed = False
        if self.laws is None:
            return self.flying.fly(rows, frames, stages)
        return fly_with_laws(self.flying, self.laws, rows, frames, stages)

    def set_pilot(self, mode: PilotMode, *, command: Command | None = None) -> None:
        """Hand the controls over from this frame on; the MOCM picks up without a step of the controls.

        Whoever it is, lateral stick and pedals fade from what acted into what he gives.

        Args:
            mode: ``mocm``, ``external`` (the caller gives commands) or ``hold`` (controls stay where they are).
            command: Controls to hold from now on; None: those that acted last.
        """
        if mode not in MODES:
            mend = suggestion(str(mode), MODES, otherwise="choose one")
            raise InputError("is no mode of the pilot", key="mode", value=mode, allowed=", ".join(MODES), mend=mend)
        if command is not None:
            hands = (command.stick, command.lever, command.lateral_stick, command.pedal)
            self._state.u[[INPUT.stick, INPUT.lever, INPUT.lateral_stick, INPUT.pedal]] = hands
        if mode == "mocm" and self.mode != "mocm":
            self.flying.engage()
            self._observed = True
        self._state.clock[CLOCK.mode] = MODES[mode]
        self._state.aids[[MEMORY.lateral_offset, MEMORY.pedal_offset]] = math.nan  # no step, whoever takes over
        self._observed = False

    @property
    def aids(self) -> tuple[SwitchName, ...]:
        """The pilot aids that are on, automatic flaps and governor among them."""
        return tuple(name for name, place in SWITCHES.items() if self._state.switches[place] != 0.0)

    def set_aid(self, name: SwitchName, on: bool) -> None:
        """Switch a pilot aid from this frame on; no control steps.

        Args:
            name: One of ``rtsim.aids.design.SWITCHES``.
            on: On or off.

        Raises:
            InputError: There is no such aid, or the database does not know the aircraft without it.
        """
        place = SWITCHES[switch_of(name)]
        if not on and name in self._parts.needed_aids:
            raise needed_aid_error(name)
        if on and name in LATERAL_AIDS and not self._parts.lateral_aids:
            raise lateral_aid_error(name)
        if on and name == "automatic_rotor_speed":
            check_slow_rotors(self.tables.drive)
        self._state.switches[place] = 1.0 if on else 0.0

    def set_flaps(self, angle: float) -> None:
        """Send the flaps to a setting from this frame on, at their rate; they no longer follow the schedule.

        Args:
            angle: Flap deflection [rad].

        Raises:
            InputError: The angle is outside the travel of the flaps, or the database does not know what they do.
        """
        check_flap_setting(self.tables.flaps, angle)
        self.set_aid("automatic_flaps", on=False)
        self._state.flaps[FLAP_SETTING] = angle

    @property
    def flap_setting(self) -> float:
        """Deflection that the flaps go to or stand at [rad]."""
        self._observe()
        return flap_setting(self._state.flaps, float(self._scratch.known[KNOWN.flap]))

    def next_flap_setting(self, step: int) -> float:
        """The published flap setting beyond the present one [rad]; beyond the last one, that one.

        Args:
            step: 1 down (more flap), -1 up.
        """
        return next_flap_setting(self.tables.flaps, self.flap_setting, step)

    def set_throttle_trim(self, share: float) -> None:
        """Trim the throttle from this frame on; it acts while the rotor-speed governor is off.

        Args:
            share: Engine power to add to that of the power lever, as a share of full power, -0.5 to 0.5.

        Raises:
            InputError: The share is out of range.
        """
        trim_throttle(self._state.drive, share)

    def set_rotor_speed(self, speed: float) -> None:
        """Give the governor another rotor speed to hold from this frame on; it no longer comes down by itself.

        Args:
            speed: Rotor speed [rad/s]: on the downstop down to that of airplane mode.

        Raises:
            InputError: The speed is out of range, or the nacelles do not stand on the downstop.
        """
        set_held_speed(self.tables.drive, self._state.drive, speed, float(self._state.nacelle[1]))
        self.set_aid("automatic_rotor_speed", on=False)

    def set_fault(self, fault: Fault, on: bool) -> None:
        """Let a failure begin or end with this frame.

        Args:
            fault: The failure; its times do not count.
            on: Begins; else ends.
        """
        check_sides(fault, rolls=self.tables.plant.lateral != 0)
        self._observe()
        airspeed = float(self._scratch.si[QUANTITY.airspeed])
        state, frequency = self._state, self.tables.nacelle.frequency
        change = fault_change(fault, on=on, time=self.time, profile=self.database.profile)
        interpreted(fault_apply)(state.faults, change, state.x, state.u, state.nacelle, frequency, airspeed)
        state.clock[CLOCK.faults] = 1.0
        self._observed = False

    def disturb(self, change: Disturbance) -> None:
        """Change the air or let something fail or mend, from now on.

        Args:
            change: A gust, another severity of the turbulence, or a failure with whether it begins or ends.

        Raises:
            InputError: As many live gusts as fit are still acting.
        """
        if isinstance(change, Gust):
            self.add_gust(change)
        elif isinstance(change, Turbulence):
            self.set_turbulence(change)
        else:
            self.set_fault(change.fault, on=change.on)

    def add_gust(self, gust: Gust) -> None:
        """Add a gust to the air ahead; it is felt from the frame after this one at the earliest.

        Args:
            gust: The gust; a start that has passed counts as now.

        Raises:
            InputError: As many live gusts as fit are still acting.
        """
        add_gust(self._state.gusts, dataclasses.replace(gust, start=max(gust.start, self.time)))

    def set_turbulence(self, turbulence: Turbulence) -> None:
        """Let the turbulence move to another severity, beginning with the frame after this one.

        Args:
            turbulence: What it becomes; its ``fade_in`` is the time of the change.
        """
        set_turbulence(self._state.gusts, turbulence, new_normals(self.flying.streams))

    def set_protection_override(self, on: bool) -> None:
        """Take the authority from the protection, or give it back, from this frame on; it goes on watching.

        Args:
            on: The pilot overrides.
        """
        self._state.protection[LAW.override] = 1.0 if on else 0.0

    @property
    def protection_overridden(self) -> bool:
        """Whether the pilot has taken the authority from the protection."""
        return float(self._state.protection[LAW.override]) != 0.0

    def snapshot(self) -> Snapshot:
        """Copy all state: aircraft, actuators, filters, pilot, levels, clock and random stream."""
        noise_state = {name: one.bit_generator.state for name, one in self.flying.streams._asdict().items()}
        laws = self.laws.snapshot() if self.laws is not None else None
        return Snapshot(SimulationState(*(array.copy() for array in self._state)), noise_state, laws)

    def restore(self, snapshot: Snapshot) -> None:
        """Go back to a snapshot; what follows is bit-equal to what followed it the first time.

        Args:
            snapshot: From ``snapshot`` of a simulation with the same setup.
        """
        instance(snapshot, Snapshot, "snapshot", "give what snapshot() returned")
        self.flying.take(snapshot.state)
        for name, one in self.flying.streams._asdict().items():
            one.bit_generator.state = snapshot.random_stream[name]
        if self.laws is not None and snapshot.laws is not None:
            self.laws.restore(snapshot.laws)
        self._observed = False

    def _observe(self) -> None:
        if not self._observed:
            self.flying.do(OBSERVE)
            self._observed = True


def sensors_of(values: FloatArray) -> Sensors:
    """Sensor values as laws and pilots see them.

    Args:
        values: In the order of ``Sensors``, shape (SENSOR.size,), booleans as numbers.
    """
    numbers: list[Any] = values.tolist()
    for place in (SENSOR.on_downstop, SENSOR.nacelle_ok):
        numbers[place] = numbers[place] != 0.0
    return Sensors(*numbers)


def fly_with_laws(flying: Flying, laws: LawChain, rows: FloatArray, frames: int, stages: int = WHOLE) -> int:
    """Fly frames, asking laws in Python where they are due; in between their last decision is held in compiled code.

    Args:
        flying: The flight.
        laws: The laws.
        rows: Written: their rows, frames * SIGNAL_COUNT numbers.
        frames: How many at most.
        stages: Stages of the first frame.

    Returns:
        How many were flown.
    """
    clock, held, scratch = flying.state.clock, flying.state.held, flying.scratch
    protected, sensors, shown = scratch.command[STATION.protected], scratch.sensors, scratch.shown
    flown = 0
    while flown < frames and clock.item(CLOCK.end) == END.none:
        frame = int(clock.item(CLOCK.frame))
        if laws.due(frame):
            flying.do(stages & ~COMPLETE)
            laws.decide(frame, sensors_of(sensors), Command(*protected.tolist()), Margins(*shown.tolist()[1:]))
            held[:] = laws.held
            stages = COMPLETE
        block = min(frames - flown, laws.every - frame % laws.every)
        flown += flying.fly(rows[flown * SIGNAL_COUNT :], block, stages)
        stages = WHOLE
    return flown


def _numbers(command: Command) -> tuple[float, ...]:
    """The channels of a command that came from outside."""
    given = Command.given(command)
    if not given.finite:
        raise InputError(
            "the command is not a finite number",
            key="command",
            value=given.values,
            mend="give every channel as a finite number",
        )
    return given.values
