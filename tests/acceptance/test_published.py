"""The nonlinear XV-15 against every published number: the checks that ``rtsim validate`` runs, each with its source.

A check holds, or it is a known miss whose number is held too: ``tests/data/known_misses.toml``, written, like
docs/validation.md, by ``python -m docs.validation``. Bands are printed, or were chosen before the model ran.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from pathlib import Path

import pytest

from rtsim.validation.bench import the_bench
from rtsim.validation.contradictions import contradictions
from rtsim.validation.declared import all_checks
from rtsim.validation.document import SENSITIVITY_TITLE, document
from rtsim.validation.markup import markdown
from rtsim.validation.plots import FIGURES
from rtsim.validation.report import write_report
from rtsim.validation.run import frozen, measured, validate
from rtsim.validation.sensitivity import UNCERTAIN, sensitivity

ROOT = Path(__file__).parents[2]
MISSES = tomllib.loads((ROOT / "tests" / "data" / "known_misses.toml").read_text(encoding="utf-8"))
PAGE = (ROOT / "docs" / "validation.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("check", all_checks(), ids=lambda check: check.id)
def test_check(check):
    result = check.judged(check.measure(the_bench()))
    known = MISSES.get(check.id)
    if known is None:
        assert result.status != "misses", (result.value, check.band, check.published)
    elif known == "none":
        assert math.isnan(result.value)
    else:
        assert result.status == "misses"
        assert result.value == pytest.approx(known, abs=2.0 * 10.0**-check.decimals)


def test_known_misses_are_checks_with_a_band():
    banded = {check.id for check in all_checks() if check.band is not None and not check.outside}
    assert set(MISSES) <= banded


@pytest.mark.slow
def test_the_page_is_what_the_command_writes():
    """Bit for bit; the sensitivity, which takes minutes, by a sample below."""
    before, after = markdown(document(validate(), contradictions(the_bench()), None)).split("\n## Sources\n")
    assert PAGE.split(f"\n## {SENSITIVITY_TITLE}\n")[0] == before.rstrip("\n") + "\n"
    assert PAGE.split("\n## Sources\n")[1] == after
    assert all((ROOT / "docs" / "figures" / f"{figure.stem}.png").is_file() for figure in FIGURES)


@pytest.mark.slow
def test_report_is_whole(tmp_path, monkeypatch):
    """JSON, page and pictures, of which two are enough here."""
    for module in ("plots", "document", "report"):
        monkeypatch.setattr(f"rtsim.validation.{module}.FIGURES", FIGURES[-2:])
    report = write_report(tmp_path / "new", jobs=1)
    answer = json.loads((tmp_path / "new" / "validation.json").read_text(encoding="utf-8"))
    assert answer == json.loads(json.dumps(report.to_json()))
    assert len(answer["checks"]) == sum(answer["counts"].values()) == len(all_checks())
    keys = {"id", "quantity", "source", "grade", "condition", "band", "value", "holds", "reason"}
    assert all(keys <= set(check) for check in answer["checks"])
    page = report.page.read_text(encoding="utf-8")
    assert page.count("<img ") == 2
    assert 'src="http' not in page
    assert sorted(path.suffix for path in report.pictures) == [".png", ".png", ".svg", ".svg"]
    assert all(path.stat().st_size > 1000 for path in report.pictures)


@pytest.mark.parametrize("name", ["pitch inertia", "hub spring"])
def test_sensitivity_of_the_page(name):
    """The column of one input for one group is what the model gives."""
    place, uncertain = next((i, one) for i, one in enumerate(UNCERTAIN) if one.name == name)
    base = validate(groups=["dynamics"])
    ends = [measured("dynamics", frozen(uncertain.changes(end))) for end in (uncertain.low, uncertain.high)]
    moved = 0
    for result, low, high in zip(base.results, *ends, strict=True):
        row = re.search(
            rf"^\| `{re.escape(result.check.id)}` \|(.*)\|$", PAGE.split(SENSITIVITY_TITLE)[1], re.MULTILINE
        )
        cell = row.group(1).split("|")[1 + place].strip().replace("*", "")
        changes = [round(value - result.value, result.check.decimals) for value in (low, high)]
        if cell == "·":
            assert changes == [0.0, 0.0]
        else:
            assert [float(part) for part in cell.split(" / ")] == changes
            moved += 1
    assert moved > 0


def test_sensitivity_tells_which_verdicts_turn(monkeypatch):
    """Half the hub spring leaves the hover sensitivity in its band; a check whose band it leaves is marked."""
    monkeypatch.setattr("rtsim.validation.sensitivity.CHANGED_GROUPS", ("dynamics",))
    base = validate(groups=["dynamics"])
    spring = next(one for one in UNCERTAIN if one.name == "hub spring")
    found = sensitivity(base, inputs=(spring,))
    low, high = found.moved["dynamics.hover.sensitivity"][0]
    assert low.change < 0.0 < high.change
    turned = {name for name, row in found.moved.items() if row[0][0].turned or row[0][1].turned}
    assert set(found.turned(0)) == turned
    assert found.to_json()["values"]["dynamics.hover.sensitivity"][0] == [low.value, high.value]
