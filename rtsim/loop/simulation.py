"""The closed loop as an object: reset, step, run, snapshot, restore. It knows no clock, no file and no socket."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from rtsim.aids import SWITCHES, switch_of
from rtsim.aircraft.variables import INPUT, STATE
from rtsim.atmosphere import Gust, Turbulence
from rtsim.atmosphere.air import add_gust, normals_needed, set_turbulence
from rtsim.choices import PilotMode, SwitchName
from rtsim.command import Command, Margins, Reference, Sensors
from rtsim.errors import InputError
from rtsim.faults import Fault, FaultSwitch
from rtsim.faults.fault_kernels import fault_apply, fault_nacelle_ok
from rtsim.faults.schedule import fault_change
from rtsim.frame import COLUMN, SIGNAL_COUNT, FloatArray
from rtsim.loop import advance_kernels as kernels
from rtsim.loop.data import (
    CLOCK_END,
    CLOCK_FLAGS,
    CLOCK_FRAME,
    CLOCK_MODE,
    CLOCK_SINK,
    END_NONE,
    END_REASONS,
    MODES,
    SimulationState,
)
from rtsim.loop.observe_kernels import observe
from rtsim.loop.setup import FlightSetup, Parts, build_parts, needed_aid_error, start_state
from rtsim.programme import Programme
from rtsim.protection.chain import ChainSnapshot, LawChain, compiled_law
from rtsim.protection.law_data import L_OVERRIDE
from rtsim.protection.laws import load_laws
from rtsim.random_streams import STREAM_PILOT, STREAM_TURBULENCE, stream_generator
from rtsim.systems.flap_kernels import FLAP_SETTING
from rtsim.systems.requests import check_flap_setting, flap_setting, next_flap_setting, trim_throttle
from rtsim.units import DEGREE, INCH_POUND, KNOT

Disturbance = Gust | Turbulence | FaultSwitch
"""What can be done to a flight from outside besides its commands; each is a recorded event."""

__all__ = ["END_REASONS", "MODES", "Disturbance", "FlightSetup", "Programme", "Simulation", "Snapshot"]


@dataclass(frozen=True, slots=True)
class Snapshot:
    """All state of a simulation at the start of a frame."""

    state: SimulationState
    """Copies of every array the frame changes."""
    random_stream: dict[str, Any]
    """State of the generators of pilot noise and turbulence, and the noise drawn for this frame."""
    laws: ChainSnapshot | None = None
    """State of the protection laws written in Python; None where there is none."""


class Simulation:
    """One aircraft, its pilot and its programme, advanced frame by frame.

    The same compiled frame serves ``step`` and ``run``; both give the same numbers bit for bit.
    """

    def __init__(self, setup: FlightSetup) -> None:
        """Load the parts and put the aircraft at the start.

        Args:
            setup: What flies, how and from where.

        Raises:
            InputError: The start has no trim or lies outside the database.
        """
        self.setup = setup
        self._parts: Parts = build_parts(setup)
        self.tables = self._parts.tables
        self._random = stream_generator(setup.options.seed, STREAM_PILOT)
        self._air_random = stream_generator(setup.options.seed, STREAM_TURBULENCE)
        self._state = start_state(setup, self._parts, self._air_random.standard_normal(3))
        self._scratch = self._parts.scratch
        self._noise_width = self._parts.noise_width
        self._row = np.zeros(SIGNAL_COUNT)
        self._command = np.zeros(3)
        self._applied = np.zeros(3)
        self._observed = False
        self._noise = np.zeros(self._noise_width)
        options = setup.options
        laws = load_laws(options.protection, boundary=options.corridor_name, database=options.database)
        self.laws = LawChain(laws, dt=self.tables.dt) if compiled_law(laws) is None else None
        """The protection laws that are called from Python, one by one; None where a compiled law flies, or none."""

    @property
    def dt(self) -> float:
        """Length of a frame [s]."""
        return self.tables.dt

    @property
    def frame_index(self) -> int:
        """Number of the frame that starts now."""
        return int(self._state.clock[CLOCK_FRAME])

    @property
    def time(self) -> float:
        """Time at the start of this frame, frame * dt [s]."""
        return self.frame_index * self.tables.dt

    @property
    def finished(self) -> bool:
        """The flight ended by itself; ``end_reason`` says why."""
        return bool(self._state.clock[CLOCK_END] != END_NONE)

    @property
    def end_reason(self) -> str:
        """Why the flight ended by itself; empty while it has not."""
        clock = self._state.clock
        return END_REASONS[int(clock[CLOCK_END])].format(sink=float(clock[CLOCK_SINK]))

    @property
    def mode(self) -> PilotMode:
        """Who flies."""
        number = int(self._state.clock[CLOCK_MODE])
        return next(name for name, value in MODES.items() if value == number)

    @property
    def database_hash(self) -> str:
        """Content hash of the LPV database in use."""
        return self._parts.database_hash

    @property
    def outside_grid(self) -> int:
        """Flags of the last LPV step: 0 inside the grid, else bits as in ``rtsim.lpv.lpv_kernels``."""
        return int(self._state.clock[CLOCK_FLAGS])

    def warm_up(self) -> None:
        """Compile or load every kernel of the frame; the state stays untouched."""
        snapshot = self.snapshot()
        self.step()
        self.step(Command(0.0, 0.5, 0.0))
        self.set_pilot("external")
        self.set_pilot("mocm")
        self.set_fault(Fault(kind="nacelle-jammed", start=0.0), on=True)
        self.set_turbulence(Turbulence.of_severity("light"))
        self.run(2)
        self.step()
        self.restore(snapshot)

    def reset(self) -> None:
        """Go back to frame 0, random stream included."""
        self._random = stream_generator(self.setup.options.seed, STREAM_PILOT)
        self._air_random = stream_generator(self.setup.options.seed, STREAM_TURBULENCE)
        fresh = start_state(self.setup, self._parts, self._air_random.standard_normal(3))
        for mine, start in zip(self._state, fresh, strict=True):
            mine[:] = start
        if self.laws is not None:
            self.laws.reset()
        self._observed = False

    def sensors(self) -> Sensors:
        """The aircraft at the start of this frame as pilots and laws may know it."""
        row = self._observe()
        x = self._state.x
        return Sensors(
            time=float(row[COLUMN.time_s]),
            airspeed=float(row[COLUMN.airspeed_indicated_kt]) * KNOT,
            airspeed_rate=float(row[COLUMN.airspeed_rate_kt_s]) * KNOT,
            nacelle_angle=float(self._scratch.motion[0]),
            nacelle_rate=float(self._scratch.motion[1]),
            pitch=float(x[STATE.pitch]),
            pitch_rate=float(x[STATE.q]),
            flight_path_angle=float(row[COLUMN.flight_path_deg]) * DEGREE,
            altitude=float(x[STATE.altitude]),
            climb_rate=float(row[COLUMN.climb_rate_m_s]),
            load_factor=float(row[COLUMN.load_factor]),
            mast_torque=float(row[COLUMN.mast_torque_inlb]) * INCH_POUND,
            flapping=float(row[COLUMN.flapping_deg]) * DEGREE,
            on_downstop=bool(row[COLUMN.on_downstop]),
            nacelle_ok=bool(fault_nacelle_ok(self._state.faults)),
        )

    def reference(self) -> Reference:
        """What the programme asks for in this frame."""
        self._observe()
        target = self._scratch.target
        wanted = self.setup.programme.at(self.time)
        return Reference(
            airspeed=float(target[0]),
            airspeed_rate=float(target[1]),
            nacelle_angle=wanted.nacelle_angle,
            nacelle_rate=float(target[4]),
            altitude=float(target[2]),
        )

    def margins(self) -> Margins:
        """Distances to the corridor boundaries at the start of this frame, by the airspeed that is indicated."""
        self._observe()
        low, high, forward, aft = (float(value) for value in self._scratch.shown[1:])
        return Margins(low=low, high=high, nacelle_forward=forward, nacelle_aft=aft)

    def pilot_command(self) -> Command:
        """The built-in MOCM's command for the frame that starts now; changes nothing."""
        self._observe()
        kernels.pilot_command(self.tables, self._state, self._scratch, self._command)
        stick, lever, rate = (float(value) for value in self._command)
        return Command(stick, lever, rate)

    def step(self, command: Command | None = None, *, applied: Command | None = None) -> FloatArray:
        """Fly one frame.

        Args:
            command: The pilot's output; None: the built-in MOCM, or the held command in mode ``hold``.
            applied: The command after protection; None: the pilot's own.

        Returns:
            The frame's row, shape (SIGNAL_COUNT,), a new array.
        """
        if command is None and applied is None and not self._observed and self.laws is None:
            # One call instead of three: handing the tables over costs more than the frame itself.
            if self._noise_width:
                self._noise[:] = self._random.standard_normal(self._noise_width)
            air_noise = self._air_random.standard_normal((1, normals_needed(self._state.gusts)))
            kernels.run_frames(
                self.tables, self._state, self._scratch, self._noise[None, :], air_noise, self._row[None, :]
            )
            return self._row.copy()
        self._observe()
        if command is not None:
            self._command[:] = command.stick, command.lever, command.nacelle_rate
        elif self.mode == "mocm":
            kernels.pilot_command(self.tables, self._state, self._scratch, self._command)
        else:
            self._command[:] = self._state.u[INPUT.stick], self._state.u[INPUT.lever], 0.0
        if applied is None:
            self._applied[:] = self._command
        else:
            self._applied[:] = applied.stick, applied.lever, applied.nacelle_rate
        if not (np.isfinite(self._command).all() and np.isfinite(self._applied).all()):
            raise InputError(
                "the command is not a finite number",
                key="command",
                value=tuple(float(v) for v in self._applied),
                mend="give stick, lever and nacelle rate as finite numbers",
            )
        air_noise = self._air_random.standard_normal(normals_needed(self._state.gusts))
        parts = (self.tables, self._state, self._scratch, self._row)
        if self.laws is None:
            kernels.advance(*parts, (self._command, self._applied, self._noise, air_noise))
        else:
            kernels.shape(self.tables, self._state, self._scratch, self._applied)
            kernels.limit(*parts)
            self._limit_in_python(self.laws)
            kernels.complete(*parts, (self._command, self._noise, air_noise))
        self._observed = False
        return self._row.copy()

    def run(self, frames: int) -> FloatArray:
        """Fly frames in one compiled call with built-in parts only.

        Args:
            frames: How many; fewer are flown if the flight ends by itself.

        Returns:
            The rows, shape (frames flown, SIGNAL_COUNT).
        """
        rows = np.zeros((frames, SIGNAL_COUNT))
        if self.laws is not None:
            flown = 0
            while flown < frames and not self.finished:
                rows[flown] = self.step()
                flown += 1
            return rows[:flown]
        noise = np.zeros((frames, self._noise_width))
        if self._noise_width and frames:
            # The noise of an already observed frame is drawn; the rest follows in the same order as by step.
            first = 1 if self._observed else 0
            if first:
                noise[0] = self._noise
            noise[first:] = self._random.standard_normal((frames - first, self._noise_width))
        air_noise = self._air_random.standard_normal((frames, normals_needed(self._state.gusts)))
        flown = int(kernels.run_frames(self.tables, self._state, self._scratch, noise, air_noise, rows))
        if frames:
            self._observed = False
        return rows[:flown]

    def set_pilot(self, mode: PilotMode, *, command: Command | None = None) -> None:
        """Hand the controls over from this frame on; the MOCM picks up without a step of the controls.

        Args:
            mode: ``mocm``, ``external`` (the caller gives commands) or ``hold`` (controls stay where they are).
            command: Controls to hold from now on; None: those that acted last.
        """
        if command is not None:
            self._state.u[INPUT.stick], self._state.u[INPUT.lever] = command.stick, command.lever
        if mode == "mocm" and self.mode != "mocm":
            self._observe()
            kernels.engage_pilot(self.tables, self._state, self._scratch)
        self._state.clock[CLOCK_MODE] = MODES[mode]
        if self._observed:
            self._row[COLUMN.pilot_mode] = MODES[mode]

    @property
    def aids(self) -> tuple[SwitchName, ...]:
        """The pilot aids that are on, automatic flaps and governor among them."""
        return tuple(name for name, place in SWITCHES.items() if self._state.switches[place] != 0.0)

    def set_aid(self, name: SwitchName, on: bool) -> None:
        """Switch a pilot aid from this frame on; no control steps.

        Args:
            name: One of ``rtsim.aids.SWITCHES``.
            on: On or off.

        Raises:
            InputError: There is no such aid, or the database does not know the aircraft without it.
        """
        place = SWITCHES[switch_of(name)]
        if not on and name in self._parts.needed_aids:
            raise needed_aid_error(name)
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
        return flap_setting(self._state.flaps, float(self._scratch.scheduled[0]))

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

    def set_fault(self, fault: Fault, on: bool) -> None:
        """Let a failure begin or end with this frame.

        Args:
            fault: The failure; its times do not count.
            on: Begins; else ends.
        """
        self._observe()
        airspeed = float(self._row[COLUMN.airspeed_kt]) * KNOT
        state, frequency = self._state, self.tables.nacelle.frequency
        fault_apply(
            state.faults, fault_change(fault, on=on, time=self.time), state.x, state.nacelle, frequency, airspeed
        )
        observe(self.tables, state, self._scratch, self._row)

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
        set_turbulence(self._state.gusts, turbulence, self._air_random.standard_normal(3))

    def set_protection_override(self, on: bool) -> None:
        """Take the authority from the protection, or give it back, from this frame on; it goes on watching.

        Args:
            on: The pilot overrides.
        """
        self._state.protection[L_OVERRIDE] = 1.0 if on else 0.0

    @property
    def protection_overridden(self) -> bool:
        """Whether the pilot has taken the authority from the protection."""
        return float(self._state.protection[L_OVERRIDE]) != 0.0

    def _limit_in_python(self, laws: LawChain) -> None:
        """Let the laws in Python limit what is to act, and record what they changed."""
        acting = self._scratch.command
        stick, lever, rate = (float(value) for value in acting)
        command = Command(stick, lever, rate)
        if laws.due(self.frame_index):
            laws.decide(self.frame_index, self.sensors(), command, self.margins())
        if self.protection_overridden:
            return
        limited = laws.apply(command)
        if limited is command:
            return
        acting[:] = limited.stick, limited.lever, limited.nacelle_rate
        row, reasons = self._row, laws.reasons
        row[COLUMN.protection_stick] = limited.stick - stick
        row[COLUMN.protection_lever] = limited.lever - lever
        row[COLUMN.protection_nacelle_rate_deg_s] = (limited.nacelle_rate - rate) / DEGREE
        row[COLUMN.protection_stick_reason] = reasons[0]
        row[COLUMN.protection_lever_reason] = reasons[1]
        row[COLUMN.protection_nacelle_reason] = reasons[2]

    def snapshot(self) -> Snapshot:
        """Copy all state: aircraft, actuators, filters, pilot, levels, clock and random stream."""
        self._observe()
        noise_state = {
            "generator": self._random.bit_generator.state,
            "drawn": self._noise.copy(),
            "air": self._air_random.bit_generator.state,
        }
        laws = self.laws.snapshot() if self.laws is not None else None
        return Snapshot(SimulationState(*(array.copy() for array in self._state)), noise_state, laws)

    def restore(self, snapshot: Snapshot) -> None:
        """Go back to a snapshot; what follows is bit-equal to what followed it the first time.

        Args:
            snapshot: From ``snapshot`` of a simulation with the same setup.
        """
        for mine, saved in zip(self._state, snapshot.state, strict=True):
            mine[:] = saved
        self._random.bit_generator.state = snapshot.random_stream["generator"]
        self._air_random.bit_generator.state = snapshot.random_stream["air"]
        self._noise[:] = np.asarray(snapshot.random_stream["drawn"])
        if self.laws is not None and snapshot.laws is not None:
            self.laws.restore(snapshot.laws)
        observe(self.tables, self._state, self._scratch, self._row)
        self._observed = True

    def _observe(self) -> FloatArray:
        if not self._observed:
            if self._noise_width:
                self._noise[:] = self._random.standard_normal(self._noise_width)
            observe(self.tables, self._state, self._scratch, self._row)
            self._observed = True
        return self._row
