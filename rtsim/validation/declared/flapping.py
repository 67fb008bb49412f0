"""Trim flapping against the chart of 1975, with the tail as the model has it and as the chart assumes it."""

from __future__ import annotations

import numpy as np

from rtsim.validation.bench import Bench
from rtsim.validation.check import Check, Measure, Series, both_ways
from rtsim.validation.declared.asking import label
from rtsim.validation.published import Table

_CHART, _STALL = Table("trim.flapping"), Table("corridor.design_low")
# The chart's airplane curve lies where the aircraft flies flaps up; its rotor speed there is not printed (458 rpm?).
_SETTING: dict[int, dict[str, float]] = {0: {"flap_deg": 0.0, "rotor_rpm": 517.0}}
_REASONS = {
    90: "no level trim: the retreating blade stalls before",
    75: "the rotor wake at the tail (GTRS table 2-I, later than the chart), which the chart lacks",
    60: "the rotor wake at the tail, which the chart lacks",
    30: "at 84 and 86 kn the wing of the model has stalled; above 130 kn the model rises, the chart is flat: not known",
    0: "the chart's rotor speed is not printed",
}


def checks() -> list[Check]:
    """The checks of this group."""
    return [*_lines(), *_ridge()]


def stall_speed(nacelle: float) -> float:
    """The source's own stall line at 13000 lb [kn].

    Args:
        nacelle: Nacelle angle [deg].
    """
    angles, speeds = _STALL.values("nacelle_deg"), _STALL.values("speed_kn")
    return float(np.interp(nacelle, angles[::-1], speeds[::-1]))


def _ask(speed: float, nacelle: int, *, bare_tail: bool) -> Measure:
    def measure(bench: Bench) -> float:
        asked = bench.without_tail_wake if bare_tail else bench
        setting: dict[str, float] = _SETTING.get(nacelle, {"flap_deg": 40.0})
        return asked.level(speed, float(nacelle), **setting).flapping_deg

    return measure


def _lines() -> list[Check]:
    found = []
    for nacelle in (90, 75, 60, 30, 0):
        # Wake and downwash tables end at nacelle 30: below there the two tails are one.
        for bare_tail in (False, True) if nacelle in {75, 60} else (False,):
            series = Series(
                name=f"flapping.n{nacelle}{'.no_tail_wake' if bare_tail else ''}",
                quantity="trim flapping" + (", no rotor wake at the tail" if bare_tail else ""),
                unit="deg", decimals=2,
                reason="not known; with that wake it holds" if bare_tail else _REASONS[nacelle],
            )  # fmt: skip
            for i, speed in enumerate(_CHART.values(f"n{nacelle}_kn")):
                left = speed < stall_speed(nacelle) and nacelle < 75
                found.append(
                    series.check(
                        label(speed), f"nacelle {nacelle}, flaps {0 if nacelle == 0 else 40}, {speed:g} kn",
                        _ask(speed, nacelle, bare_tail=bare_tail), number=_CHART.number(f"n{nacelle}_deg", i),
                        absolute=both_ways(float(_CHART.content["tol_deg"])), band_from="printed", x=speed,
                        outside="left of the source's own stall line" if left else "",
                    )
                )  # fmt: skip
    return found


def _ridge() -> list[Check]:
    speeds = np.arange(10.0, 60.0, 2.5)

    def line(bench: Bench) -> np.ndarray:
        return np.array([bench.level(float(v), 90.0, flap_deg=40.0).flapping_deg for v in speeds])

    height = Series(name="flapping.ridge.height", quantity="low-speed ridge", unit="deg", decimals=2)
    place = Series(name="flapping.ridge.airspeed", quantity="airspeed of the ridge", unit="kn", decimals=1)
    peak = int(np.argmax(_CHART.values("n90_deg")))
    return [
        height.check("", "nacelle 90, flaps 40", lambda bench: float(np.nanmax(line(bench))),
                     number=_CHART.number("n90_deg", peak), absolute=both_ways(float(_CHART.content["tol_deg"])),
                     band_from="printed"),
        place.check("", "nacelle 90, flaps 40", lambda bench: float(speeds[np.nanargmax(line(bench))]),
                    number=_CHART.number("n90_kn", peak), limits=(25.0, 40.0), band_from="ours"),
    ]  # fmt: skip
