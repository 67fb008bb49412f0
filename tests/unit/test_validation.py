"""The declared checks and what is made of them: verdicts, sources, texts, the command."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from rtsim.cli.main import run
from rtsim.validation.bench import Bench, the_bench
from rtsim.validation.check import Series, both_ways
from rtsim.validation.declared import GROUPS, all_checks
from rtsim.validation.document import SENSITIVITY_TITLE
from rtsim.validation.markup import Grid, Heading, Paragraph, markdown, page
from rtsim.validation.published import GRADES, Number, Table, published_data
from rtsim.validation.run import Validation
from rtsim.validation.sensitivity import UNCERTAIN
from rtsim.validation.summary import band_text, series_row

PAGE = (Path(__file__).parents[2] / "docs" / "validation.md").read_text(encoding="utf-8")
SERIES = Series(name="group.thing", quantity="thing", unit="kn", decimals=1, reason="told")


def declared(value=100.0, **words):
    number = Number(value, "table.key[0]", "SOURCE fig 1", "F")
    return SERIES.check("a", "nacelle 90, 10 kn", lambda _: 0.0, number=number, band_from="ours", **words)


@pytest.mark.parametrize(
    ("words", "value", "status"),
    [
        ({"absolute": both_ways(5.0)}, 105.0, "holds"),
        ({"absolute": both_ways(5.0)}, 105.04, "holds"),  # judged as shown
        ({"absolute": both_ways(5.0)}, 105.1, "misses"),
        ({"relative": (-0.1, 0.2)}, 120.0, "holds"),
        ({"relative": (-0.1, 0.2)}, 89.9, "misses"),
        ({"limits": (90.0, math.inf)}, 1e9, "holds"),
        ({"limits": (90.0, math.inf)}, 89.9, "misses"),
        ({"absolute": both_ways(5.0)}, math.nan, "misses"),
        ({}, 5.0, "reported"),
        ({"absolute": both_ways(5.0), "outside": "why"}, 500.0, "outside"),
    ],
)
def test_verdicts(words, value, status):
    result = declared(**words).judged(value)
    assert result.status == status
    answer = result.to_json()
    assert answer["holds"] is {"holds": True, "misses": False}.get(status)
    assert answer["reason"] == {"misses": "told", "reported": "told", "outside": "why"}.get(status, "")
    assert answer["value"] is None if math.isnan(value) else answer["value"] == round(value, 1)


def test_relative_band_of_a_negative_number_is_in_order():
    assert declared(-2.0, relative=both_ways(0.5)).band == (-3.0, -1.0)


def test_every_published_number_stands_where_it_says():
    """So that any number of the page can be traced to its source."""
    for check in all_checks():
        if not check.place:
            continue
        table, key, index = re.fullmatch(r"(.+)\.(\w+?)(?:\[(\d+)\])?", check.place).groups()
        value = Table(table).content[key]
        printed = float(value if index is None else value[int(index)])
        assert check.published == pytest.approx(
            printed * (1e6 if check.unit == "1e-6" else 1.0) * solidity(check), rel=1e-5
        )


def solidity(check):
    return 1.0 / 0.089 if check.id == "rotor.stall.tested" else 1.0


def test_every_check_is_named_once_and_names_a_known_source():
    checks = all_checks()
    assert len({check.id for check in checks}) == len(checks) > 400
    codes = {*published_data()["sources"], "none", "requirement"}
    for check in checks:
        assert check.group in GROUPS
        assert check.grade in {*GRADES.values(), "-"}, check.id
        words = re.findall(r"[A-Za-z]+-?\d*", check.source.replace("-", ""))
        assert {code.replace("-", "") for code in codes} & set(words), (check.id, check.source)
        assert check.band is None or check.band_from, check.id


def test_bands_say_whether_they_are_printed():
    assert {check.band_from for check in all_checks()} == {"printed", "ours", ""}


@pytest.mark.parametrize(("place", "uncertain"), list(enumerate(UNCERTAIN)), ids=lambda one: getattr(one, "name", None))
def test_uncertain_inputs_exist_and_move_something(place, uncertain):
    """The value lies in its range, and the page shows that at least one check moves."""
    value = uncertain.value()
    if not uncertain.share and type(value) is float:
        assert uncertain.low <= value <= uncertain.high
    section = PAGE.split(f"## {SENSITIVITY_TITLE}")[1]
    cells = [
        row.split(" | ")[2 + place] for row in section.splitlines() if row.startswith("| `") and row.count("|") > 8
    ]
    assert len(cells) > 400
    assert any(cell.strip(" |") != "·" for cell in cells)


def test_series_in_one_row():
    results = tuple(declared(absolute=both_ways(5.0)).judged(value) for value in (101.0, 107.0))
    row = series_row(results)
    assert row.verdict == "misses 1 of 2"
    assert row.band == "±5 kn; ours"
    assert row.found == "+1.0 to +7.0 kn"
    assert band_text(results[0].check) == "95.0 to 105.0"
    assert Validation(results).counts() == {"holds": 1, "misses": 1, "reported": 0, "outside": 0}


def test_one_document_two_markups():
    blocks = [Heading("Title", 1), Paragraph("with `code` & **stress**"), Grid(("a", "b"), (("x|y", "misses 1 of 2"),))]
    assert (
        markdown(blocks)
        == "# Title\n\nwith `code` & **stress**\n\n| a | b |\n| --- | --- |\n| x\\|y | misses 1 of 2 |\n"
    )
    text = page(blocks, {}, title="T")
    assert "<code>code</code> &amp; <b>stress</b>" in text
    assert '<td class="misses">misses 1 of 2</td>' in text


def test_steady_climb_takes_the_power_asked_for():
    """At the power of level flight the rate of climb is zero, and more power climbs."""
    bench = the_bench()
    level = bench.level(80.0, 75.0).power_shp
    assert bench.climb(80.0, 75.0, level) == pytest.approx(0.0, abs=1.0)
    # A hundred horsepower more lift 13000 lb at 254 ft/min, but for what changes with attitude.
    assert bench.climb(80.0, 75.0, level + 100.0) == pytest.approx(254.0, rel=0.3)


def test_loads_add_up():
    """Rotor total and airframe are all that the model has, however it books pylons and spinners: level flight."""
    loads = the_bench().loads(60.0)
    weight = 13000.0
    total = loads["rotor total"] + loads["airframe"]
    assert math.hypot(total[0], total[1]) == pytest.approx(weight, rel=1e-3)
    assert total[2] == pytest.approx(0.0, abs=0.1)


def test_no_rotor_wake_at_the_tail_is_a_change_of_the_tail_alone():
    bare = Bench({}).without_tail_wake
    assert bare.level(40.0, 75.0).flapping_deg < the_bench().level(40.0, 75.0).flapping_deg - 0.5
    assert bare.hover.power_shp == pytest.approx(the_bench().hover.power_shp, rel=0.02)


def test_command_refuses_a_file(tmp_path, capsys):
    (tmp_path / "taken").write_text("x")
    assert run(["validate", "--out", str(tmp_path / "taken")]) != 0
    assert "taken" in capsys.readouterr().err
