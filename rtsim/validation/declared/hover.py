"""Hover: power, download, and how high and heavy the aircraft hovers with the published engine."""

from __future__ import annotations

from rtsim.analysis.performance import hover_ceiling, mast_torque_limit
from rtsim.systems.engine import power_available
from rtsim.units import FOOT, GRAVITY, HORSEPOWER, INCH_POUND, POUND_FORCE, rpm
from rtsim.validation.bench import TRANSMISSION, Bench, the_bench
from rtsim.validation.check import Check, Measure, Series, both_ways
from rtsim.validation.published import Table

_HOVER, _WEIGHTS, _CEILING = Table("hover"), Table("hover.weights"), Table("hover.ceiling")
_BAND = float(_HOVER.content["engine_shp_tol_frac"])
_RPM = float(Table("climb").content["rotor_rpm"])


def checks() -> list[Check]:
    """The checks of this group."""
    return [*_power(), *_weights(), _ceiling()]


def _power() -> list[Check]:
    rotor = Series(name="hover.power.gtrs", quantity="rotor power in hover, GTRS", unit="shp", decimals=0)
    engine = Series(name="hover.power.engine", quantity="engine power in hover", unit="shp", decimals=0,
                    reason="the source's download is 7 %, the model's 12 to 13 (GTRS 12.8)")  # fmt: skip
    download = Series(name="hover.download", quantity="download over thrust", decimals=4)
    torque = Series(name="hover.torque", quantity="mast torque in hover", unit="in lb", decimals=0)

    def share(bench: Bench) -> float:
        weight = bench.aircraft.tables.configuration.mass * GRAVITY / POUND_FORCE
        return 1.0 - weight / (2.0 * bench.hover.thrust_lb)

    low, high = _HOVER.values("download_frac_range")
    at = "13000 lb, sea level, 589 rpm"
    limit = mast_torque_limit(the_bench().condition(0.0, 90.0)) / INCH_POUND
    return [
        rotor.check("", at, lambda bench: bench.hover.power_shp, relative=both_ways(_BAND), band_from="printed",
                    number=_HOVER.number("gtrs_rotor_shp", source="WANG2025 fig 1a (GTRS)", grade="F2")),
        engine.check("", at, lambda bench: bench.hover.power_shp / TRANSMISSION, relative=both_ways(_BAND),
                     band_from="printed", number=_HOVER.number("engine_shp", source="X62407 fig 5.4.2", grade="F")),
        download.check("", at, share, source="X62407 (7 %), GTRS (12.8 %), RTO-MP-AVT-111 (14.7 %)", grade="X",
                       limits=(low, high), band_from="printed"),
        torque.check("", at, lambda bench: bench.hover.torque_inlb, source="X62407, take-off limit", grade="X",
                     limits=(0.0, limit), band_from="printed"),
    ]  # fmt: skip


def available_shp(height_ft: float) -> float:
    """Shaft power of both rotors at take-off rating, standard day, as published [shp].

    Args:
        height_ft: Height [ft].
    """
    return power_available("takeoff", height_ft * FOOT) / HORSEPOWER


def needed_shp(bench: Bench, height_ft: float, weight_lb: float) -> float:
    """Shaft power of both rotors in hover, 565 rpm [shp].

    Args:
        bench: The model.
        height_ft: Height [ft].
        weight_lb: Weight [lb].
    """
    return bench.level(0.0, 90.0, rotor_rpm=_RPM, weight_lb=weight_lb, height_ft=height_ft).power_shp


def _weights() -> list[Check]:
    """At the published hover weights all of the take-off power is needed, within the printed band of hover power."""
    series = Series(
        name="hover.weights", quantity="power needed over available at the published hover weight", decimals=3,
        reason="below the band: the model hovers on less power than the source, or the source keeps a margin that it "
        "does not print; none: the rotor of the model stalls before the power ends",
    )  # fmt: skip

    def share(height: float, weight: float) -> Measure:
        return lambda bench: needed_shp(bench, height, weight) / available_shp(height)

    return [
        series.check(
            f"{height:.0f}ft", f"{weight:g} lb at {height:g} ft, 565 rpm", share(height, weight), x=height,
            source=f"{_WEIGHTS.content['src']}; engine X62407 fig 6.2.2", grade="F2",
            limits=(1.0 - _BAND, 1.0 + _BAND), band_from="printed",
        )
        for height, weight in zip(_WEIGHTS.values("height_ft"), _WEIGHTS.values("weight_lb"), strict=True)
    ]  # fmt: skip


def ceiling_ft(bench: Bench) -> float:
    """Height out of ground effect where hover takes all of the take-off power, or the rotor stalls [ft].

    Args:
        bench: The model.
    """
    return bench.once("ceiling", lambda: hover_ceiling(bench.aircraft, rotor_speed=rpm(_RPM)).value / FOOT)


def _ceiling() -> Check:
    """Our band: the three published figures, and 1000 ft (3 % of power, half the band of hover power) about them."""
    series = Series(name="hover.ceiling", quantity="hover ceiling out of ground effect", unit="ft", decimals=0,
                    reason="the rotor of the model stalls, or hover takes too much power")  # fmt: skip
    low, high = float(_CEILING.content["text_ft"]), float(_CEILING.content["history_ft"])
    return series.check(
        "", "13000 lb, standard day, take-off power, 565 rpm", ceiling_ft,
        number=_CEILING.number("text_ft"), limits=(low - 1000.0, high + 1000.0), band_from="ours",
    )  # fmt: skip
