"""What one frame of the closed loop is made of: its parameters, its state, its work space, and places in them."""

from __future__ import annotations

from typing import NamedTuple

from rtsim.aids.aids_kernels import AidTables
from rtsim.aircraft.xv15.tables import AircraftTables
from rtsim.atmosphere.gust_kernels import GustTables
from rtsim.choices import PilotMode
from rtsim.corridor.corridor_kernels import CorridorTables
from rtsim.faults.fault_kernels import FaultTables
from rtsim.frame import FloatArray
from rtsim.loop.plant_kernels import AircraftFrame
from rtsim.lpv.lpv_kernels import LpvTables
from rtsim.nacelle.automatic_kernels import AutomaticTables
from rtsim.nacelle.nacelle_kernels import NacelleTables
from rtsim.pilot.pilot_kernels import PilotTables
from rtsim.protection.law_data import ProtectionTables
from rtsim.systems.drive_kernels import DriveTables
from rtsim.systems.flap_kernels import FlapTables

MODE_MOCM, MODE_EXTERNAL, MODE_HOLD = 0, 1, 2
MODES: dict[PilotMode, int] = {
    "mocm": MODE_MOCM,
    "external": MODE_EXTERNAL,
    "hold": MODE_HOLD,
}
"""Pilot modes by name, with their number in the ``pilot_mode`` column."""

# Places in SimulationState.clock.
CLOCK_FRAME, CLOCK_MODE, CLOCK_DISTANCE, CLOCK_FLAGS, CLOCK_END, CLOCK_SINK = 0, 1, 2, 3, 4, 5
CLOCK_SIZE = 6
# Places in SimulationState.reference: unfiltered airspeed command is a function of time and not kept.
REFERENCE_AIRSPEED, REFERENCE_RATE = 0, 1
REFERENCE_SIZE = 2
# Why a flight ended by itself.
END_NONE, END_CRASH, END_ATTITUDE, END_NOT_FINITE, END_GENTLE_LANDING, END_HARD_LANDING = 0, 1, 2, 3, 4, 5
END_ROTORS_SLOW, END_ROTORS_FAST = 6, 7
END_REASONS = {
    END_NONE: "",
    END_CRASH: "the aircraft hit the ground, sinking at {sink:.1f} m/s",
    END_ATTITUDE: "control was lost: pitch attitude beyond 80 deg",
    END_NOT_FINITE: "the model diverged: a state is no longer a finite number",
    END_GENTLE_LANDING: "touched down gently, sinking at {sink:.1f} m/s",
    END_HARD_LANDING: "landed hard, sinking at {sink:.1f} m/s",
    END_ROTORS_SLOW: "rotor speed below 80 %: slower than can be flown",
    END_ROTORS_FAST: "rotor speed above 115 %: faster than can be flown",
}
"""Why a flight ended by itself, by the code in the simulation's clock."""
# The array handed to the pilot, see rtsim.pilot.pilot_kernels.
TARGET_SIZE = 5


class SimulationTables(NamedTuple):
    """Everything the frame reads and never writes."""

    dt: float
    """Length of a frame [s]."""
    wind: float
    """Tailwind [m/s]."""
    lpv: LpvTables
    """The LPV aircraft."""
    aircraft: AircraftTables | AircraftFrame
    """The nonlinear aircraft where it flies; else what the frame reads of it."""
    nacelle: NacelleTables
    """Conversion actuator."""
    automatic: AutomaticTables
    """Automatic nacelle control; where active, it sets the nacelle rate whoever flies."""
    corridor: CorridorTables
    """Boundaries and levels."""
    pilot: PilotTables
    """The MOCM's gains and references."""
    flaps: FlapTables
    """What moves the flaps."""
    drive: DriveTables
    """What turns the rotors."""
    aids: AidTables
    """Schedules of the pilot aids; they act on hands and plug-ins, not on the MOCM, which is designed for the
    bare aircraft, nor on controls that are held."""
    gusts: GustTables
    """Parameters of gusts and turbulence."""
    faults: FaultTables
    """Failures and their times."""
    protection: ProtectionTables
    """The compiled protection law; it acts after the aids, on what would move the controls."""
    programme: FloatArray
    """Rows: time [s], airspeed [m/s], nacelle angle [rad], altitude [m] of the programme's points."""
    reference_frequency: float
    """Natural frequency of the critically damped airspeed reference filter [rad/s]."""


class SimulationState(NamedTuple):
    """Everything the frame changes; a snapshot is a copy of these arrays and of the random stream."""

    x: FloatArray
    """Aircraft state."""
    u: FloatArray
    """Inputs that acted last."""
    nacelle: FloatArray
    """Actuator: command angle, angle, rate."""
    automatic: FloatArray
    """Automatic nacelle control: filtered airspeed, rate commanded last, whether it has begun."""
    reference: FloatArray
    """Filtered airspeed reference and its rate."""
    level: FloatArray
    """Corridor level timers."""
    pilot: FloatArray
    """State of the MOCM."""
    aids: FloatArray
    """State of the pilot aids."""
    switches: FloatArray
    """Which aids are on."""
    flaps: FloatArray
    """Deflection of the flaps, whether they follow their schedule, and their setting."""
    drive: FloatArray
    """Rotor speed less the governed one, engine power, its offset from the throttle's law, whether governed, throttle
    trim."""
    gusts: FloatArray
    """Turbulence filters, gusts that act or are to come, and what acts now."""
    faults: FloatArray
    """Which failures are active."""
    protection: FloatArray
    """State of the protection law."""
    clock: FloatArray
    """Frame number, pilot mode, distance flown [m], LPV flags, end code, sink rate at the end [m/s]."""


class Scratch(NamedTuple):
    """Work space; holds nothing from one frame to the next."""

    work: FloatArray
    """Work array of the plant kernels."""
    y: FloatArray
    """Plant outputs."""
    xdot: FloatArray
    """Plant state derivative."""
    path: FloatArray
    """Nacelle motion over the frame, shape (3, 3)."""
    motion: FloatArray
    """Nacelle angle, rate, acceleration now."""
    scheduled: FloatArray
    """Flap deflection of the schedule [rad], shape (1,)."""
    flaps: FloatArray
    """Flap deflection less what the aids reckon with, in each interval between settings [rad]."""
    margins: FloatArray
    """Corridor margins."""
    shown: FloatArray
    """What the airspeed indicator shows [m/s], then the corridor margins that go with it."""
    seen: FloatArray
    """Aircraft state as pilot and aids see it: with the indicated airspeed."""
    target: FloatArray
    """What the pilot is asked for."""
    command: FloatArray
    """Stick, lever, nacelle rate that are to act."""
    hands: FloatArray
    """The pilot's stick and lever, before the aids."""
    pilot: FloatArray
    """Work array of the pilot kernels."""
    asked: FloatArray
    """The pilot's command in a compiled run: stick, lever, nacelle rate."""
    planned: FloatArray
    """Where failed actuators stand after the frame."""
    gust: FloatArray
    """Gust of the next frame in body axes."""
    sensors: FloatArray
    """What the protection law may know."""
    limited: FloatArray
    """Stick, lever, nacelle rate as the law leaves them."""
    law: FloatArray
    """Work array of the law."""
