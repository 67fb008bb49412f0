"""The pilot model against cases solved by an independent reference, and against NASA CR-163593 table IV."""

from __future__ import annotations

from pathlib import Path

import pytest

from rtsim.pilot.cases import Case, compare_results, design_results, load_cases
from rtsim.pilot.design import design_problem
from rtsim.pilot.problem import MocmError

FILE = load_cases(Path(__file__).parents[1] / "data" / "mocm_cases.toml")
SOLVED = [case for case in FILE.cases if case.kind == "case"]
REFUSED = [case for case in FILE.cases if case.kind == "reject"]


def test_the_file_holds_all_its_cases() -> None:
    assert len(SOLVED) == 7
    assert len(REFUSED) == 14


@pytest.mark.parametrize("case", SOLVED, ids=lambda case: case.name)
def test_solved_case(case: Case) -> None:
    results = design_results(design_problem(case.problem()))
    comparisons = compare_results(results, case.expect, tolerance=FILE.tolerance)
    assert {comparison.key for comparison in comparisons} >= {"g", "T_n", "l_plant", "F_plant", "Yp_re", "gain_margin"}
    for comparison in comparisons:
        assert comparison.held, comparison


def test_published_rms_of_the_b1_in_gusts() -> None:
    case = FILE.find("b1_gust")
    results = design_results(design_problem(case.problem()))
    comparisons = compare_results(results, case.published, tolerance=float(case.published["tol"]))
    assert [comparison.key for comparison in comparisons] == ["rms_y", "rms_delta"]
    assert all(comparison.held for comparison in comparisons), comparisons


@pytest.mark.parametrize("case", REFUSED, ids=lambda case: case.name)
def test_refused_case(case: Case) -> None:
    with pytest.raises(MocmError) as refusal:
        design_problem(case.problem())
    assert refusal.value.code == case.code


@pytest.mark.parametrize(
    ("pole", "attention", "held"),
    [(1.0, 0.2, True), (1.0, 0.1, False), (2.5, 1.0, True), (2.5, 0.5, False), (3.0, 1.0, False)],
)
def test_where_multiplicative_noise_makes_a_plant_unholdable(pole: float, attention: float, held: bool) -> None:
    """1/(s - pole) with delay 0.2 s, lag 0.1 s and -20 dB: the limits the reference found."""
    fields = FILE.find("unstable").fields | {"A": [[-2.0, 0], [1, pole]], "C": [[0, 1.0], [1, pole]], "f": [attention]}
    case = Case("pole", "case", "", fields, {}, {}, None)
    if held:
        assert design_problem(case.problem()).statistics.rms_y[0] > 0.0
        return
    with pytest.raises(MocmError) as refusal:
        design_problem(case.problem())
    assert refusal.value.code == "E_REMNANT_DIVERGES"
