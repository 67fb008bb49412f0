"""What one frame of the closed loop is made of: its parameters, its state, its work space, and places in them."""

from __future__ import annotations

from typing import NamedTuple

from rtsim.aids.aids_kernels import AidTables
from rtsim.aids.lateral_aids_kernels import LateralAidTables
from rtsim.aircraft.xv15.tables import Configuration, ControlTables
from rtsim.arrays import FloatArray, IntArray
from rtsim.atmosphere.gust_kernels import GustTables
from rtsim.atmosphere.wind_kernels import WindTables
from rtsim.choices import PilotMode
from rtsim.command import CHANNELS
from rtsim.corridor.corridor_kernels import CorridorTables
from rtsim.faults.fault_kernels import FaultTables
from rtsim.kernels.packed import Address
from rtsim.nacelle.automatic_kernels import AutomaticTables
from rtsim.nacelle.nacelle_kernels import NacelleTables
from rtsim.pilot.pilot_kernels import PilotTables
from rtsim.places import Places
from rtsim.protection.law_data import ProtectionTables
from rtsim.systems.drive_kernels import DriveTables
from rtsim.systems.engine_kernels import EngineTables
from rtsim.systems.flap_kernels import FlapTables
from rtsim.systems.ground_kernels import GroundTables

MODE = Places("mocm", "external", "hold")
"""Who flies, as a number in the clock and in the ``pilot_mode`` column."""
MODES: dict[PilotMode, int] = MODE.asdict()  # type: ignore[assignment]  # the names above
"""Pilot modes by name."""
CLOCK = Places("frame", "mode", "distance", "flags", "end", "sink", "faults", "missing")
"""Frame number, who flies, distance flown [m], LPV flags, how the flight ended, sink rate at the end [m/s], whether a
failure was thrown in, part that the coming frame needs and that is not compiled yet (1 + its place in ``PART``; 0
none)."""
REFERENCE = Places(
    "airspeed", "rate", "heading", "turn_rate", "turn_acceleration", "lateral", "lateral_rate", "on_track",
    "line_north", "line_east", "line_course", "line_lateral", "line_lateral_rate", "standing",
)  # fmt: skip
"""The filtered airspeed reference [m/s] and its rate [m/s^2]; heading [rad], turn rate [rad/s] and its rate; lateral
velocity [m/s] and its rate; whether a line over the ground is held (2: the flight turns onto it), one of its points
[m], its course [rad], its own motion to the right [m/s] and the rate of that; whether that point is held along the
line, too."""
END = Places(
    "none", "crash", "attitude", "not_finite", "gentle_landing", "hard_landing", "rotors_slow", "rotors_fast",
    "aground", "bank",
)  # fmt: skip
"""Why a flight ended by itself."""
END_REASONS = {
    END.none: "",
    END.crash: "the aircraft hit the ground, sinking at {sink:.1f} m/s",
    END.aground: "came to grief on the ground: pitch or bank beyond 15 deg, nacelles below 60 deg or faster than 60 kn",
    END.attitude: "control was lost: pitch attitude beyond 80 deg",
    END.bank: "control was lost: bank beyond 120 deg",
    END.not_finite: "the model diverged: a state is no longer a finite number",
    END.gentle_landing: "touched down gently, sinking at {sink:.1f} m/s",
    END.hard_landing: "landed hard, sinking at {sink:.1f} m/s",
    END.rotors_slow: "rotor speed below 80 %: slower than can be flown",
    END.rotors_fast: "rotor speed above 115 %: faster than can be flown",
}
"""The same in words."""
PROGRAMME = Places("time", "airspeed", "nacelle", "altitude", "turn_kind", "turn", "lateral", "track")
"""Rows of the programme."""
MOTION = Places("angle", "rate", "acceleration")
"""The nacelles now [rad, rad/s, rad/s^2]."""
KNOWN = Places(
    "flap", "airspeed_ahead", "airspeed_in_air", "place", "wind", "ground_ahead", "ground_right", "wind_right",
    ("asked", 4),
)  # fmt: skip
"""Flap deflection of the schedule [rad]; airspeed of the programme at the end of the frame, and of the aircraft at its
start, gusts excepted [m/s]; place on the nacelle axis of the database [rad]; wind along the heading, motion over the
ground along it and to the right of it at the start of the frame [m/s]; wind to the right of it [m/s]; what turn and
lateral speed the programme asks for."""
STATION = Places("pilot", "hands", "aided", "protected", "acting")
"""Stations of the command on its way: what the pilot gave; what goes to the aids in its place, within the travel; with
the aids; with the protection; what moves the controls."""
CHANNEL = Places(*CHANNELS)
"""Channels of a command: -1 to 1, 0 to 1, [rad/s], -1 to 1, -1 to 1."""
HELD = Places(*CHANNELS, ("reason", len(CHANNELS)))
"""What laws in Python hold until their next decision (NaN: the channel is the pilot's), and the limits behind it."""
PART = Places(
    "outputs", "step", "ask", "advance", "decide", "aids", "air", "faults", "fail", "failed", "automatic_rate",
    "automatic_advance", "script", "notice", "measure", "ask_lateral", "advance_lateral",
)  # fmt: skip
"""Parts of the frame that are compiled on their own, by their places in ``Flight.parts``: plant (outputs, step), pilot
(ask, advance), law (decide), pilot aids, gusts, failures (schedule; before and after the step), automatic nacelle, and
what a batch hands in: a script (before, after the frame) and a measure of each row."""


class PlantTables(NamedTuple):
    """The aircraft that flies."""

    aircraft: Address
    """Its tables, whatever they are: the parts ``outputs`` and ``step`` know."""
    configuration: Configuration
    """Mass, air, rotor speed, flap."""
    controls: ControlTables
    """Mixing, limits, flap schedule."""
    alpha_speed: float
    """Added along the horizon before an angle of attack is recorded, as for scheduling [m/s]."""
    lateral: int
    """1: it moves out of its plane of symmetry too; 0: lateral stick and pedals do not act on it."""


class ScriptTables(NamedTuple):
    """What scripted hands do besides the pilot, see ``rtsim.loop.script_kernels``."""

    pulses: FloatArray
    """Movements of the controls, shape (pulses, ``PULSE.size``)."""
    reaction: float
    """Time a warning must last until a pilot who yields gives up his plan [s]; negative: he never does."""


class SimulationTables(NamedTuple):
    """Everything the frame reads and never writes."""

    dt: float
    """Length of a frame [s]."""
    wind: WindTables
    """Steady wind."""
    plant: PlantTables
    """The aircraft."""
    nacelle: NacelleTables
    """Conversion actuator."""
    automatic: AutomaticTables
    """Automatic nacelle control; where active, it sets the nacelle rate whoever flies."""
    corridor: CorridorTables
    """Boundaries and levels."""
    pilot: PilotTables
    """The MOCM's gains and references."""
    lateral_noise: int
    """1: its lateral half is noisy."""
    lateral_asked: int
    """1: the programme asks for turns or sideward flight."""
    lateral_pilot: Address
    """Those of its lateral half: the parts ``ask_lateral`` and ``advance_lateral`` know them."""
    flaps: FlapTables
    """What moves the flaps."""
    drive: DriveTables
    """What turns the rotors."""
    ground: GroundTables
    """The ground, and what the aircraft has to meet it."""
    engine: EngineTables
    """Power that the engines have, fuel that they burn."""
    aids: AidTables
    """Schedules of the pilot aids; they act on hands and plug-ins, not on the MOCM, which is designed for the
    bare aircraft, nor on controls that are held."""
    lateral_aids: LateralAidTables
    """The same for the aids out of the plane of symmetry."""
    gusts: GustTables
    """Parameters of gusts and turbulence."""
    faults: FaultTables
    """Failures and their times."""
    protection: ProtectionTables
    """The compiled protection law; it acts after the aids, on what would move the controls."""
    programme: FloatArray
    """Rows ``PROGRAMME`` of the programme's points: time [s], airspeed [m/s], nacelle angle [rad], altitude [m], what
    turning is asked for (``rtsim.programme.TURN``) and its value, lateral airspeed [m/s], whether a line is held."""
    script: ScriptTables
    """Scripted hands."""
    units: FloatArray
    """One unit of each column of the row in SI."""
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
    lateral_pilot: FloatArray
    """State of its lateral half."""
    aids: FloatArray
    """State of the pilot aids."""
    switches: FloatArray
    """Which aids are on."""
    flaps: FloatArray
    """Deflection of the flaps, whether they follow their schedule, and their setting."""
    drive: FloatArray
    """State of the rotor drive, see ``rtsim.systems.drive_kernels``."""
    tank: FloatArray
    """Fuel left and what the tanks hold, ``TANK``."""
    gusts: FloatArray
    """Turbulence filters, gusts that act or are to come, and what acts now."""
    faults: FloatArray
    """Which failures are active."""
    protection: FloatArray
    """State of the protection law."""
    held: FloatArray
    """What laws in Python hold, ``HELD``."""
    script: FloatArray
    """State of the scripted hands."""
    clock: FloatArray
    """Frame number, pilot mode and how the flight stands, ``CLOCK``."""


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
    known: FloatArray
    """What is known of the frame before its command, ``KNOWN``."""
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
    """The command at its stations, shape (``STATION.size``, ``CHANNEL.size``)."""
    pilot: FloatArray
    """Work array of the pilot kernels."""
    lateral_pilot: FloatArray
    """That of its lateral half."""
    wanted: FloatArray
    """What the lateral half is asked for, ``WANTED``."""
    planned: FloatArray
    """Where failed actuators stand after the frame."""
    sensors: FloatArray
    """What the protection law may know."""
    law: FloatArray
    """Work array of the law."""
    si: FloatArray
    """The frame's quantities, SI and radians (``rtsim.frame.QUANTITY``)."""
    row: FloatArray
    """The frame's row: the same in the units of its columns."""


class Flight(NamedTuple):
    """One flight as the compiled frame sees it."""

    tables: SimulationTables
    """What the frame reads."""
    state: SimulationState
    """What it changes."""
    scratch: Scratch
    """Its work space."""
    measures: FloatArray
    """What the part ``measure`` adds to."""
    parts: IntArray
    """Addresses of the compiled parts, ``PART``; 0 where one is not needed, or not yet."""
