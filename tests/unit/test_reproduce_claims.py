"""The claims of the paper: each has its judge and its numbers, verdicts follow the numbers, the report is whole."""

from __future__ import annotations

import json
import math
import re
import string
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest

from rtsim.frame import SIGNAL_COUNT, SIGNAL_NAMES
from rtsim.optimization.paths import table_1
from scenarios.reproduction.claims import Claim, claim_texts
from scenarios.reproduction.evidence import centre_line_demand
from scenarios.reproduction.figures import FIGURES
from scenarios.reproduction.flights import BASELINE, VARIANTS, Flight, Flyer, paper_paths
from scenarios.reproduction.judges import JUDGES, PRINTED_TIMES
from scenarios.reproduction.measures import measure, table_1_times, trimmed_flapping
from scenarios.reproduction.report import report_html

REQUIRED = {
    "fig1_corridor", "fig2_grid", "fig3_pilot", "fig4_path", "fig5_early_peak", "fig6_map", "fig7_fast_side",
    "fig8_worse", "fig10_larger_oscillation", "fig12_collective_falls", "fig14_small_acceleration", "fig16_max_rate",
    "fig17_18_effort_time",
}  # fmt: skip


def test_every_claim_has_a_judge_and_every_judge_a_claim():
    ids = [text.id for text in claim_texts()]
    assert len(ids) == len(set(ids))
    assert set(ids) == set(JUDGES)
    assert set(ids) >= REQUIRED


def test_figures_are_all_eighteen_with_a_caption_each():
    assert [plan.number for plan in FIGURES] == list(range(1, 19))
    assert all(len(plan.caption) > 40 for plan in FIGURES)


def test_timing_rule_gives_the_printed_row_and_equation_5_does_not():
    by_hand = [0.0, 8.0, 40 / 3, 61 / 3, 80 / 3, 35.0, 41.25, 41.25 + 50 / 3, 45.25 + 50 / 3, 49.25 + 50 / 3]
    np.testing.assert_allclose(table_1_times(), by_hand, atol=1e-9)
    assert np.all(np.floor(table_1_times() * 10 + 1e-9) / 10 >= np.array(PRINTED_TIMES) - 1e-9)
    assert np.abs(table_1_times() - PRINTED_TIMES).max() < 0.101
    assert np.abs(table_1_times(rule="nacelle") - PRINTED_TIMES).max() > 5.0


def test_centre_line_demand_is_the_slope_of_the_corridor_times_the_acceleration():
    # From 45 to 0 deg the centre moves from 120.7 to 135.5 kn; its steepest stretch is a little steeper than the mean.
    mean = 45.0 / (135.5 - 120.7)
    assert mean < centre_line_demand(1.0) < 1.3 * mean
    assert centre_line_demand(4.0) == pytest.approx(4.0 * centre_line_demand(1.0))


def test_trimmed_flapping_agrees_with_the_published_ridge():
    upright = trimmed_flapping(np.arange(10.0, 80.0, 5.0), np.full(14, 90.0), 0.0)
    assert 25.0 <= 10.0 + 5.0 * int(np.argmax(upright)) <= 40.0
    assert upright.max() == pytest.approx(4.2, abs=1.0)


@pytest.fixture(scope="module")
def flight():
    return Flyer(BASELINE).fly("typical_3deg", table_1())


def test_measures_of_a_flight_are_those_of_its_rows(flight):
    found = measure(flight)
    flapping, time = flight["flapping_deg"], flight.time
    early = (time >= 3.0) & (time <= 30.0)
    assert found.completed
    assert found.early_peak_deg == flapping[early].max()
    assert found.early_peak_time_s == time[early][np.argmax(flapping[early])]
    assert found.time_to_170_kt_s == pytest.approx(63.9, abs=1.0)
    assert found.time_high_s == pytest.approx(np.count_nonzero(flapping > 3.0) / 250.0)
    assert 1.0 < found.collective_falls_until_s < 20.0
    assert found.rotor_speed_spread_rpm == 0.0


def test_oscillation_is_what_is_added_to_the_trim(flight):
    rows = flight.rows.copy()
    column = SIGNAL_NAMES.index("flapping_deg")
    rows[:, column] += 0.5 * np.sin(2 * np.pi * 2.0 * flight.time)
    louder = measure(Flight(flight.path, flight.programme, rows, ""))
    quiet = measure(flight)
    assert louder.oscillation_rms_deg == pytest.approx(np.hypot(quiet.oscillation_rms_deg, 0.5 / np.sqrt(2)), rel=0.02)
    assert rows.shape[1] == SIGNAL_COUNT


def test_a_flight_is_the_simulators_own(flight):
    from rtsim.loop.setup import FlightSetup
    from rtsim.loop.simulation import Simulation

    frames = Simulation(FlightSetup(programme=flight.programme)).run(2500)
    assert np.array_equal(frames, flight.rows[:2500], equal_nan=True)


def fake_evidence(**measures):
    return SimpleNamespace(measures={name: SimpleNamespace(**values) for name, values in measures.items()}, facts={})


def test_verdicts_follow_the_numbers():
    texts = {text.id: text for text in claim_texts()}
    judge, limits = JUDGES["fig14_small_acceleration"], texts["fig14_small_acceleration"].expected
    near = fake_evidence(centre_line={"centre_acceleration_kt_s": 1.25, "completed": True})
    far = fake_evidence(centre_line={"centre_acceleration_kt_s": 3.0, "completed": True})
    ended = fake_evidence(centre_line={"centre_acceleration_kt_s": 1.25, "completed": False})
    assert judge(near, limits)[0]
    assert not judge(far, limits)[0]
    assert not judge(ended, limits)[0]


def test_claim_says_with_whom_else_it_holds():
    text = next(text for text in claim_texts() if text.id == "fig4_path")
    claim = Claim(text, True, {}, {"A": True, "B": True, "C": False})
    assert claim.carried == "Holds with A and B too. Fails with C."
    assert Claim(text, False, {}, {"A": False}).carried == "Fails with every other aircraft model and pilot too."
    assert not Claim(text, True, {}, {}).carried


def test_what_was_never_reached_is_null_in_json():
    text = next(text for text in claim_texts() if text.id == "table1_170_kn_at_60_s")
    claim = Claim(text, False, {"time_to_170_kt_s": math.nan, "time_to_airplane_s": 58.6}, {})
    measured = json.loads(json.dumps(claim.to_json(), allow_nan=False))["measured"]
    assert measured == {"time_to_170_kt_s": None, "time_to_airplane_s": 58.6}


class _Checked(HTMLParser):
    def __init__(self):
        super().__init__()
        self.open, self.links, self.ids, self.sources = [], [], set(), []

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.links.append(values.get("href", ""))
        self.sources.append(values.get("src", ""))
        self.ids.add(values.get("id"))
        if tag not in {"meta", "br", "img"}:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_report_is_well_formed_and_needs_nothing_from_elsewhere(tmp_path, flight):
    picture = tmp_path / "figure_01.svg"
    picture.write_text("<svg/>", encoding="utf-8")
    text = next(text for text in claim_texts() if text.id == "text_rotor_speed")
    claims = (Claim(text, False, {"rotor_speed_rpm": 589.0, "spread_rpm": 3.0}, {"A <b>": True}),)
    study = SimpleNamespace(
        claims=claims,
        evidence={BASELINE.name: SimpleNamespace(measures={"typical_3deg": measure(flight)})},
        paths=paper_paths(),
        database_hash="abc",
    )
    page = report_html(study, FIGURES[:1], {1: [picture]}, version="0")
    checked = _Checked()
    checked.feed(page)
    assert checked.open == []
    assert "<script" not in page
    assert "A &lt;b&gt;" in page
    assert all(source.startswith("data:") for source in checked.sources if source)
    assert {link[1:] for link in checked.links if link} <= checked.ids
    assert "0 of 1 claims hold" in page
    # Narrow screens show a claim's cells one below the other, each with its name.
    assert all(f'data-name="{name}"' in page for name in ("claim", "measured", "verdict", "why"))


def test_templates_name_only_numbers_with_units_in_their_names():
    fields = {
        name
        for text in claim_texts()
        for template in (text.measured, text.holds, text.fails)
        for _, name, _, _ in string.Formatter().parse(template)
        if name
    }
    assert all(re.fullmatch(r"[a-z0-9_]+", name) for name in fields)
    assert VARIANTS[0] is BASELINE
