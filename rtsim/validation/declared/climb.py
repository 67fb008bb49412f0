"""Climb at the climb torque, autorotation, level speed at the cruise torque."""

from __future__ import annotations

from rtsim.validation.bench import Bench
from rtsim.validation.check import Check, Measure, Series
from rtsim.validation.declared.asking import label
from rtsim.validation.published import Table

_CLIMB, _SPEEDS = Table("climb"), Table("speeds")
_POWER = float(_CLIMB.content["rotor_shp"])
_RPM = float(_CLIMB.content["rotor_rpm"])
_BAND = (-630.0, 290.0)
"""Our band [ft/min]: that printed for the same source's level power, -10 to +28 % of 752 shp at 60 kn, as climb of
13000 lb, and 100 ft/min of reading. A model that needs more power climbs less."""
_TORQUE = 130000.0


def checks() -> list[Check]:
    """The checks of this group."""
    return [*_chart(), _upright(), *_autorotation(), _level_speed()]


def climbing(speed: float, nacelle: float, power: float = _POWER, rotor_rpm: float = _RPM) -> Measure:
    """Ask for the rate of climb, flaps 40.

    Args:
        speed: Airspeed [kn].
        nacelle: Nacelle angle [deg].
        power: Shaft power of both rotors [shp].
        rotor_rpm: Rotor speed [rpm].
    """

    def measure(bench: Bench) -> float:
        return bench.once(
            ("climb", speed, nacelle, power, rotor_rpm),
            lambda: bench.climb(speed, nacelle, power, flap_deg=40.0, rotor_rpm=rotor_rpm),
        )

    return measure


def _chart() -> list[Check]:
    found = []
    for nacelle in (75, 0):
        series = Series(
            name=f"climb.n{nacelle}", quantity="rate of climb", unit="ft/min", decimals=0,
            reason="the chart of 1975 needs less power at speed than GTRS and the model (see power); where there is no "
            "climb the rotor or the wing of the model stalls before",
        )  # fmt: skip
        found += [
            series.check(
                label(speed), f"nacelle {nacelle}, flaps 40, {speed:g} kn, 2331 shp, 565 rpm",
                climbing(speed, float(nacelle)), number=_CLIMB.number(f"n{nacelle}_fpm", i), absolute=_BAND,
                band_from="ours", x=speed,
            )
            for i, speed in enumerate(_CLIMB.values(f"n{nacelle}_kn"))
        ]  # fmt: skip
    return found


def _upright() -> Check:
    """The figure of 3100 ft/min, which was once compared at this nacelle angle; the source prints neither."""
    series = Series(name="climb.n90", quantity="rate of climb in helicopter mode", unit="ft/min", decimals=0)
    return series.check(
        "", "nacelle 90, flaps 40, 80 kn, 2331 shp, 565 rpm", climbing(80.0, 90.0),
        number=_SPEEDS.number("heli_roc_80kn_fpm", source="X62407 fig 5.7.1.1", grade="F"),
        outside="the figure prints neither nacelle angle nor airspeed; fig 5.7.1 gives it at nacelle 75",
    )  # fmt: skip


def _autorotation() -> list[Check]:
    flown = Series(name="climb.autorotation.flown", quantity="sink in autorotation", unit="ft/min", decimals=0,
                   reason="torque in upflow too high, by 0.0006 CQ/sigma against a wind-tunnel test; none: the power "
                   "does not fall to zero")  # fmt: skip
    chart = Series(name="climb.autorotation.chart", quantity="sink in autorotation, chart of 1975", unit="ft/min",
                   decimals=0, reason="nacelle angle of the curve not printed")  # fmt: skip

    def sink(speed: float, rotor_rpm: float) -> Measure:
        ask = climbing(speed, 90.0, 0.0, rotor_rpm)
        return lambda bench: -ask(bench)

    least = Series(name="climb.autorotation.least_power", quantity="least shaft power in descent", unit="shp",
                   decimals=0)  # fmt: skip
    at = Series(name="climb.autorotation.at_least_power", quantity="sink at the least shaft power", unit="ft/min",
                decimals=0)  # fmt: skip

    def descent(place: int) -> Measure:
        rotor_rpm = 0.92 / 0.98 * 589.0
        return lambda bench: bench.least_power_in_descent(80.0, 90.0, flap_deg=40.0, rotor_rpm=rotor_rpm)[place]

    # Our band: between predicted and flown.
    low, high = (float(_SPEEDS.content[f"autorotation_sink_fpm_{word}"]) for word in ("predicted", "flight"))
    found = [
        flown.check("", "nacelle 90, flaps 40, 80 kn, 92 % rpm", sink(80.0, 0.92 / 0.98 * 589.0),
                    number=_SPEEDS.number("autorotation_sink_fpm_flight", source="TM81244 text", grade="X"),
                    limits=(low, high), band_from="ours"),
        # Reported: zero or less, or the model does not autorotate there.
        least.check("", "nacelle 90, flaps 40, 80 kn, 92 % rpm", descent(0), source="none", grade="-"),
        at.check("", "nacelle 90, flaps 40, 80 kn, 92 % rpm", descent(1), source="none", grade="-"),
    ]  # fmt: skip
    return found + [
        chart.check(label(speed), f"nacelle 90 (assumed), flaps 40, {speed:g} kn, 565 rpm", sink(speed, _RPM),
                    number=_CLIMB.number("autorotation_fpm", i), x=speed)
        for i, speed in enumerate(_CLIMB.values("autorotation_kn"))
    ]  # fmt: skip


def _level_speed() -> Check:
    series = Series(name="climb.level_speed", quantity="level speed at cruise torque", unit="kn", decimals=1,
                    reason="drag of spinners in the rotors' own flow")  # fmt: skip
    return series.check(
        "", "nacelle 0, flaps up, 517 rpm, 130000 in lb",
        lambda bench: bench.speed_at_torque(_TORQUE, flap_deg=0.0, rotor_rpm=517.0),
        number=_SPEEDS.number("vmax_sl_cruise_torque_ktas", source="X62407 fig 5.5.1", grade="F"),
        relative=(-0.02, 0.02), band_from="ours",
    )  # fmt: skip
