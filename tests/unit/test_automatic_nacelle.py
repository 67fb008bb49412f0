"""Automatic nacelle control: schedules, limits of rate and acceleration, both directions, detents, the plug-in form."""

from __future__ import annotations

import dataclasses
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from rtsim import plugins
from rtsim.command import Command, NacelleLaw, Sensors
from rtsim.errors import InputError
from rtsim.nacelle.automatic import (
    AutomaticNacelle,
    NacelleSchedule,
    ScheduledNacelle,
    centre_line_schedule,
    inactive_tables,
    programme_schedule,
)
from rtsim.optimization.paths import table_1
from rtsim.programme import Programme
from rtsim.units import deg, kt, to_deg, to_kt
from scenarios.files.loader import parse_scenario
from scenarios.files.nacelle_laws import NACELLE_PLUGIN, NacelleLawGuard, automatic_nacelle, load_nacelle_law

DT = 0.004
LINE = NacelleSchedule((kt(40.0), kt(140.0)), (deg(90.0), 0.0))
SENSORS = Sensors(0.0, kt(90.0), 0.0, deg(45.0), 0.0, 0.0, 0.0, 0.0, 100.0, 0.0, 1.0, 0.0, 0.0, False, True)


def drive(law, airspeeds, start_deg):
    """Command angles [rad] and rates [rad/s] of a law that sees airspeeds, with an actuator without lag."""
    law = ScheduledNacelle(law)
    angle, angles, rates = deg(start_deg), [], []
    for before, airspeed in zip(np.r_[airspeeds[0], airspeeds[:-1]], airspeeds, strict=True):
        seen = dataclasses.replace(
            SENSORS, airspeed=float(airspeed), airspeed_rate=float(airspeed - before) / DT, nacelle_angle=angle
        )
        rate = law.step(seen, Command(0.0, 0.5, 0.0), DT)
        angle = min(max(angle + rate * DT, 0.0), deg(90.0))
        angles.append(angle)
        rates.append(rate)
    return np.array(angles), np.array(rates)


def ramp(from_kt, to_kt_, rate_kt_s, hold_s=6.0):
    count = round(abs(to_kt_ - from_kt) / rate_kt_s / DT)
    return np.r_[np.linspace(kt(from_kt), kt(to_kt_), count), np.full(round(hold_s / DT), kt(to_kt_))]


@pytest.mark.parametrize(("start", "end", "first", "last"), [(20, 160, 90.0, 0.0), (160, 20, 0.0, 90.0)])
def test_it_follows_its_schedule_both_ways(start, end, first, last):
    law = AutomaticNacelle(LINE)
    airspeeds = ramp(start, end, 3.0)
    angles, rates = drive(law, airspeeds, first)
    assert to_deg(angles[-1]) == pytest.approx(last, abs=0.01)
    # The schedule is read a lead ahead: the command is there before the airspeed, by the actuator's lag.
    wanted = np.array([LINE.at(v) for v in airspeeds])
    lag = round(law.lead / DT)
    middle = slice(len(wanted) // 3, len(wanted) // 2)
    ahead = wanted[middle.start + lag : middle.stop + lag]
    assert np.abs(angles[middle] - ahead).max() < deg(0.2)
    assert np.abs(rates).max() <= law.rate + 1e-12
    assert np.abs(np.diff(rates)).max() <= law.acceleration * DT + 1e-12


@pytest.mark.parametrize("rate", [3.0, 7.5, 12.0])
def test_rate_and_acceleration_stay_within_their_limits_without_overshoot(rate):
    law = AutomaticNacelle(LINE, rate=deg(rate), acceleration=deg(20.0))
    angles, rates = drive(law, np.full(round(40.0 / DT), kt(140.0)), 90.0)
    assert np.abs(rates).max() == pytest.approx(deg(rate), rel=1e-9)
    assert np.abs(np.diff(np.r_[0.0, rates])).max() <= deg(20.0) * DT + 1e-12
    assert np.diff(angles).max() <= 1e-12
    assert angles[-1] == pytest.approx(0.0, abs=1e-6)


def test_braking_leaves_half_of_the_acceleration_spare():
    """A schedule that moves on while the nacelles slow down can then still be followed."""
    law = AutomaticNacelle(LINE, rate=deg(12.0), acceleration=deg(5.0))
    angles, rates = drive(law, np.full(round(40.0 / DT), kt(140.0)), 90.0)
    slowing = np.diff(rates)[int(np.argmin(rates)) :] / DT
    far = rates[int(np.argmin(rates)) : -1] < -deg(4.0)  # nearer than 2.2 deg the gain takes over
    assert slowing[far].max() == pytest.approx(deg(2.5), rel=0.02)  # 2 %: the rate is held over each frame
    assert angles[-1] == pytest.approx(0.0, abs=1e-6)


def test_it_pauses_at_the_detents_only_where_they_are_wanted():
    airspeeds = ramp(40, 140, 2.0, hold_s=10.0)
    free, _ = drive(AutomaticNacelle(LINE), airspeeds, 90.0)
    paused, rates = drive(AutomaticNacelle(LINE, detents=True), airspeeds, 90.0)
    for detent in (75.0, 50.0):
        at = np.abs(paused - deg(detent)) < deg(0.02)
        assert at.sum() * DT > 1.0
        assert (np.abs(free - deg(detent)) < deg(0.02)).sum() * DT < 0.2
        assert np.abs(rates[at]).min() == pytest.approx(0.0, abs=1e-6)
    assert paused[-1] == pytest.approx(0.0, abs=1e-3)


def test_the_airspeed_filter_lets_gusts_pass():
    steady = np.full(round(20.0 / DT), kt(90.0))
    gusty = steady + kt(3.0) * np.sin(2.0 * np.pi * 2.0 * np.arange(len(steady)) * DT)
    law = ScheduledNacelle(AutomaticNacelle(LINE))
    rates = [
        law.step(dataclasses.replace(SENSORS, airspeed=float(v), nacelle_angle=deg(45.0)), Command(0, 0.5, 0), DT)
        for v in gusty
    ]
    # 3 kn of gust is 2.7 deg on this schedule; unfiltered, at 2 Hz and gain 1.5, that is 4 deg/s.
    assert np.abs(np.array(rates[len(rates) // 2 :])).max() < deg(0.4)


def test_the_plug_ins_follow_the_interface():
    assert isinstance(ScheduledNacelle(), NacelleLaw)
    moved = ScheduledNacelle(AutomaticNacelle(LINE))
    jammed = dataclasses.replace(SENSORS, nacelle_ok=False, nacelle_angle=deg(80.0))
    for _ in range(500):
        rate = moved.step(jammed, Command(0.0, 0.5, 0.0), DT)
    assert rate == pytest.approx(-deg(7.5))  # it goes on asking from where the jammed nacelles are


def test_schedules_from_corridor_and_programme():
    line = centre_line_schedule()
    assert to_deg(line.at(0.0)) == 90.0
    assert line.at(kt(170.0)) == 0.0
    assert to_kt(line.airspeed[0]) == pytest.approx(62.5, abs=0.1)
    table = programme_schedule(table_1().programme())
    assert to_deg(table.at(kt(92.5))) == pytest.approx(62.5, abs=7.0)
    back = programme_schedule(table_1().reconversion().programme())
    assert back.at(kt(140.0)) <= deg(50.0)
    with pytest.raises(InputError, match="airspeeds must rise"):
        programme_schedule(Programme(np.array([0.0, 5.0]), np.full(2, 40.0), np.array([1.0, 0.5]), np.full(2, 100.0)))


def test_settings_that_cannot_be_flown_are_refused():
    assert inactive_tables().active == 0
    assert AutomaticNacelle(LINE).tables().active == 1
    with pytest.raises(InputError, match="out of range"):
        AutomaticNacelle(LINE, rate=deg(12.1)).tables()
    with pytest.raises(InputError, match="must be positive"):
        AutomaticNacelle(LINE, gain=0.0)
    for speeds, angles, words in (
        ((1.0,), (1.0,), "at least two"),
        ((1.0, np.nan), (1.0, 0.0), "not a number"),
        ((2.0, 1.0), (1.0, 0.0), "must rise"),
        ((1.0, 2.0), (0.0, 1.0), "must not rise"),
    ):
        with pytest.raises(InputError, match=words):
            NacelleSchedule(speeds, angles)


FILE = """
format = 1
name = "automatic"
title = "t"
[flight]
nacelle = {nacelle}
[programme]
points = [{{ airspeed_kt = 0, nacelle_deg = 90 }}, {{ airspeed_kt = 170, nacelle_deg = 0 }}]
{table}
"""


def parsed(nacelle, table=""):
    scenario, problems = parse_scenario(FILE.format(nacelle=nacelle, table=table), file="f.toml")
    if problems:
        raise problems[0]
    assert scenario is not None
    return scenario


def test_scenarios_choose_the_law():
    assert parsed('"programme"').options.nacelle == "programme"
    assert parsed('"my_laws:Mine"').options.nacelle == "my_laws:Mine"
    scenario = parsed('"automatic"', '[automatic]\nschedule = "programme"\nrate_deg_s = 12\ndetents = true')
    law = automatic_nacelle(scenario.options.nacelle, scenario.automatic, scenario.programme)
    assert law is not None
    assert law.rate == deg(12.0)
    assert law.detents
    assert to_deg(law.schedule.at(kt(85.0))) == pytest.approx(45.0)
    own = parsed(
        '"automatic"',
        '[automatic]\nschedule = "points"\npoints = [{ airspeed_kt = 50, nacelle_deg = 90 },'
        " { airspeed_kt = 120, nacelle_deg = 0 }]",
    )
    law = automatic_nacelle(own.options.nacelle, own.automatic, own.programme)
    assert law is not None
    assert to_deg(law.schedule.at(kt(85.0))) == pytest.approx(45.0)
    plain = parsed('"automatic"')
    assert automatic_nacelle(plain.options.nacelle, plain.automatic, plain.programme) == AutomaticNacelle()
    assert automatic_nacelle("programme", plain.automatic, plain.programme) is None


@pytest.mark.parametrize(
    ("nacelle", "table", "key"),
    [
        ('"two words"', "", "flight.nacelle"),
        ('"programme"', "[automatic]", "automatic"),
        ('"automatic"', "[automatic]\nrate_deg_s = 20", "automatic.rate_deg_s"),
        ('"automatic"', '[automatic]\nschedule = "points"', "automatic.points"),
        ('"automatic"', "[automatic]\npoints = [{ airspeed_kt = 50, nacelle_deg = 90 }]", "automatic.points"),
        (
            '"automatic"',
            "[automatic]\nschedule='points'\npoints=[{airspeed_kt=5, nacelle_deg=0}, {airspeed_kt=6, nacelle_deg=9}]",
            "automatic.points",
        ),
    ],
)
def test_mistakes_in_scenarios_are_named(nacelle, table, key):
    with pytest.raises(InputError) as caught:
        parsed(nacelle, table)
    assert caught.value.key == key


class Steady:
    """A law at a constant rate."""

    def step(self, sensors, command, dt):  # noqa: ARG002 - the interface's
        """Give -1 deg/s."""
        return -deg(1.0)


class Raises:
    """A law that fails."""

    def step(self, sensors, command, dt):  # noqa: ARG002 - the interface's
        """Fail."""
        raise ZeroDivisionError("no airspeed")


class Exits:
    """A law that wants to end the program."""

    def step(self, sensors, command, dt):  # noqa: ARG002 - the interface's
        """Leave."""
        raise SystemExit("enough")


class NotFinite:
    """A law without an answer."""

    def step(self, sensors, command, dt):  # noqa: ARG002 - the interface's
        """Give NaN."""
        return float("nan")


class NeedsMore:
    """A law that cannot be made."""

    def __init__(self, more):
        """Need an argument."""

    def step(self, sensors, command, dt):
        """Never asked."""


def test_a_law_that_fails_is_named_and_left_out():
    command = Command(0.1, 0.5, 0.2)
    assert NacelleLawGuard(Steady).step(SENSORS, command, DT) == (Command(0.1, 0.5, -deg(1.0)), "")
    failing = ((Raises, "ZeroDivisionError: no airspeed"), (Exits, "SystemExit: enough"), (NotFinite, "not finite"))
    for kind, words in failing:
        guard = NacelleLawGuard(kind)
        changed, failure = guard.step(SENSORS, command, DT)
        assert changed == command
        assert words in failure
        assert guard.step(SENSORS, command, DT) == (command, "")
        guard.reset()
        assert words in guard.step(SENSORS, command, DT)[1]


def test_laws_are_found_by_module_and_class():
    assert load_nacelle_law("programme") is None
    assert load_nacelle_law("automatic") is None
    factory = load_nacelle_law("rtsim.nacelle.automatic:ScheduledNacelle")
    assert factory is not None
    assert isinstance(factory(), ScheduledNacelle)
    for name, words in (
        ("manual", "is not a nacelle law"),
        ("no_such_module_here:Law", "there is no module no_such_module_here"),
        ("math:pi", "no class with a method step"),
        ("rtsim.nacelle.automatic:ScheduledNacele", "'ScheduledNacelle' is meant"),
        (":Law", "is half a name"),
        (f"{__name__}:Missing", "has no class Missing"),
    ):
        with pytest.raises(InputError, match=words):
            load_nacelle_law(name)
    made = load_nacelle_law(f"{__name__}:NeedsMore")
    assert made is not None
    with pytest.raises(InputError, match="cannot be made"):
        made()


def test_laws_of_installed_packages_are_found_by_name(monkeypatch):
    point = EntryPoint("table", "rtsim.nacelle.automatic:ScheduledNacelle", NACELLE_PLUGIN.entry_point_group)
    monkeypatch.setattr(plugins, "entry_points", lambda group: [point] if group == point.group else [])
    factory = load_nacelle_law("table")
    assert factory is not None
    assert isinstance(factory(), ScheduledNacelle)
    assert parsed('"table"').options.nacelle == "table"
