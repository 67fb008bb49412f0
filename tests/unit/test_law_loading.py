"""Laws by name: built in, MODULE:CLASS, entry points; what is refused and how."""

from __future__ import annotations

import dataclasses
import math
import pickle
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from rtsim import plugins
from rtsim.command import Command, Margins, ProtectionLaw, Sensors
from rtsim.errors import InputError
from rtsim.protection.chain import compiled_law
from rtsim.protection.laws import LAW_PLUGIN, BuiltInLaw, load_law, load_laws
from rtsim.units import INCH_POUND, deg, kt

GOOD = """
class Keep:
    def step(self, sensors, command, margins, dt):
        return command, []

class NoStep:
    pass

class Needs:
    def __init__(self, gain):
        self.gain = gain
    def step(self, sensors, command, margins, dt):
        return command, []
"""
MARGINS = Margins(10.0, 10.0, 0.5, 0.5)


def sensors(**changes):
    calm = Sensors(
        time=0.0, airspeed=kt(97.0), airspeed_rate=0.0, nacelle_angle=deg(50.0), nacelle_rate=0.0, pitch=deg(5.0),
        pitch_rate=0.0, flight_path_angle=0.0, altitude=200.0, climb_rate=0.0, load_factor=1.0,
        mast_torque=55000.0 * INCH_POUND, flapping=deg(2.0), on_downstop=False, nacelle_ok=True,
    )  # fmt: skip
    return dataclasses.replace(calm, **changes)


@pytest.fixture(autouse=True)
def own_laws(tmp_path, monkeypatch):
    (tmp_path / "own_laws.py").write_text(GOOD)
    (tmp_path / "broken_law.py").write_text("import no_such_package_anywhere\n")
    (tmp_path / "raising_law.py").write_text("raise RuntimeError('at import')\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))


@pytest.mark.parametrize("name", ["off", "monitor", "governor", "full"])
def test_built_in_laws_have_the_interface(name):
    spec = load_law(name)
    assert spec.built_in
    assert isinstance(spec.make(), ProtectionLaw)


def test_a_law_of_the_users_own():
    spec = load_law("own_laws:Keep")
    assert not spec.built_in
    first, second = spec.make(), spec.make()
    assert first is not second
    command = Command(0.1, 0.5, 0.0)
    assert first.step(sensors(), command, MARGINS, 0.02) == (command, [])


def test_a_spec_travels_to_a_worker():
    spec = load_law("own_laws:Keep")
    again = pickle.loads(pickle.dumps(spec))
    assert again == spec
    assert again.make().step(sensors(), Command(0.0, 0.5, 0.0), MARGINS, 0.02)[1] == []


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("governer", "'governor' is meant"),
        ("own_laws:Kept", "'Keep' is meant"),
        ("own_laws:NoStep", "no class with a method step"),
        ("no_module_here:Law", "there is no module no_module_here"),
        ("broken_law:Law", "needs no_such_package_anywhere"),
        ("raising_law:Law", "RuntimeError: at import"),
    ],
)
def test_what_is_no_law_is_refused_in_a_sentence(name, said):
    with pytest.raises(InputError, match=said):
        load_law(name)


def test_a_class_that_wants_arguments_is_refused_when_made():
    with pytest.raises(InputError, match="take no arguments"):
        load_law("own_laws:Needs").make()


def test_entry_points_are_found_by_name(monkeypatch):
    point = EntryPoint("soft", "own_laws:Keep", LAW_PLUGIN.entry_point_group)
    wrong = EntryPoint("gone", "own_laws_gone:Keep", LAW_PLUGIN.entry_point_group)
    monkeypatch.setattr(plugins, "entry_points", lambda group: [point, wrong] if group == point.group else [])
    assert load_law("soft").make().step(sensors(), Command(0.0, 0.5, 0.0), MARGINS, 0.02)[1] == []
    with pytest.raises(InputError, match="reinstall"):
        load_law("gone")


def test_chains():
    assert [law.name for law in load_laws("governor, own_laws:Keep")] == ["governor", "own_laws:Keep"]
    assert [law.name for law in load_laws(["off", "monitor"])] == ["monitor"]
    assert compiled_law(load_laws("full")) == "full"
    assert compiled_law(()) == "off"
    assert compiled_law(load_laws("own_laws:Keep")) is None
    assert compiled_law(load_laws("governor,full")) is None


def test_built_in_law_reports_what_it_did():
    law = BuiltInLaw("full")
    asked = Command(0.1, 0.3, -deg(7.5))
    for _ in range(20):
        limited, interventions = law.step(sensors(), asked, MARGINS, 0.02)
    rate = [item for item in interventions if item.channel == "nacelle_rate"]
    assert limited.nacelle_rate > asked.nacelle_rate
    assert [item.limit for item in rate] == ["stall_attitude"]
    assert rate[0].before == asked.nacelle_rate
    assert rate[0].after == limited.nacelle_rate
    assert math.isfinite(rate[0].margin)
    changed = {item.channel for item in interventions}
    assert ("lever" in changed) == (limited.lever != asked.lever)


@pytest.mark.parametrize(
    ("changes", "limit", "channel", "kind"),
    [
        ({"airspeed": kt(120.0), "mast_torque": 140000.0 * INCH_POUND}, "mast_torque", "lever", "clip"),
        ({"airspeed": kt(120.0), "climb_rate": -14.0}, "sink", "lever", "blend"),
        ({"airspeed": kt(110.0), "pitch": deg(20.0), "pitch_rate": deg(30.0)}, "pitch_attitude", "stick", "clip"),
    ],
)
def test_every_kind_of_limit_is_named(changes, limit, channel, kind):
    law = BuiltInLaw("full")
    found = []
    for _ in range(20):
        found += law.step(sensors(**changes), Command(-0.2, 0.45, 0.0), MARGINS, 0.02)[1]
    assert (limit, channel, kind) in {(item.limit, item.channel, item.kind) for item in found}
    worst = next(item for item in found if item.limit == limit)
    assert worst.margin <= deg(25.0)


def test_monitor_warns_and_changes_nothing():
    law = BuiltInLaw("monitor")
    asked = Command(0.1, 0.3, -deg(7.5))
    for _ in range(20):
        limited, interventions = law.step(sensors(airspeed_rate=-kt(3.0)), asked, MARGINS, 0.02)
    assert limited == asked
    assert [(item.kind, item.limit) for item in interventions] == [("warn", "stall_attitude")]
    assert interventions[0].time_to_limit < 5.0


def test_twin_of_a_built_in_law_goes_its_own_way():
    import copy

    law = BuiltInLaw("full")
    law.step(sensors(), Command(0.1, 0.3, -deg(7.5)), MARGINS, 0.02)
    twin = copy.deepcopy(law)
    assert twin._tables is law._tables
    for _ in range(10):
        law.step(sensors(), Command(0.1, 0.3, -deg(7.5)), MARGINS, 0.02)
    assert not np.array_equal(twin._state, law._state)
