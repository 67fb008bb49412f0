"""What a pilot sees, what it commands, and the interfaces of the plug-ins between stick and aircraft."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol, get_args, runtime_checkable

from rtsim.places import Places

UNSAID = float("0")  # an object of its own, which no zero of anybody else is
"""Default of the lateral channels: 0 from a pilot; a law that leaves it there says nothing of the channel."""


@dataclass(frozen=True, slots=True)
class Command:
    """One frame's output of any pilot: MOCM, a person, a recording, or a user's own."""

    stick: float
    """Longitudinal stick, -1 (full aft) to 1 (full forward, nose down); 1 is 4.8 in."""
    lever: float
    """Power lever, 0 (low collective) to 1 (high collective)."""
    nacelle_rate: float
    """Commanded nacelle rate [rad/s]; negative converts towards airplane mode (0 deg)."""
    lateral_stick: float = UNSAID
    """Lateral stick, -1 (left) to 1 (right). A law that does not give it leaves it the pilot's."""
    pedal: float = UNSAID
    """Pedals, -1 (left) to 1 (right: nose right). A law that does not give them leaves them the pilot's."""

    @classmethod
    def given(cls, answer: Any, pilot: Command | None = None) -> Command:
        """A command of plain numbers from what a user's own code answered.

        Args:
            answer: Anything with the fields of a command; the lateral ones may be missing.
            pilot: Whose lateral channels count where the answer does not give them; None: they are 0 then.

        Raises:
            AttributeError: A field is missing.
            TypeError: A field is no number.
            ValueError: The same.
        """
        lateral, pedal = (getattr(answer, name, UNSAID) for name in LATERAL_CHANNELS)
        if pilot is not None:
            lateral = pilot.lateral_stick if lateral is UNSAID else lateral
            pedal = pilot.pedal if pedal is UNSAID else pedal
        return cls(float(answer.stick), float(answer.lever), float(answer.nacelle_rate), float(lateral), float(pedal))

    @property
    def values(self) -> tuple[float, float, float, float, float]:
        """The channels in the order of ``CHANNELS``."""
        return self.stick, self.lever, self.nacelle_rate, self.lateral_stick, self.pedal

    @property
    def finite(self) -> bool:
        """Whether every channel is a finite number."""
        return all(map(math.isfinite, self.values))


Channel = Literal["stick", "lever", "nacelle_rate", "lateral_stick", "pedal"]
CHANNELS: tuple[Channel, ...] = get_args(Channel)
"""Channels of a command, in its order."""
LATERAL_CHANNELS = CHANNELS[3:]
"""Those that move the aircraft out of its plane of symmetry."""


class StickInput(NamedTuple):
    """What a person's sticks say, as received last; a NamedTuple, since the loop makes one in every frame."""

    sequence: int = 0
    """Counts the inputs taken so far; 0 before the first."""
    received_ns: int = 0
    """When it reached this machine, on the scale of ``time.monotonic_ns`` [ns]; 0 before the first."""
    stick: float = 0.0
    """Longitudinal stick, -1 aft to 1 forward, 0 centre."""
    lever: float = 0.0
    """Power lever, 0 to 1, absolute."""
    lateral: float = 0.0
    """Lateral stick, -1 left to 1 right, 0 centre."""
    yaw: float = 0.0
    """Pedals, -1 left to 1 right, 0 centre."""
    stick_valid: bool = False
    """Somebody holds the longitudinal stick (a released channel is nobody's)."""
    lever_valid: bool = False
    """Somebody holds the power lever."""
    nacelle_switch: int = 0
    """Nacelle switch: -1 forward (airplane), 0 let go or both pressed, 1 aft (helicopter)."""
    nacelle_angle: float = float("nan")
    """Absolute nacelle angle asked for by an axis [rad]; NaN where no axis asks."""
    trim: int = 0
    """Stick trim: -1 aft, 0 let go or both pressed, 1 forward."""
    buttons: int = 0
    """Buttons held, one bit each."""
    owner: int = 0
    """Who holds the sticks: 256 * MAVLink system id + component id; 0 nobody."""
    stream: int = 0
    """When these inputs began, or began anew [ns]; another value means another hand, or one that was away."""
    overridden: int = 0
    """What a second source of the same hand has taken from the first: 1 the stick, 2 the lever, 4 the nacelle angle,
    8 the lateral stick, 16 the pedals."""
    lateral_valid: bool = False
    """Somebody holds the lateral stick."""
    yaw_valid: bool = False
    """Somebody has the feet on the pedals."""
    lateral_trim: int = 0
    """Lateral stick trim: -1 left, 0 let go or both pressed, 1 right."""

    @property
    def held(self) -> bool:
        """Somebody holds any of the controls."""
        return self.stick_valid or self.lever_valid or self.lateral_valid or self.yaw_valid


@dataclass(frozen=True, slots=True)
class Sensors:
    """What pilots, nacelle laws and protection laws may know of the aircraft. SI and radians."""

    time: float
    """Time since frame 0 [s]."""
    airspeed: float
    """Airspeed along the flight, signed: negative in rearward flight [m/s]."""
    airspeed_rate: float
    """Rate of the airspeed [m/s^2]."""
    nacelle_angle: float
    """Nacelle angle, pi/2 helicopter, 0 airplane [rad]."""
    nacelle_rate: float
    """Rate of the nacelle angle [rad/s]."""
    pitch: float
    """Pitch attitude, nose up positive [rad]."""
    pitch_rate: float
    """Body pitch rate [rad/s]."""
    flight_path_angle: float
    """Angle of the air-relative flight path above the horizon [rad]."""
    altitude: float
    """Height above the ground [m]."""
    climb_rate: float
    """Vertical speed, up positive [m/s]."""
    load_factor: float
    """Normal load factor, 1 in level flight [-]."""
    mast_torque: float
    """Torque of one mast [N m]."""
    flapping: float
    """Magnitude of the cyclic (gimbal) flapping relative to the mast [rad]."""
    on_downstop: bool
    """The nacelles rest on the airplane-mode stop."""
    nacelle_ok: bool
    """The conversion actuator follows its commands."""
    bank: float = 0.0
    """Bank angle, right positive [rad]."""
    roll_rate: float = 0.0
    """Body roll rate, right positive [rad/s]."""
    yaw_rate: float = 0.0
    """Body yaw rate, nose right positive [rad/s]."""
    heading: float = 0.0
    """Heading, clockwise from north, 0 to 2 pi [rad]."""
    sideslip: float = 0.0
    """Sideslip with gusts, wind from the right positive: atan2(v, sqrt(u^2 + w^2 + V0^2)), V0 as for scheduling,
    4.5 m/s: defined in hover too [rad]."""
    lateral_velocity: float = 0.0
    """Sideways airspeed in the horizontal plane, right positive [m/s]."""
    lateral_acceleration: float = 0.0
    """Specific force along body y over g, right positive [-]."""
    north: float = 0.0
    """Place north of the start [m]."""
    east: float = 0.0
    """Place east of the start [m]."""
    flapping_left: float = 0.0
    """Magnitude of the left rotor's flapping relative to its mast [rad]."""
    flapping_right: float = 0.0
    """The same of the right rotor [rad]."""
    mast_torque_left: float = 0.0
    """Torque of the left mast [N m]."""
    mast_torque_right: float = 0.0
    """Torque of the right mast [N m]."""


SENSOR = Places(*Sensors.__slots__)
"""Places of the sensor values in an array, SI and radians, booleans as 0 and 1."""


@dataclass(frozen=True, slots=True)
class Reference:
    """What the flight is meant to do now, for a pilot that follows a programme. SI and radians."""

    airspeed: float
    """Filtered airspeed reference [m/s]."""
    airspeed_rate: float
    """Its rate [m/s^2]."""
    nacelle_angle: float
    """Unfiltered nacelle angle of the programme [rad]."""
    nacelle_rate: float
    """Rate of the programme's nacelle angle over the coming frame [rad/s]."""
    altitude: float
    """Altitude to hold [m]."""
    heading: float = 0.0
    """Heading to hold, clockwise from north [rad]."""
    bank: float = 0.0
    """Bank angle, right positive [rad]."""
    lateral_velocity: float = 0.0
    """Sideways airspeed, right positive [m/s]."""
    north: float = 0.0
    """Place north of the start [m]."""
    east: float = 0.0
    """Place east of the start [m]."""


@dataclass(frozen=True, slots=True)
class Margins:
    """Distances to the limits at this frame; positive inside."""

    low: float
    """Airspeed above the low-speed boundary at this nacelle angle [m/s]."""
    high: float
    """Airspeed below the high-speed boundary at this nacelle angle [m/s]."""
    nacelle_forward: float
    """Nacelle travel towards airplane mode before a boundary is met, at this airspeed [rad]."""
    nacelle_aft: float
    """Nacelle travel towards helicopter mode before a boundary is met, at this airspeed [rad]."""


@dataclass(frozen=True, slots=True)
class Intervention:
    """One thing a protection law did in one frame, and why."""

    limit: str
    """The limit that asked for it, as named in docs/protection.md."""
    channel: Channel
    """The channel it acted on."""
    kind: Literal["warn", "limit", "reverse", "blend", "clip"]
    """How it acted."""
    before: float
    """The pilot's value, in the unit of the channel."""
    after: float
    """The limited value, in the unit of the channel."""
    margin: float
    """Margin to the limit when it acted, in the limit's unit."""
    time_to_limit: float
    """Predicted time until the limit is met [s]; infinite where it is not approached."""


@runtime_checkable
class Pilot(Protocol):
    """A pilot of the user's own, loaded by ``MODULE:CLASS``; deterministic, sees sensor values only."""

    def step(self, sensors: Sensors, reference: Reference, dt: float) -> Command:
        """Give this frame's command.

        Args:
            reference: What the scenario asks for.
        """
        ...


@runtime_checkable
class NacelleLaw(Protocol):
    """Automatic nacelle control: turns sensor values into a nacelle rate."""

    def step(self, sensors: Sensors, command: Command, dt: float) -> float:
        """Give this frame's nacelle rate [rad/s].

        Args:
            command: The pilot's command of this frame.
        """
        ...


@runtime_checkable
class ProtectionLaw(Protocol):
    """Envelope protection: limits the pilot's command and says what it did."""

    def step(
        self, sensors: Sensors, command: Command, margins: Margins, dt: float
    ) -> tuple[Command, list[Intervention]]:
        """Give the limited command and the interventions of this frame.

        Args:
            command: The pilot's command of this frame.
            margins: Distances to the corridor boundaries.
        """
        ...
