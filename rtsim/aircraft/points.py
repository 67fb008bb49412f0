"""What a flight condition is, and what trimming and linearizing at one give."""

from __future__ import annotations

from dataclasses import dataclass

from rtsim.arrays import FloatArray
from rtsim.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """A flight condition to trim or linearize at. SI and radians; None keeps the default."""

    airspeed: float
    """Horizontal airspeed, signed [m/s]."""
    nacelle_angle: float
    """Nacelle angle, pi/2 helicopter [rad]."""
    acceleration: float = 0.0
    """Acceleration along the level flight path [m/s^2]."""
    flap: float | None = None
    """Flap deflection [rad]; None: the flap schedule."""
    rotor_speed: float | None = None
    """Rotor speed [rad/s]; None: 589 rpm."""
    mass: float | None = None
    """Mass [kg]; None: the aircraft's own."""
    pressure_altitude: float | None = None
    """Height in the standard atmosphere [m]; None: the aircraft's own air."""
    load_factor: float = 1.0
    """Weight that the aircraft carries in straight flight over its own: the air loads of a turn, without its rates."""
    bank: float = 0.0
    """Bank angle of a coordinated level turn, right positive [rad]."""
    sideslip: float = 0.0
    """Sideslip in straight flight, wind from the right positive [rad]; ``airspeed`` is then the whole one."""
    lateral_airspeed: float = 0.0
    """Horizontal airspeed to the right, across the heading [m/s]."""

    def __post_init__(self) -> None:
        """Refuse what excludes itself."""
        if sum(value != 0.0 for value in (self.bank, self.sideslip, self.lateral_airspeed)) > 1:
            raise InputError(
                "more than one of them", key="bank, sideslip, lateral_airspeed", mend="ask for one of them"
            )

    @property
    def symmetric(self) -> bool:
        """Whether nothing moves out of the plane of symmetry."""
        return self.bank == 0.0 and self.sideslip == 0.0 and self.lateral_airspeed == 0.0


@dataclass(frozen=True, slots=True)
class TrimPoint:
    """A steady (or steadily accelerating) level flight condition."""

    x: FloatArray
    """State; altitude 0."""
    u: FloatArray
    """Inputs; nacelle motion and gusts 0."""
    y: FloatArray
    """Outputs."""
    xdot: FloatArray
    """State derivative: zero, or the steady acceleration in body axes."""
    converged: bool
    """The residuals closed."""
    residual: float
    """Largest residual, accelerations in m/s^2 and rad/s^2."""
    unclosed: str = ""
    """Name of the state whose rate did not close (``elevator``: the stick would pass its stop) or of a control that
    would pass its stop, or in words what ends the validity; empty if converged."""


@dataclass(frozen=True, slots=True)
class LinearModel:
    """Jacobians of the whole nonlinear model, gravity and Coriolis terms included."""

    A: FloatArray
    """State matrix."""
    B: FloatArray
    """Input matrix."""
    C: FloatArray
    """Output matrix."""
    D: FloatArray
    """Feed-through."""
    df_dnacelle: FloatArray
    """Derivative of the state derivative with nacelle angle."""


@dataclass(frozen=True, slots=True)
class LateralModel:
    """Jacobians out of the plane of symmetry at a symmetric state, gravity and Coriolis terms included."""

    A: FloatArray
    """State matrix, order of ``variables.LATERAL_STATES``."""
    B: FloatArray
    """Input matrix, order of ``variables.LATERAL_INPUTS``."""
    C: FloatArray
    """Output matrix, order of ``variables.LATERAL_OUTPUTS``."""
    D: FloatArray
    """Feed-through."""
