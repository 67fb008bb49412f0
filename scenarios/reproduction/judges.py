"""One judge per claim: from the evidence to numbers, and whether the claim holds.

A judge gives every number that the claim's texts in ``data/claims.toml`` name; the limits stand there too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from rtsim.optimization.paths import TABLE_1
from scenarios.reproduction.evidence import Evidence, Number, centre_line_demand
from scenarios.reproduction.measures import table_1_times

Finding = tuple[bool, dict[str, Number]]
"""Whether the claim holds, and what was measured."""
Limits = Mapping[str, Any]
"""The claim's ``expected`` table."""
Judge = Callable[[Evidence, Limits], Finding]

PRINTED_TIMES = (0.0, 8.0, 13.3, 20.3, 26.6, 34.9, 41.2, 57.9, 61.9, 65.9)
"""Time row of the paper's Table 1 [s]."""
_PAPER_PATHS = ("typical", "centre_line", "centre_line_variable", "near_stall", "fast_side")


def _near(value: float, target: float, tolerance: float) -> bool:
    return math.isfinite(value) and abs(value - target) <= tolerance


def _table1_timing(evidence: Evidence, limits: Limits) -> Finding:  # noqa: ARG001
    difference = float(np.abs(table_1_times() - np.array(PRINTED_TIMES)).max())
    return difference <= limits["largest_difference_s"], {"largest_difference_s": difference}


def _table1_equation_5(evidence: Evidence, limits: Limits) -> Finding:  # noqa: ARG001
    alone, printed = np.diff(table_1_times(rule="nacelle"))[:-1], np.diff(PRINTED_TIMES)
    # The last printed segment is the final hold, in which nothing moves: equation 5 gives it no time either.
    agree = int(np.count_nonzero(np.abs(np.append(alone, 0.0) - printed) <= 0.15))
    return agree == limits["segments_that_agree"], {
        "segments_that_agree": float(agree),
        "first_segment_s": float(alone[0]),
    }


def _table1_cap_50_kn(evidence: Evidence, limits: Limits) -> Finding:  # noqa: ARG001
    points, times = np.array(TABLE_1), np.array(PRINTED_TIMES[:9])
    acceleration = np.diff(points[:, 0]) / np.diff(times)
    first = int(np.argmax(acceleration > 3.0 * 1.05))
    ends_at = points[first]
    return _near(float(ends_at[0]), limits["cap_ends_at_kt"], limits["tolerance_kt"]), {
        "cap_ends_at_kt": float(ends_at[0]),
        "cap_ends_at_deg": float(ends_at[1]),
        "undeclared_acceleration_kt_s": float(acceleration[first]),
    }


def _table1_170_kn_at_60_s(evidence: Evidence, limits: Limits) -> Finding:
    flight = evidence.measures["typical"]
    return flight.completed and _near(flight.time_to_170_kt_s, limits["time_to_170_kt_s"], limits["tolerance_s"]), {
        "time_to_170_kt_s": flight.time_to_170_kt_s,
        "time_to_airplane_s": flight.time_to_airplane_s,
    }


def _fig1_corridor(evidence: Evidence, limits: Limits) -> Finding:
    found = dict(evidence.facts["fig1_corridor"])
    worst = max(float(found["low_difference_kt"]), float(found["high_difference_kt"]))
    return worst <= limits["tolerance_kt"], found


def _grid(name: str) -> Judge:
    def judge(evidence: Evidence, limits: Limits) -> Finding:
        found = dict(evidence.facts[name])
        return float(found["largest_error"]) <= limits["largest_error"], found

    return judge


def _fig3_pilot(evidence: Evidence, limits: Limits) -> Finding:
    flight = evidence.measures["typical"]
    deviation = flight.metrics.altitude_m.max_deviation
    return flight.completed and deviation <= limits["altitude_deviation_m"], {
        "altitude_deviation_m": deviation,
        "airspeed_rms_kt": flight.metrics.airspeed_kt.rms_error,
    }


def _fig4_path(evidence: Evidence, limits: Limits) -> Finding:
    flight = evidence.measures["typical"]
    found: dict[str, Number] = {
        "airspeed_max_error_kt": flight.metrics.airspeed_kt.max_error,
        "nacelle_max_error_deg": flight.metrics.nacelle_deg.max_error,
        "margin_design_kt": flight.metrics.corridor.worst_margin_kt,
        "margin_flight_kt": flight.margin_flight_kt,
        "corridor_position": flight.corridor_position,
    }
    close = all(float(found[key]) <= limits[key] for key in ("airspeed_max_error_kt", "nacelle_max_error_deg"))
    return flight.completed and close and float(found["margin_design_kt"]) >= limits["margin_design_kt"], found


def _fig4_least_integral(evidence: Evidence, limits: Limits) -> Finding:
    found: dict[str, Number] = {}
    for name in _PAPER_PATHS:
        flight = evidence.measures[name]
        found[f"{name}_deg_s"] = flight.metrics.flapping_deg.integral_deg_s
        found[f"{name}_mean_deg"] = flight.metrics.flapping_deg.integral_deg_s / flight.duration_s
    best = min(_PAPER_PATHS, key=lambda name: float(found[f"{name}_deg_s"]))
    found["best_path"] = best
    for name in ("near_stall_table_1_caps", "fast_side_table_1_caps"):
        found[f"{name}_deg_s"] = evidence.measures[name].metrics.flapping_deg.integral_deg_s
    for key in ("ridge_90_deg", "ridge_90_kt", "ridge_75_deg", "ridge_75_kt"):
        found[key] = evidence.facts["fig6_map"][key]
    return best == limits["best_path"], found


def _fig5_early_peak(evidence: Evidence, limits: Limits) -> Finding:
    flight = evidence.measures["typical"]
    late = flight.metrics.flapping_deg.peak_after_30_s
    share = flight.trim_peak_deg / flight.early_peak_deg
    begin, end = limits["early_peak_time_s"]
    holds = (
        _near(flight.early_peak_deg, limits["early_peak_deg"], limits["tolerance_deg"])
        and begin <= flight.early_peak_time_s <= end
        and late is not None
        and late <= limits["peak_after_30_s_deg"]
        and limits["trim_share"] <= share <= 2.0 - limits["trim_share"]
    )
    return flight.completed and holds, {
        "early_peak_deg": flight.early_peak_deg,
        "early_peak_time_s": flight.early_peak_time_s,
        "peak_after_30_s_deg": late if late is not None else math.nan,
        "trim_peak_deg": flight.trim_peak_deg,
        "level_trim_peak_deg": flight.level_trim_peak_deg,
        "trim_share": share,
        "trim_correlation": flight.trim_correlation,
    }


def _fig6_map(evidence: Evidence, limits: Limits) -> Finding:
    found = dict(evidence.facts["fig6_map"])
    holds = (
        _near(float(found["ridge_90_kt"]), limits["ridge_90_kt"], limits["tolerance_kt"])
        and found["stall_side_ridges"] is limits["stall_side_ridges"]
        and float(found["valley_position"]) >= limits["valley_position"]
    )
    return holds, found


def _fig7_fast_side(evidence: Evidence, limits: Limits) -> Finding:
    position = {name: evidence.measures[name].corridor_position for name in _PAPER_PATHS}
    holds = position["fast_side"] >= limits["position"] and position["fast_side"] == max(position.values())
    return holds, {
        "position": position["fast_side"],
        "typical_position": position["typical"],
        "centre_position": position["centre_line"],
        "near_stall_position": position["near_stall"],
    }


def _fig8_worse(evidence: Evidence, limits: Limits) -> Finding:
    flight, typical = evidence.measures["fast_side"], evidence.measures["typical"]
    fast = evidence.measures["fast_side_table_1_caps"]
    integral, typical_integral = (one.metrics.flapping_deg.integral_deg_s for one in (flight, typical))
    holds = (
        integral > limits["integral_over_typical"] * typical_integral
        and flight.time_high_s > limits["time_high_over_typical"] * typical.time_high_s
    )
    return flight.completed and holds, {
        "integral_deg_s": integral,
        "typical_integral_deg_s": typical_integral,
        "time_high_s": flight.time_high_s,
        "typical_time_high_s": typical.time_high_s,
        "peak_deg": flight.metrics.flapping_deg.peak,
        "typical_peak_deg": typical.metrics.flapping_deg.peak,
        "fast_integral_deg_s": fast.metrics.flapping_deg.integral_deg_s,
        "fast_peak_deg": fast.metrics.flapping_deg.peak,
        **evidence.facts["fig8_worse"],
        "fast_end": "" if fast.completed else f" (not flown to its end: {fast.end_reason})",
    }


def _fig10_larger_oscillation(evidence: Evidence, limits: Limits) -> Finding:
    slow, fast = evidence.measures["typical_3deg"], evidence.measures["typical_8deg"]
    ratio = fast.oscillation_rms_deg / slow.oscillation_rms_deg
    shift = abs(fast.early_peak_time_s - slow.early_peak_time_s)
    return fast.completed and ratio >= limits["ratio"] and shift <= limits["peak_time_difference_s"], {
        "oscillation_8_deg": fast.oscillation_rms_deg,
        "oscillation_3_deg": slow.oscillation_rms_deg,
        "oscillation_peak_8_deg": fast.oscillation_peak_deg,
        "oscillation_peak_3_deg": slow.oscillation_peak_deg,
        "ratio": ratio,
        "peak_8_deg": fast.early_peak_deg,
        "peak_3_deg": slow.early_peak_deg,
        "peak_time_8_s": fast.early_peak_time_s,
        "peak_time_3_s": slow.early_peak_time_s,
        "time_saved_s": slow.time_to_170_kt_s - fast.time_to_170_kt_s,
    }


def _fig12_collective_falls(evidence: Evidence, limits: Limits) -> Finding:
    flight, typical = evidence.measures["near_stall"], evidence.measures["typical_3deg"]
    least = max(flight.collective_rise_deg, 0.02)
    holds = (
        flight.collective_rise_deg <= limits["rise_deg"]
        and flight.collective_fall_deg > 0.5
        and typical.collective_rise_deg >= limits["typical_rise_over_rise"] * least
    )
    return flight.completed and holds, {
        "rise_deg": flight.collective_rise_deg,
        "fall_deg": flight.collective_fall_deg,
        "typical_rise_deg": typical.collective_rise_deg,
        "typical_fall_deg": typical.collective_fall_deg,
        "spread_rise_deg": evidence.measures["typical"].collective_rise_deg,
        "falls_until_s": flight.collective_falls_until_s,
        "typical_falls_until_s": typical.collective_falls_until_s,
        "spread_falls_until_s": evidence.measures["typical"].collective_falls_until_s,
        "hasty_falls_until_s": evidence.measures["near_stall_table_1_caps"].collective_falls_until_s,
    }


def _fig14_small_acceleration(evidence: Evidence, limits: Limits) -> Finding:
    flight = evidence.measures["centre_line"]
    acceleration = flight.centre_acceleration_kt_s
    return flight.completed and _near(acceleration, limits["acceleration_kt_s"], limits["tolerance_kt_s"]), {
        "acceleration_kt_s": acceleration,
        "typical_cap_share": acceleration / 3.0,
    }


def _fig14_similar_frequency(evidence: Evidence, limits: Limits) -> Finding:
    flight, typical = evidence.measures["centre_line"], evidence.measures["typical_3deg"]
    stick = flight.stick_frequency_hz / typical.stick_frequency_hz
    lever = flight.lever_frequency_hz / typical.lever_frequency_hz
    holds = all(
        limits[key][0] <= ratio <= limits[key][1] for key, ratio in (("stick_ratio", stick), ("lever_ratio", lever))
    )
    return holds, {
        "stick_hz": flight.stick_frequency_hz,
        "typical_stick_hz": typical.stick_frequency_hz,
        "stick_ratio": stick,
        "lever_hz": flight.lever_frequency_hz,
        "typical_lever_hz": typical.lever_frequency_hz,
        "lever_ratio": lever,
        "fast_stick_hz": evidence.measures["typical_8deg"].stick_frequency_hz,
        "variable_stick_hz": evidence.measures["centre_line_variable"].stick_frequency_hz,
    }


def _fig16_max_rate(evidence: Evidence, limits: Limits) -> Finding:
    flight = evidence.measures["centre_line_variable"]
    rate, fast = flight.metrics.nacelle_deg.max_rate_deg_s, flight.time_fast_s
    holds = _near(rate, limits["rate_deg_s"], limits["tolerance_deg_s"]) and 0.0 < fast <= limits["time_fast_s"]
    return flight.completed and holds, {
        "rate_deg_s": rate,
        "time_fast_s": fast,
        "demand_3_deg_s": centre_line_demand(3.0),
        "demand_4_deg_s": centre_line_demand(4.0),
    }


def _fig17_18_effort_time(evidence: Evidence, limits: Limits) -> Finding:
    constant, variable = evidence.measures["centre_line"], evidence.measures["centre_line_variable"]
    gentle = evidence.measures["centre_line_variable_3"]
    late = variable.late_oscillation_rms_deg / constant.late_oscillation_rms_deg
    effort = variable.stick_rate_in_s / constant.stick_rate_in_s
    saved = constant.time_to_170_kt_s - variable.time_to_170_kt_s
    holds = late > limits["late_ratio"] and effort > limits["effort_ratio"] and saved >= limits["time_saved_s"]
    return variable.completed and holds, {
        "late_deg": variable.late_oscillation_rms_deg,
        "centre_late_deg": constant.late_oscillation_rms_deg,
        "late_ratio": late,
        "stick_rate_in_s": variable.stick_rate_in_s,
        "centre_stick_rate_in_s": constant.stick_rate_in_s,
        "effort_ratio": effort,
        "time_saved_s": saved,
        "effort_ratio_3": gentle.stick_rate_in_s / constant.stick_rate_in_s,
        "time_saved_3_s": constant.time_to_170_kt_s - gentle.time_to_170_kt_s,
        "late_3_deg": gentle.late_oscillation_rms_deg,
    }


def _text_12_s(evidence: Evidence, limits: Limits) -> Finding:
    found = dict(evidence.facts["text_12_s"])
    holds = (
        found["completed"] is True
        and float(found["nacelle_time_s"]) <= limits["nacelle_time_s"]
        and float(found["peak_deg"]) < limits["peak_deg"]
        and float(found["torque_inlb"]) <= limits["torque_inlb"]
    )
    return holds, found


def _text_rotor_speed(evidence: Evidence, limits: Limits) -> Finding:
    spread = max(flight.rotor_speed_spread_rpm for flight in evidence.measures.values())
    speed = evidence.measures["typical"].rotor_speed_rpm
    return spread <= limits["spread_rpm"], {"rotor_speed_rpm": speed, "spread_rpm": spread}


def _text_lpv_accuracy(evidence: Evidence, limits: Limits) -> Finding:
    found = dict(evidence.facts["text_lpv_accuracy"])
    return all(float(found[f"plain_{key}"]) <= limit for key, limit in limits.items()), found


JUDGES: dict[str, Judge] = {
    "table1_timing": _table1_timing,
    "table1_equation_5": _table1_equation_5,
    "table1_cap_50_kn": _table1_cap_50_kn,
    "table1_170_kn_at_60_s": _table1_170_kn_at_60_s,
    "fig1_corridor": _fig1_corridor,
    "fig2_grid": _grid("fig2_grid"),
    "fig2_ten_knots": _grid("fig2_ten_knots"),
    "fig3_pilot": _fig3_pilot,
    "fig4_path": _fig4_path,
    "fig4_least_integral": _fig4_least_integral,
    "fig5_early_peak": _fig5_early_peak,
    "fig6_map": _fig6_map,
    "fig7_fast_side": _fig7_fast_side,
    "fig8_worse": _fig8_worse,
    "fig10_larger_oscillation": _fig10_larger_oscillation,
    "fig12_collective_falls": _fig12_collective_falls,
    "fig14_small_acceleration": _fig14_small_acceleration,
    "fig14_similar_frequency": _fig14_similar_frequency,
    "fig16_max_rate": _fig16_max_rate,
    "fig17_18_effort_time": _fig17_18_effort_time,
    "text_12_s": _text_12_s,
    "text_rotor_speed": _text_rotor_speed,
    "text_lpv_accuracy": _text_lpv_accuracy,
}
"""The judges by the id of their claim."""
