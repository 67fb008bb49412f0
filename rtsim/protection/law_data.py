"""What the compiled laws are made of: places in their arrays, reasons, and the tuples of their numbers."""

from __future__ import annotations

from typing import NamedTuple

from rtsim.places import Places
from rtsim.protection.prediction_kernels import CELL, OUT, BoundaryTables, ModelTables

LAW_OFF, LAW_MONITOR, LAW_GOVERNOR, LAW_FULL = 0, 1, 2, 3

# Reasons, as recorded: 0 none, else one more than the number of the limit in rtsim.protection.limits.LIMIT_KINDS.
REASON_NONE, REASON_LOW, REASON_HIGH, REASON_GATE = 0, 1, 2, 3
REASON_FLAP, REASON_TORQUE, REASON_LOAD, REASON_PITCH, REASON_SINK = 6, 7, 8, 9, 11
REASON_BANK, REASON_SIDESLIP = 15, 16

LAW = Places(
    "blend",  # what is allowed now ...
    "stick",
    "lever",
    "stick_low",
    "stick_high",
    "lever_low",
    "lever_high",
    "rate_low",
    "rate_high",
    "blend_reason",
    "stick_low_reason",
    "stick_high_reason",
    "lever_reason",
    "rate_reason",
    "lateral_low",
    "lateral_high",
    "pedal_low",
    "pedal_high",
    "lateral_low_reason",
    "lateral_high_reason",
    "pedal_reason",
    "time",  # time to the corridor's boundary with the controls as they are [s]
    "side",  # its side: -1 low, 1 high, 0 none
    "margin",  # least margin predicted with the pilot's controls [m/s]
    "acted",  # ... what acted last, set by law_apply ...
    "acted_stick",
    "acted_lever",
    "acted_rate",
    "acted_lateral",
    "acted_pedal",
    "stick_cause",  # reason for the change of each channel in this frame; 0 where there was none
    "lever_cause",
    "rate_cause",
    "lateral_cause",
    "pedal_cause",
    "started",  # ... and memory from one decision to the next
    "bias",
    "last_nacelle_rate",
    "last_torque",
    "torque_rate",
    "collective",
    "flap_bias",
    "last_roll_rate",
    "roll_bias",
    "last_yaw_rate",
    "yaw_bias",
    "differential_collective",  # lateral stick as the collectives follow it
    "even_lever",  # lever when the aircraft last rolled as the model does
    "recover_side",
    "override",  # 1: the pilot has switched the law's authority off
    "shift",  # place on the database's nacelle axis less the nacelle angle: below 0 while the rotors are slow [rad]
    "kind",  # how the nacelle rate was limited: 0 limit, 1 reverse
)
"""Places in the law's state."""
# ... what acted last, set by law_apply ...
# ... and memory from one decision to the next.

CAUSES = (LAW.stick_cause, LAW.lever_cause, LAW.rate_cause, LAW.lateral_cause, LAW.pedal_cause)
"""Places of the reasons for the changes, in the order of a command's channels."""
FREE = 1e9
"""A bound that bounds nothing."""
CHANGE_STICK, CHANGE_LEVER, CHANGE_RATE = 1e-4, 1e-4, 1e-5
"""Changes smaller than these are rounding, not interventions; sticks and pedals, lever, nacelles [-, -, rad/s]."""

WORK_SIZE = 2 * CELL.size + OUT.size
"""Length of the scratch array of the laws."""


class LawSettings(NamedTuple):
    """Numbers of the laws, from ``data/protection.toml``. SI and radians."""

    period: float
    """Time between decisions [s]."""
    horizon: float
    """How far the laws look ahead [s]."""
    step: float
    """Step of that prediction [s]."""
    warning_horizon: float
    """How far the time to limit looks ahead [s]."""
    warning_step: float
    """Step of that prediction [s]."""
    bias_filter: float
    """Time constant with which the model's missing acceleration is learned [s]."""
    bias_decay: float
    """Time constant with which it is taken to die away [s]."""
    bias_limit: float
    """Largest missing acceleration taken into account [m/s^2]."""
    reverse_margin: float
    """Governor: predicted margin below which the nacelles are turned back [m/s]."""
    pass_margin: float
    """Governor: predicted margin with which a rate passes [m/s]."""
    apply: float
    """Governor: how long a rate is tried before the nacelles are stopped [s]."""
    reverse_rate: float
    """Governor: fastest rate at which the nacelles are turned back [rad/s]."""
    flat_high_nacelle: float
    """Governor: below this angle nacelle motion does not move the high-speed side [rad]."""
    finish_nacelle: float
    """Governor: from here forward the nacelles are run on to the downstop [rad]."""
    blend_begin: float
    """Full: predicted margin below which the recovery blends in [m/s]."""
    blend_full: float
    """Full: predicted margin at which it has taken over [m/s]."""
    blend_rise: float
    """Full: fastest growth of the blend [1/s]."""
    blend_fall: float
    """Full: fastest decay of the blend [1/s]."""
    recovery_margin: float
    """Full: margin the recovery aims at [m/s]."""
    recovery_step: float
    """Full: largest change of airspeed the recovery aims at [m/s]."""
    height_floor: float
    """Full: below this height stick and lever are not taken from the pilot [m]."""
    height_full: float
    """Full: from this height on they may be taken in full [m]."""
    sink_slope: float
    """Full: sine of the steepest descent the recovery may use."""
    sink_floor: float
    """Full: sink rate always allowed to the recovery [m/s]."""
    flapping: float
    """Full: flapping kept to [rad]."""
    torque_share: float
    """Full: share of the torque limit kept to."""
    torque_lead: float
    """Full: how far the torque is extrapolated [s]."""
    collective_lag: float
    """Full: time constant of the collective actuator [s]."""
    pitch: float
    """Full: pitch attitude kept to [rad]."""
    pitch_frequency: float
    """Full: how sharply pitch may approach it [rad/s]."""
    load_factor_max: float
    """Full: largest load factor kept to."""
    load_factor_min: float
    """Full: smallest load factor kept to."""
    load_frequency: float
    """Full: how sharply the pitch rate may approach theirs [rad/s]."""
    turn_lead: float
    """How far ahead the bank is taken to grow as it does, for the corridor of the turn [s]."""
    turn_margin: float
    """Full: corridor margin that a turn must leave [m/s]."""
    turn_time: float
    """Full: how far ahead that margin is taken to shrink as it does [s]."""
    bank_least: float
    """Full: bank that is always allowed [rad]."""
    bank_buffer: float
    """Full: distance kept from the limit of bank [rad]."""
    bank_frequency: float
    """Full: how sharply bank may approach what is allowed [rad/s]."""
    sideslip_buffer: float
    """Full: distance kept from the limit of sideslip [m/s]."""
    sideslip_frequency: float
    """Full: how sharply sideslip may approach it [rad/s]."""
    drift_time: float
    """Full: time in which sideward flight may come to its limit [s]."""
    even_roll: float
    """Full: missed rolling acceleration up to which both sides are taken to act alike [rad/s^2]."""
    uneven_roll: float
    """Full: missed rolling acceleration from which the lever goes back to where they did [rad/s^2]."""
    uneven_lever: float
    """Full: how far the lever may be from there."""
    twist_share: float
    """Full: torque of one mast over that of both in the mean that is always left, as a share of the limit."""
    differential_lag: float
    """Full: time constant of the differential collective [s]."""
    roll_filter: float
    """Full: time constant with which the rolling and yawing that the model misses are learned [s]."""


class TorqueTables(NamedTuple):
    """The mast-torque limit. SI and radians."""

    cruise: float
    """Limit in conversion and airplane mode [N m]."""
    takeoff: float
    """Limit in helicopter mode at low speed [N m]."""
    takeoff_nacelle: float
    """Nacelle angle above which the latter holds [rad]."""
    takeoff_airspeed: float
    """Airspeed below which it holds [m/s]."""


class SinkTables(NamedTuple):
    """The sink rate a pilot may fly. SI and radians."""

    floor: float
    """Sink rate always allowed [m/s]."""
    slope: float
    """Sine of the descent angle always allowed."""
    height: float
    """Height above which more is allowed [m]."""
    time: float
    """Height above that, per sink rate allowed besides [s]."""


class SidewaysLimits(NamedTuple):
    """The limits out of the plane of symmetry. SI and radians; infinite where an aircraft's data name none."""

    bank: float
    """Bank allowed up to ``bank_nacelle`` [rad]."""
    bank_helicopter: float
    """Bank allowed in helicopter mode, linear between [rad]."""
    bank_nacelle: float
    """Nacelle angle up to which the former holds [rad]."""
    slow: float
    """Sideward airspeed allowed in slow flight [m/s]."""
    fast: float
    """Sideward airspeed allowed in fast flight, linear between [m/s]."""
    slow_below: float
    """Airspeed up to which the former holds [m/s]."""
    fast_above: float
    """Airspeed from which the latter holds [m/s]."""


class ProtectionTables(NamedTuple):
    """One compiled law; read-only."""

    law: int
    """``LAW_*``."""
    every: int
    """Frames from one decision to the next."""
    model: ModelTables
    """The aircraft as the law knows it."""
    corridor: BoundaryTables
    """The boundaries it keeps to."""
    torque: TorqueTables
    """The torque it keeps to."""
    sink: SinkTables
    """The sink rate it keeps to."""
    sideways: SidewaysLimits
    """The bank and the sideslip it keeps to."""
    settings: LawSettings
    """Its numbers."""
