"""Controls, and responses identified in flight."""

from __future__ import annotations

import math

import numpy as np

from rtsim.aircraft.variables import INPUT, OUTPUT, STATE, STATES
from rtsim.units import GRAVITY, HORSEPOWER, KNOT, deg, to_deg
from rtsim.validation.bench import Bench
from rtsim.validation.check import Check, Measure, Series, both_ways
from rtsim.validation.declared.asking import label
from rtsim.validation.published import Table

_HOVER, _CONTROL, _GEARING = Table("dynamics.hover_tf"), Table("dynamics.hover_control"), Table("control")
_HEAVE = Table("dynamics.identified_heave")
_IN_HOVER = "hover, 13000 lb, sea level"
_SPEED_STABILITY = "speed stability near hover lower than identified, as in every rotor model known"


def checks() -> list[Check]:
    """The checks of this group."""
    return [*_gearing(), *_pitch(), *_roots(), _heave_gain(), *_airplane_derivatives(), *_airplane_modes()]


def _asked_angles(bench: Bench, nacelle_deg: float) -> np.ndarray:
    """Cyclic and elevator [rad] that full forward stick asks for."""
    x, u = np.zeros(len(STATES)), np.zeros(len(bench.hover.point.u))
    u[INPUT.stick] = 1.0
    rates = 1.0 / bench.aircraft.tables.controls.actuator_rate
    asked = bench.aircraft.derivative(x, u, deg(nacelle_deg))[STATE.collective_75 :] * rates
    return np.asarray(asked[1:3])


def _gearing() -> list[Check]:
    elevator = Series(name="dynamics.gearing.elevator", quantity="elevator at full stick", unit="deg", decimals=2)
    cyclic = Series(
        name="dynamics.gearing.cyclic", quantity="longitudinal cyclic at full stick", unit="deg", decimals=2
    )
    source = "X62407 table 8.3.1; CR-166536"
    # 2.1 deg/in of GTRS against 0.0374 rad/in of TM X-62407; stopped at 10.06 deg: 3 %, ours.
    return [
        elevator.check("n90", "nacelle 90", lambda bench: to_deg(float(_asked_angles(bench, 90.0)[1])),
                       number=_GEARING.number("elevator_limit_deg", source=source, grade="T"),
                       absolute=both_ways(0.02), band_from="ours"),
        cyclic.check("n90", "nacelle 90", lambda bench: -to_deg(float(_asked_angles(bench, 90.0)[0])), source=source,
                     grade="T", limits=(10.06 * 0.97, 10.06 * 1.03), band_from="ours", x=90.0),
        cyclic.check("n0", "nacelle 0", lambda bench: -to_deg(float(_asked_angles(bench, 0.0)[0])), source=source,
                     grade="T", limits=(0.0, 0.0), band_from="ours", x=0.0),
    ]  # fmt: skip


def _pitch() -> list[Check]:
    sensitivity = Series(name="dynamics.hover.sensitivity", quantity="pitch acceleration per inch of stick, forward",
                         unit="rad/s2/in", decimals=4)  # fmt: skip
    damping = Series(name="dynamics.hover.damping", quantity="pitch damping, rigid body", unit="1/s", decimals=3,
                     reason="a prediction with two thirds of the inertia")  # fmt: skip
    tolerance = float(_CONTROL.content["recommended_tol"])
    return [
        sensitivity.check("", _IN_HOVER, lambda bench: -float(bench.rigid_body(0.0, 90.0)[1][2, INPUT.stick]) / 4.8,
                          number=_CONTROL.number("recommended_abs", source="TM89428, elevator gearing", grade="D"),
                          absolute=both_ways(tolerance), band_from="printed"),
        damping.check("", _IN_HOVER, lambda bench: -float(bench.rigid_body(0.0, 90.0)[0][2, 2]),
                      number=_CONTROL.number("pitch_damping_per_s_tmx", source="X62407 table 8.3.2", grade="T")),
    ]  # fmt: skip


def _oscillation(bench: Bench) -> complex:
    """The unstable pair in hover, upper half."""
    roots = bench.eigenvalues(0.0, 90.0)
    unstable = [complex(root) for root in roots if root.real > 0.0 and root.imag > 0.0]
    return min(unstable, key=abs) if unstable else complex(math.nan, math.nan)


def _slow_real(bench: Bench, number: int) -> float:
    """Real roots in hover slower than 2 1/s, the slowest first: heave, then pitch."""
    roots = bench.eigenvalues(0.0, 90.0)
    real = sorted(float(root.real) for root in roots if abs(root.imag) < 1e-9 and -2.0 < root.real < 0.0)
    return real[-1 - number] if number < len(real) else math.nan


def _roots() -> list[Check]:
    frequency = Series(name="dynamics.hover.oscillation.frequency", quantity="frequency of the hover oscillation",
                       unit="rad/s", decimals=3, reason=_SPEED_STABILITY)  # fmt: skip
    damping = Series(name="dynamics.hover.oscillation.damping", quantity="damping ratio of the hover oscillation",
                     decimals=3, reason=_SPEED_STABILITY)  # fmt: skip
    pitch = Series(name="dynamics.hover.pitch_root", quantity="pitch root", unit="1/s", decimals=3,
                   reason=f"follows from the oscillation: {_SPEED_STABILITY}")  # fmt: skip
    heave = Series(name="dynamics.hover.heave_root", quantity="heave root", unit="1/s", decimals=3)

    def ratio(bench: Bench) -> float:
        root = _oscillation(bench)
        return -root.real / abs(root)

    source = "TM89428 eqs 4.8-4.10"
    rows: tuple[tuple[Series, Measure, str, tuple[float, float]], ...] = (
        (frequency, lambda bench: abs(_oscillation(bench)), "osc_wn", (0.40, 0.70)),
        (damping, ratio, "osc_zeta", (-0.60, -0.25)),
        (pitch, lambda bench: _slow_real(bench, 1), "pitch_pole", (-1.8, -0.8)),
    )
    found = [
        series.check("", _IN_HOVER, measure, number=_HOVER.number(key, source=source, grade="T2"), limits=limits,
                     band_from="printed")
        for series, measure, key, limits in rows
    ]  # fmt: skip
    return found + [
        heave.check(name, _IN_HOVER, lambda bench: _slow_real(bench, 0), number=_HEAVE.number(f"pole_{name}"),
                    limits=(-0.20, -0.08), band_from="printed")
        for name in ("tm89428", "tm86009")
    ]  # fmt: skip


def _heave_gain() -> Check:
    """Static gain of vertical acceleration to collective over that of power; band a factor of two.

    The source's definition of a per cent of power is not printed: 1 % of 3100 shp here, both take-off ratings.
    """
    series = Series(name="dynamics.hover.heave_gain", quantity="vertical acceleration per % of power", unit="g/%",
                    decimals=4)  # fmt: skip

    def measure(bench: Bench) -> float:
        model = bench.linear(0.0, 90.0)
        fast, column = [STATE.coning, STATE.coning_rate, STATE.inflow_0], STATE.collective_75
        shift = -np.linalg.solve(model.A[np.ix_(fast, fast)], model.A[fast, column])
        heave = model.A[STATE.w, column] + model.A[STATE.w, fast] @ shift
        power = model.C[OUTPUT.power, column] + model.C[OUTPUT.power, fast] @ shift
        return float(heave / GRAVITY / (power / (0.01 * 3100.0 * HORSEPOWER)))

    return series.check(
        "", _IN_HOVER, measure, limits=(-0.0196, -0.0049), band_from="ours",
        number=_HOVER.number("az_per_power_gain_g_per_pct", source="TM89428 eq 5.12", grade="T2"),
    )  # fmt: skip


_CRUISE = {"flap_deg": 0.0, "rotor_rpm": 517.0}


def _airplane_derivatives() -> list[Check]:
    """Another model's derivatives at 100 m/s (Drones 2022, 6, 92)."""
    speed = 100.0 / KNOT
    rows = (("Zw", 1, -1.13), ("Mq", 2, -1.40))
    return [
        Series(name=f"dynamics.airplane.{name}", quantity=f"{name} of another model", unit="1/s", decimals=2).check(
            "", "nacelle 0, flaps up, 517 rpm, 100 m/s",
            lambda bench, place=place: float(bench.rigid_body(speed, 0.0, **_CRUISE)[0][place, place]),  # type: ignore[misc]
            source=f"SHENG2022: {value:g}", grade="T", limits=(1.2 * value, 0.8 * value), band_from="ours",
        )
        for name, place, value in rows
    ]  # fmt: skip


def _airplane_modes() -> list[Check]:
    """Reported: no source prints them with augmentation off."""

    def mode(speed: float, number: int, *, damping: bool) -> Measure:
        def measure(bench: Bench) -> float:
            roots = bench.eigenvalues(speed, 0.0, **_CRUISE)
            slow = sorted((complex(root) for root in roots if root.imag > 0.0 and abs(root) < 8.0), key=abs)
            if not slow:
                return math.nan
            return -slow[number].real / abs(slow[number]) if damping else abs(slow[number])

        return measure

    found = []
    for name, number in (("short_period", -1), ("phugoid", 0)):
        words = name.replace("_", " ")
        for kind, unit in (("frequency", "rad/s"), ("damping", "")):
            series = Series(
                name=f"dynamics.airplane.{name}.{kind}", quantity=f"{words}, {kind}{' ratio' if not unit else ''}",
                unit=unit, decimals=2,
            )  # fmt: skip
            found += [
                series.check(
                    label(speed), f"nacelle 0, flaps up, 517 rpm, {speed:g} kn",
                    mode(speed, number, damping=kind == "damping"), source="none", grade="-", x=speed,
                )
                for speed in (140.0, 170.0, 200.0)
            ]  # fmt: skip
    return found
