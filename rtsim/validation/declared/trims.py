"""Level-flight trims: GTRS (the simulation that was compared with flight) and flight."""

from __future__ import annotations

from rtsim.validation.bench import Bench
from rtsim.validation.check import Band, Check, Series, both_ways
from rtsim.validation.declared.asking import label, level
from rtsim.validation.published import Table

_GTRS = Table("trim.heli_gtrs")
_WANG_90, _FLIGHT, _WANG_30 = Table("trim.wang_gtrs_90"), Table("trim.wang_flight_90"), Table("trim.wang_gtrs_30")
_N90, _N30 = "nacelle 90, flaps 40, {:g} kn", "nacelle 30, flaps 20, {:g} kn"
_AS_GTRS = "as GTRS itself, which sits 3.5 to 5.5 deg below flight"


def checks() -> list[Check]:
    """The checks of this group."""
    return [*_helicopter(), *_flight(), *_nacelle_30(), *_flap_settings()]


def _helicopter() -> list[Check]:
    stick = float(_GTRS.content["tol_stick_in"])
    thrust = float(_GTRS.content["tol_thrust_frac"])
    low, high = _GTRS.values("tol_pitch_deg")
    rows: list[tuple[Series, str, str, Band | None, Band | None]] = [
        (Series(name="trims.n90.pitch", quantity="pitch attitude", unit="deg", decimals=2),
         "pitch_deg", "pitch_deg", (low, high), None),
        (Series(name="trims.n90.stick", quantity="stick from the aft stop", unit="in", decimals=2),
         "stick_in", "stick_in", both_ways(stick), None),
        (Series(name="trims.n90.elevator", quantity="elevator", unit="deg", decimals=2),
         "elevator_deg", "elevator_deg", both_ways(float(_GTRS.content["tol_elevator_deg"])), None),
        (Series(name="trims.n90.thrust", quantity="thrust of each rotor", unit="lb", decimals=0),
         "thrust_lb", "thrust_per_rotor_lb", None, both_ways(thrust)),
        # No band is printed for the cyclic; the stick's band through its gearing of 2.1 deg/in is.
        (Series(name="trims.n90.cyclic", quantity="longitudinal cyclic", unit="deg", decimals=2),
         "cyclic_deg", "theta1s_deg", both_ways(2.1 * stick), None),
    ]  # fmt: skip
    found = [
        series.check(
            label(speed), _N90.format(speed), level(asked, speed, 90.0), number=_GTRS.number(key, i),
            absolute=absolute, relative=relative, band_from="printed", x=speed,
        )
        for series, asked, key, absolute, relative in rows
        for i, speed in enumerate(_GTRS.values("speed_kn"))
    ]  # fmt: skip
    root = Series(name="trims.n90.root_collective", quantity="collective at the root", unit="deg", decimals=2)
    pitch = Series(name="trims.n90.pitch_digitised", quantity="pitch attitude, digitised", unit="deg", decimals=2)
    for series, asked, key in ((root, "root_collective_deg", "theta0_deg"), (pitch, "pitch_deg", "pitch_deg")):
        found += [
            series.check(
                label(speed), _N90.format(speed), level(asked, speed, 90.0), number=_WANG_90.number(key, i),
                absolute=both_ways(2.0), band_from="printed", x=speed,
            )
            for i, speed in enumerate(_WANG_90.values("speed_kn"))
        ]  # fmt: skip
    travel = Series(name="trims.n90.stick_digitised", quantity="stick, digitised", unit="% of travel", decimals=1)
    found += [
        travel.check(
            label(speed), _N90.format(speed), level("stick_percent", speed, 90.0),
            number=_WANG_90.number("stick_pct", i), absolute=both_ways(stick / 9.6 * 100.0), band_from="printed",
            x=speed,
        )
        for i, speed in enumerate(_WANG_90.values("stick_speed_kn"))
    ]  # fmt: skip
    return found


def _flight() -> list[Check]:
    pitch = Series(
        name="trims.n90.pitch_flown", quantity="pitch attitude, flown", unit="deg", decimals=2, reason=_AS_GTRS
    )
    stick = Series(name="trims.n90.stick_flown", quantity="stick, flown", unit="% of travel", decimals=1)
    speeds = _FLIGHT.values("speed_kn")
    # The printed band of model minus GTRS (-2 to +6 deg) allows for flight; the same turned round.
    found = [
        pitch.check(
            label(speed), _N90.format(speed), level("pitch_deg", speed, 90.0), number=_FLIGHT.number("pitch_deg", i),
            absolute=(-6.0, 2.0), band_from="ours", x=speed,
        )
        for i, speed in enumerate(speeds)
    ]  # fmt: skip
    return found + [
        stick.check(
            label(speed), _N90.format(speed), level("stick_percent", speed, 90.0),
            number=_FLIGHT.number("stick_pct", i), x=speed,
        )
        for i, speed in enumerate(speeds)
    ]  # fmt: skip


def _nacelle_30() -> list[Check]:
    rows = (
        (Series(name="trims.n30.pitch", quantity="pitch attitude", unit="deg", decimals=2),
         "pitch_deg", "pitch_deg", 2.0),
        (Series(name="trims.n30.stick", quantity="stick", unit="% of travel", decimals=1),
         "stick_percent", "stick_pct", 5.0),
        (Series(name="trims.n30.root_collective", quantity="collective at the root", unit="deg", decimals=2),
         "root_collective_deg", "theta0_deg", 2.0),
    )  # fmt: skip
    return [
        series.check(
            label(speed), _N30.format(speed), level(asked, speed, 30.0, flap_deg=20.0),
            number=_WANG_30.number(key, i), absolute=both_ways(band), band_from="printed", x=speed,
        )
        for series, asked, key, band in rows
        for i, speed in enumerate(_WANG_30.values("speed_kn"))
    ]  # fmt: skip


_SPEEDS = ((90.0, 40.0, (0, 50, 100)), (75.0, 40.0, (30, 80, 130)), (60.0, 20.0, (70, 110, 150)),
           (30.0, 20.0, (100, 130, 160)), (0.0, 0.0, (120, 170, 220)))  # fmt: skip


def _flap_settings() -> list[Check]:
    """The flap settings that the sources print for each nacelle angle trim across their speed range."""
    series = Series(name="trims.flap_settings", quantity="level trims found, of three airspeeds", decimals=0)

    found = []
    for nacelle, flap, speeds in _SPEEDS:

        def measure(
            bench: Bench, nacelle: float = nacelle, flap: float = flap, speeds: tuple[int, ...] = speeds
        ) -> float:
            trims = [bench.level(float(speed), nacelle, flap_deg=flap) for speed in speeds]
            return float(sum(trim.point.converged for trim in trims))

        words = f"nacelle {nacelle:g}, flaps {flap:g}, {', '.join(map(str, speeds))} kn"
        found.append(
            series.check(
                f"n{nacelle:g}", words, measure, source="YAN2023; CR166537 case headers", grade="T2",
                limits=(3.0, 3.0), band_from="ours", x=nacelle,
            )
        )  # fmt: skip
    return found
