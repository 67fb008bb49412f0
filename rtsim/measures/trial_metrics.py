"""What a trial of envelope protection is measured by: names, units, meaning, and the limits behind them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from rtsim.arrays import BoolArray, FloatArray

TRIAL_METRICS: dict[str, str] = {
    "exceedances": "corridor exceedances: margin below -0.5 kn for 0.1 s, those within 0.5 s merged",
    "depth_kt": "deepest airspeed outside the corridor [kn]",
    "time_outside_s": "time with a corridor margin below -0.5 kn [s]",
    "area_kt_s": "integral of the airspeed outside the corridor [kn s]",
    "worst_margin_kt": "least corridor margin, negative outside [kn]",
    "height_lost_m": "largest height below the altitude to hold [m]",
    "height_gained_m": "largest height above the altitude to hold [m]",
    "flapping_peak_deg": "largest flapping [deg]",
    "flapping_over_s": "time with flapping beyond its stop of 12 deg [s]",
    "torque_ratio_peak": "largest mast torque as a share of its limit [-]",
    "torque_over_s": "time with mast torque above 1.02 of its limit [s]",
    "load_factor_max": "largest load factor [-]",
    "load_factor_min": "smallest load factor [-]",
    "pitch_peak_deg": "largest pitch attitude, up or down [deg]",
    "corridor_activations": "times the law acted for the corridor's sake, those within 0.5 s merged",
    "corridor_active_s": "time the law acted for the corridor's sake [s]",
    "other_active_s": "time the law acted for another limit (torque, flapping, pitch, sink) [s]",
    "stick_authority_rms": "RMS of what the law added to the stick [-1..1]",
    "lever_authority_rms": "RMS of what the law added to the lever [0..1]",
    "nacelle_removed_deg": "nacelle motion the law took from or added to what was asked [deg]",
    "stick_step_max": "largest change of the law's share of the stick from frame to frame [-1..1]",
    "lever_step_max": "largest change of the law's share of the lever from frame to frame [0..1]",
    "completed": "1 where the flight was flown to its end, 0 where it ended by itself",
    "yielded": "1 where the pilot gave up his plan",
    "arrival_s": "time at which airspeed and nacelles are where the programme ends, to stay [s]",
    "airspeed_final_kt": "airspeed of the last frame [kn]",
    "nacelle_final_deg": "nacelle angle of the last frame [deg]",
    "flown_s": "length of the flight as flown [s]",
    "conversion_s": "time at which nacelles and airspeed are where the programme's nacelle motion ends [s]",
}
"""Metrics of a trial by name, in the order of the kernels."""
METRIC_PLACE: dict[str, int] = {name: place for place, name in enumerate(TRIAL_METRICS)}
"""Place of each metric in the kernels' array."""

SECONDARY_LIMITS = ("flapping", "torque", "load_factor", "pitch", "control")
"""Limits besides the corridor, by name: 12 deg of flapping, 1.02 of the torque limit, load factor -0.5 to 3, 25 deg of
pitch, and keeping control to the end."""
LEAVABLE = ("corridor", *SECONDARY_LIMITS, "height")
"""What an unprotected flight can be expected to violate."""
VACUOUS_HEIGHT = 30.0
"""Height loss that counts as a violation of ``height`` [m]."""
TORQUE_EXCESS = 1.02
"""Share of the torque limit above which it counts as exceeded [-]."""


@dataclass(frozen=True, slots=True)
class TrialMetrics(Mapping[str, float]):
    """The numbers of one trial flight, by name."""

    values: FloatArray  # type: ignore[assignment]  # the array, where a mapping has a view of its values
    """In the order of ``TRIAL_METRICS``."""

    def __getitem__(self, name: str) -> float:
        """One metric.

        Args:
            name: One of ``TRIAL_METRICS``.
        """
        return float(self.values[METRIC_PLACE[name]])

    def __iter__(self) -> Iterator[str]:
        return iter(TRIAL_METRICS)

    def __len__(self) -> int:
        return len(TRIAL_METRICS)

    @property
    def exceeded(self) -> frozenset[str]:
        """What the flight violated, out of ``LEAVABLE``."""
        found = violations(self.values[None, :])
        return frozenset(name for name, violated in found.items() if violated[0])


LOAD_FACTOR_RANGE = (-0.5, 3.0)
"""Load factors that are allowed (rtsim/aircraft/xv15/data/protection.toml) [-]."""
PITCH_LIMIT_DEG = 25.0
"""Pitch attitude that is allowed, either way (the same file) [deg]."""


def violations(values: FloatArray) -> dict[str, BoolArray]:
    """What flights violated, by name out of ``LEAVABLE``, shape (flights,) each.

    Args:
        values: Metrics, shape (flights, METRIC_COUNT).
    """

    def column(name: str) -> FloatArray:
        return values[:, METRIC_PLACE[name]]

    return {
        "corridor": column("exceedances") > 0.0,
        "flapping": column("flapping_over_s") > 0.0,
        "torque": column("torque_over_s") > 0.0,
        "load_factor": (column("load_factor_max") > LOAD_FACTOR_RANGE[1])
        | (column("load_factor_min") < LOAD_FACTOR_RANGE[0]),
        "pitch": column("pitch_peak_deg") > PITCH_LIMIT_DEG,
        "control": column("completed") == 0.0,
        "height": column("height_lost_m") > VACUOUS_HEIGHT,
    }
