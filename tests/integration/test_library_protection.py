"""The library's trials of envelope protection: what each law does in them, on both aircraft, and that they can fail."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rtsim.frame import COLUMN
from scenarios.files.loader import library_names, load_scenario
from scenarios.verdicts import tester as verdict

TRIALS = [name for name in library_names() if name.startswith("ep")]
MISUSE = [name for name in TRIALS if load_scenario(name).trial.kind != "nominal"]


@pytest.fixture(scope="module")
def full():
    tester = verdict.Tester(law="full")
    return {name: tester.run(load_scenario(name)) for name in TRIALS}


@pytest.mark.parametrize("name", TRIALS)
def test_full_meets_every_clause(full, name):
    case = full[name]
    assert case.error == ""
    assert not case.failures, case.failures


def test_the_library_covers_every_kind_and_no_trial_is_vacuous(full):
    assert len(TRIALS) >= 20
    assert {case.kind for case in full.values()} == {"nominal", "misuse", "failure", "unprotectable"}
    for name in MISUSE:
        assert [item for item in full[name].findings if item.name.startswith("not vacuous")], name


def test_what_is_declared_unprotectable_does_leave_the_corridor(full):
    declared = [case for case in full.values() if case.kind == "unprotectable"]
    assert declared
    assert all(case.metrics["exceedances"] > 0 for case in declared)


def test_the_library_tells_the_laws_apart(full):
    misuse = [load_scenario(name) for name in MISUSE]
    failed = {}
    for law in ("off", "governor"):
        tester = verdict.Tester(law=law)
        failed[law] = {scenario.name for scenario in misuse if tester.run(scenario).verdict == "failed"}
    assert len(failed["off"]) >= len(misuse) - 2  # the two that are unprotectable ask no law to keep the corridor
    assert {"ep11_jam_60_accelerating", "ep12_jam_30_decelerating"} <= failed["governor"] < failed["off"]


def test_trials_are_judged_by_the_history_they_keep(full):
    for case in full.values():
        rows = case.off.rows
        margin = rows[:, COLUMN.margin_kt]
        assert case.off_metrics["worst_margin_kt"] == pytest.approx(margin.min())
        if case.off_metrics["exceedances"] > 0:
            assert case.off_metrics["depth_kt"] == pytest.approx(-margin.min())
        rotors = [COLUMN.flapping_deg, COLUMN.flapping_left_deg, COLUMN.flapping_right_deg]
        assert case.metrics["flapping_peak_deg"] == pytest.approx(case.flight.rows[:, rotors].max())
        share = np.sqrt(np.mean(case.flight.rows[:, COLUMN.protection_stick] ** 2))
        assert case.metrics["stick_authority_rms"] == pytest.approx(share, abs=1e-12)


def test_a_vacuous_trial_fails():
    scenario = load_scenario("ep04_wrong_nacelle_command")
    case = verdict.Tester(law="full").run(dataclasses.replace(scenario, pulses=()))
    assert {item.metric for item in case.failures} == {"off.corridor", "off.depth_kt"}


def test_a_law_that_does_harm_fails(tmp_path, monkeypatch):
    (tmp_path / "sinking_law.py").write_text(
        """
from dataclasses import replace

class Sink:
    def step(self, sensors, command, margins, dt):
        return replace(command, lever=max(0.0, command.lever - 0.35)), []
"""
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    case = verdict.Tester(law="sinking_law:Sink").run(load_scenario("ep04_wrong_nacelle_command"))
    assert "height_lost_m" in {item.metric for item in case.failures}


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "ep01_nominal_conversion",
        "ep04_wrong_nacelle_command",
        "ep09_power_chop",
        "ep12_jam_30_decelerating",
        "ep24_lateral_stick_held",
        "ep26_one_collective_stuck",
    ],
)
def test_no_harm_on_the_nonlinear_aircraft(name):
    case = verdict.Tester(law="full", plant="nonlinear").run(load_scenario(name))
    assert case.error == ""
    harm = {"height_lost_m", "new_violations", "exceedances"}
    assert not harm & {item.metric for item in case.failures}
