"""Checks of pilot-design input: defaults, refusals and signal names."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rtsim.errors import InputError
from rtsim.pilot.design import design_mocm, design_problem
from rtsim.pilot.problem import REFUSAL_CODES, MocmError, build_problem

BASE: dict[str, Any] = {
    "A": [[-2.0, 0, 0], [1, 0, 0], [0, 1, 0]], "B": [[0], [1.0], [0]], "C": [[0, 0, 1.0], [0, 1, 0]],
    "E": [[1.0], [0], [0]], "q_y": [1, 0], "tau_n": [0.1],
}  # fmt: skip
NAN, INF = float("nan"), float("inf")


def test_defaults() -> None:
    problem = build_problem(BASE)
    assert problem.tau.tolist() == [0.2]
    assert (problem.pade_order, problem.pade_kind) == (2, "pade")
    assert problem.rho_y.tolist() == [0.01, 0.01]
    assert problem.f.tolist() == [1.0, 1.0]
    assert problem.threshold.tolist() == [0.0, 0.0]
    assert problem.rho_u[0] == pytest.approx(10**-2.5)
    assert np.array_equal(problem.D, np.zeros((2, 1)))
    assert np.array_equal(problem.W, np.eye(1))
    assert problem.q_u.tolist() == [0.0]
    assert problem.freq.tolist() == [0.3, 1.0, 3.0, 10.0]
    assert problem.groups is None
    assert not problem.A.flags.writeable


def test_one_element_stands_for_all() -> None:
    problem = build_problem(BASE | {"f": 0.4, "threshold": [0.1], "q_y": 2})
    assert problem.f.tolist() == [0.4, 0.4]
    assert problem.threshold.tolist() == [0.1, 0.1]
    assert problem.q_y.tolist() == [2.0, 2.0]


@pytest.mark.parametrize(
    ("change", "code", "key"),
    [
        ({"A": [[1.0, 2.0]]}, "E_DIM", "A"),
        ({"A": [[1.0, 2.0], [1.0]]}, "E_DIM", "A"),
        ({"A": [["a"]]}, "E_DIM", "A"),
        ({"A": 3.0}, "E_DIM", "A"),
        ({"A": None}, "E_DIM", "A"),
        ({"B": [[0], [1.0]]}, "E_DIM", "B"),
        ({"C": [[0, 1.0]]}, "E_DIM", "C"),
        ({"D": [[0, 1.0]]}, "E_DIM", "D"),
        ({"E": [[1.0]]}, "E_DIM", "E"),
        ({"E": None}, "E_DIM", "E"),
        ({"W": [[1.0, 0.0], [0.0, 1.0]]}, "E_DIM", "W"),
        ({"q_y": None}, "E_DIM", "q_y"),
        ({"f": [1.0, 1.0, 1.0]}, "E_DIM", "f"),
        ({"tau_n": [0.1, 0.1]}, "E_DIM", "tau_n"),
        ({"groups": [0]}, "E_DIM", "groups"),
        ({"groups": [0.5, 1]}, "E_DIM", "groups"),
        ({"freq": [0.0]}, "E_DIM", "freq"),
        ({"A": [[NAN, 0, 0], [1, 0, 0], [0, 1, 0]]}, "E_NONFINITE", "A"),
        ({"rho_y": [INF]}, "E_NONFINITE", "rho_y"),
        ({"tau_n": [NAN]}, "E_NONFINITE", "tau_n"),
        ({"tau": -0.1}, "E_TAU", "tau"),
        ({"tau_n": None}, "E_TAU_N", "tau_n"),
        ({"g": [1.0]}, "E_TAU_N", "tau_n"),
        ({"tau_n": [0.0]}, "E_TAU_N", "tau_n"),
        ({"pade_order": 3}, "E_PADE", "pade_order"),
        ({"pade_order": 1.5}, "E_PADE", "pade_order"),
        ({"pade_kind": "bessel"}, "E_PADE", "pade_kind"),
        ({"f": [1.1]}, "E_ATTENTION", "f"),
        ({"f": [-0.1, 1.0]}, "E_ATTENTION", "f"),
        ({"f": 0.0}, "E_ATTENTION", "f"),
        ({"f": 0.6, "groups": [1, 2]}, "E_ATTENTION", "f"),
        ({"f": [0.5, 0.4], "groups": [1, 1]}, "E_ATTENTION", "f"),
        ({"rho_y": 0.0}, "E_NOISE_RATIO", "rho_y"),
        ({"rho_u": -1e-3}, "E_NOISE_RATIO", "rho_u"),
        ({"threshold": -0.1}, "E_THRESHOLD", "threshold"),
        ({"q_y": [-1.0, 1.0]}, "E_WEIGHT", "q_y"),
        ({"q_y": [0.0]}, "E_WEIGHT", "q_y"),
        ({"q_u": [-1.0]}, "E_WEIGHT", "q_u"),
        ({"tau_n": None, "g": [0.0]}, "E_WEIGHT", "g"),
        ({"W": [[0.0]]}, "E_NO_EXCITATION", "W"),
        ({"W": [[-1.0]]}, "E_NO_EXCITATION", "W"),
        ({"E": [[0.0], [0.0], [0.0]]}, "E_NO_EXCITATION", "W"),
    ],
)
def test_refused_values(change: dict[str, Any], code: str, key: str) -> None:
    with pytest.raises(MocmError) as refusal:
        build_problem(BASE | change)
    assert (refusal.value.code, refusal.value.key) == (code, key)
    assert code in REFUSAL_CODES
    assert refusal.value.exit_code == 2


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"A": [[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]}, "E_NOT_STABILISABLE"),  # disturbance filter on the axis
        ({"q_y": [0, 1]}, "E_NOT_WEIGHTED"),  # position integrator with only its rate weighted
        ({"f": [0.0, 1.0]}, "E_NOT_DETECTABLE"),
        # two hands, one weighted display: their difference is an integrator of the regulator that nothing sees
        ({"B": [[0, 0], [1.0, 2.0], [0, 0]], "tau_n": [0.1, 0.1]}, "E_NOT_WEIGHTED"),
        # without motor noise a double integrator that no disturbance reaches has no filter
        ({"A": [[-2.0, 0, 0], [0, 0, 0], [0, 1, 0]], "rho_u": 0.0}, "E_NO_EXCITATION"),
    ],
)
def test_refused_plants(change: dict[str, Any], code: str) -> None:
    with pytest.raises(MocmError) as refusal:
        design_problem(build_problem(BASE | change))
    assert refusal.value.code == code


def test_lag_of_two_hands_on_an_unstable_plant_can_be_out_of_reach() -> None:
    fields = {
        "A": np.diag([2.0, 1.5]), "B": np.eye(2), "C": np.eye(2), "E": np.eye(2), "q_y": 1.0, "tau_n": [0.1, 0.4],
    }  # fmt: skip
    with pytest.raises(MocmError) as refusal:
        design_problem(build_problem(fields))
    assert refusal.value.code == "E_TAU_N_UNREACHABLE"


def test_unknown_field_is_named() -> None:
    with pytest.raises(InputError, match="tau_m") as refusal:
        build_problem(BASE | {"tau_m": 0.1})
    assert refusal.value.key == "tau_m"


def test_design_mocm_takes_arrays_and_named_systems_alike() -> None:
    import control

    a, c = np.array(BASE["A"]), np.array(BASE["C"])
    both = np.array([[0, 1.0], [1.0, 0], [0, 0]])
    system = control.ss(
        a, both, c, np.zeros((2, 2)), inputs=["stick", "gust"], outputs=["error", "rate"], states=["d", "v", "x"]
    )
    named = design_mocm(
        system, controls=["stick"], disturbances=["gust"], displays=["error", "rate"], display_weights=[1, 0]
    )
    default_controls = design_mocm(system, disturbances=["gust"], display_weights=[1, 0])
    arrays = design_mocm((a, both[:, :1], c), disturbance_matrix=both[:, 1:], display_weights=[1, 0])
    expected = design_problem(build_problem(BASE))
    for design in (named, default_controls, arrays):
        assert np.allclose(design.regulator.l, expected.regulator.l, rtol=1e-9)
        assert np.allclose(design.estimator.F, expected.estimator.F, rtol=1e-6)
    assert design_mocm(expected.problem).statistics.cost == pytest.approx(expected.statistics.cost, rel=1e-9)
    assert np.max(named.closed_loop_poles().real) < 0.0


def test_design_mocm_names_a_signal_that_is_not_there() -> None:
    import control

    system = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]], inputs=["stick"], outputs=["error"])
    with pytest.raises(InputError, match="lever"):
        design_mocm(system, controls=["lever"])
    with pytest.raises(MocmError, match="sampled"):
        design_mocm(control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], 0.1), disturbance_matrix=[[1.0]])
