"""X, Z and M of each component at nacelle 90, as GTRS prints them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rtsim.arrays import FloatArray
from rtsim.validation.bench import Bench
from rtsim.validation.check import Check, Measure, Series, both_ways
from rtsim.validation.declared.asking import label, level
from rtsim.validation.published import Table

_LOADS, _TRIM = Table("trim.heli_gtrs_loads"), Table("trim.heli_gtrs")
_FORCE_BAND, _MOMENT_BAND = 325.0, 700.0
"""Our bands: 2.5 % of the weight [lb], and 0.033 rad/s^2 of pitch acceleration [ft lb]."""
_Loads = Callable[[Bench, float], Mapping[str, FloatArray]]
_AXES = {"X": 0, "Z": 1, "M": 2}
_WHOLE = {
    "rotor_total": ("rotor total", "rotors with spinners", "XZM"),
    "wing": ("wing", "wing with download", "XZM"),
    "fuselage": ("fuselage", "fuselage", "XZM"),
    "htail": ("tail", "horizontal tail", "ZM"),
    "airframe": ("airframe", "airframe without spinners", "XZM"),
}
_PARTS = {
    "engine_pylons": ("pylons", "pylon interference drag", "the interference drag is taken in another flow"),
    "hub_spinner": ("spinners", "spinner drag", "the drag is taken in another flow, or acts at another point"),
    "jet": (
        "jets",
        "jet thrust of the engines",
        "a law in power and airspeed through these four numbers, at the model's own power",
    ),
}


def checks() -> list[Check]:
    """The checks of this group."""
    return [*_in_trim(), *_in_printed_flow(), *_induced_velocity()]


def _in_trim() -> list[Check]:
    found = []
    for prefix, (component, words, axes) in _WHOLE.items():
        for axis in axes:
            moment = axis == "M"
            series = Series(
                name=f"loads.{prefix}.{axis}", quantity=f"{words}, {axis}", unit="ft lb" if moment else "lb", decimals=0
            )

            for i, speed in enumerate(_LOADS.values("speed_kn")):
                found.append(
                    series.check(
                        label(speed), f"nacelle 90, {speed:g} kn, own trim",
                        _asked(Bench.loads, speed, component, axis),
                        number=_LOADS.number(f"{prefix}_{axis}", i), x=speed,
                        absolute=both_ways(_MOMENT_BAND if moment else _FORCE_BAND), band_from="ours",
                    )
                )  # fmt: skip
    return found


def _in_printed_flow() -> list[Check]:
    """Single components in the attitude and induced velocity that the source prints: no trim stands between."""
    pitch = dict(zip(_TRIM.values("speed_kn"), _TRIM.values("pitch_deg"), strict=True))
    induced = dict(zip(_LOADS.values("speed_kn"), _LOADS.values("induced_ft_s"), strict=True))

    def loads(bench: Bench, speed: float) -> Mapping[str, FloatArray]:
        return bench.loads_at(speed, pitch_deg=pitch[speed], induced_ft_s=induced[speed])

    found = []
    for name, (component, words, reason) in _PARTS.items():
        table = Table(f"loads.{name}")
        for axis in "XZM":
            key = f"{axis}_{'ftlb' if axis == 'M' else 'lb'}"
            if key not in table.content:
                continue
            unit, band = ("ft lb", "tol_ftlb") if axis == "M" else ("lb", "tol_lb")
            # Jet thrust has no printed band: that of the other two.
            size = float(table.content.get(band, 1.0))
            series = Series(
                name=f"loads.{name}.{axis}", quantity=f"{words}, {axis}", unit=unit, decimals=1, reason=reason
            )
            found += [
                series.check(
                    label(speed), f"nacelle 90, {speed:g} kn, attitude and inflow as printed",
                    _asked(loads, speed, component, axis), number=table.number(key, i),
                    absolute=both_ways(size), band_from="ours", x=speed,
                )
                for i, speed in enumerate(table.values("speed_kn"))
            ]  # fmt: skip
    return found


def _asked(loads: _Loads, speed: float, component: str, axis: str) -> Measure:
    def measure(bench: Bench) -> float:
        return float(loads(bench, speed)[component][_AXES[axis]])

    return measure


def _induced_velocity() -> list[Check]:
    series = Series(name="loads.induced_velocity", quantity="mean induced velocity", unit="ft/s", decimals=2)
    return [
        series.check(
            label(speed), f"nacelle 90, {speed:g} kn", level("induced_ft_s", speed, 90.0),
            number=_LOADS.number("induced_ft_s", i), relative=both_ways(0.05), band_from="ours", x=speed,
        )
        for i, speed in enumerate(_LOADS.values("speed_kn"))
    ]  # fmt: skip
