"""The parts of a search: specification, methods, ranking, fronts, records. Analytic problems, no flights."""

from __future__ import annotations

import importlib
import io
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtsim.errors import InputError, OutputError
from rtsim.measures.metrics import OBJECTIVES
from rtsim.optimization.methods import (
    Penalty,
    feasibility_order,
    make_method,
    strewn_about,
    total_violation,
)
from rtsim.optimization.paths import PATH_NAMES
from rtsim.optimization.problem import CONSTRAINTS, Evaluation
from rtsim.optimization.search import Archive, Record, fingerprint, nondominated
from rtsim.optimization.spec import Objective, SearchSpec, checked_spec, load_spec, spec_like

STARTS = np.array([[0.7, 0.7], [0.9, 0.4]])


def sphere(x):
    """Least at (0.2, 0.3), where x0 >= 0.4 is asked for: the best allowed point is (0.4, 0.3)."""
    objective = (x[:, :1] - 0.2) ** 2 + (x[:, 1:] - 0.3) ** 2
    constraints = -np.ones((len(x), len(CONSTRAINTS)))
    constraints[:, 1] = 0.4 - x[:, 0]
    return objective, constraints


def search(name, *, seed=1, penalty=False, generations=40):
    method = make_method(
        name, STARTS, population=12, seed=seed, penalty=penalty, objectives=1, constraints=len(CONSTRAINTS)
    )
    archive = Archive()
    asked = []
    for _ in range(generations):
        x = method.ask()
        assert x.shape[1] == 2
        assert x.min() >= 0.0
        assert x.max() <= 1.0
        asked.append(x)
        objectives, constraints = sphere(x)
        archive.add(Evaluation(x, objectives, constraints))
        method.tell(objectives, constraints)
    return archive.result(seconds_per_generation=0.0, interrupted=False), np.concatenate(asked)


@pytest.mark.parametrize("penalty", [False, True])
@pytest.mark.parametrize("name", ["cma-es", "ga"])
def test_methods_find_the_best_point_on_a_constraint(name, penalty):
    result, asked = search(name, penalty=penalty)
    assert result.feasible
    assert result.best == pytest.approx([0.4, 0.3], abs=0.03)
    assert result.objectives[0] == pytest.approx(0.04, rel=0.05)
    assert np.array_equal(asked[:2], STARTS)
    finite = [value for value in result.history if np.isfinite(value)]
    assert finite == sorted(finite, reverse=True)


def test_each_method_is_the_one_that_was_named():
    shape = {"population": 8, "seed": 0, "penalty": False, "objectives": 1, "constraints": len(CONSTRAINTS)}
    for name, kind in (("ga", "GA"), ("nsga2", "NSGA2")):
        assert type(make_method(name, STARTS, **shape)._algorithm).__name__ == kind


@pytest.mark.parametrize("name", ["cma-es", "ga", "nsga2"])
def test_a_method_is_a_function_of_its_seed(name):
    _, first = search(name, generations=5)
    np.random.seed(123)  # noqa: NPY002 - numpy's global stream must not matter
    _, again = search(name, generations=5)
    _, other = search(name, seed=2, generations=5)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_cma_es_starts_anew_when_it_has_converged():
    result, asked = search("cma-es", generations=150)
    assert len(asked) == 12 * 150
    assert result.objectives[0] == pytest.approx(0.04, rel=1e-3)


def test_nsga2_spreads_over_the_front():
    starts = np.array([[0.5, 0.5]])
    method = make_method(
        "nsga2", starts, population=20, seed=0, penalty=False, objectives=2, constraints=len(CONSTRAINTS)
    )
    archive = Archive()
    for _ in range(40):
        x = method.ask()
        objectives = np.stack([x[:, 0] + x[:, 1], (1.0 - x[:, 0]) + x[:, 1]], axis=1)
        constraints = -np.ones((len(x), len(CONSTRAINTS)))
        archive.add(Evaluation(x, objectives, constraints))
        method.tell(objectives, constraints)
    front = archive.result(seconds_per_generation=0.0, interrupted=False).front
    first = [point.objectives[0] for point in front]
    assert first == sorted(first)
    assert first[0] < 0.1
    assert first[-1] > 0.9
    assert all(sum(point.objectives) < 1.3 for point in front)


def test_ranking_prefers_feasible_then_small_violation():
    objectives = np.array([5.0, 1.0, 3.0, 0.0])
    violation = np.array([0.0, 0.5, 0.0, 0.1])
    assert feasibility_order(objectives, violation).tolist() == [1.0, 3.0, 0.0, 2.0]
    assert total_violation(np.array([[1.0, -5.0, 2.0], [-1.0, -1.0, 0.0]])).tolist() == [3.0, 0.0]


def test_the_penalty_weight_is_set_once():
    penalty = Penalty()
    objectives = np.array([[2.0], [4.0], [6.0]])
    constraints = np.array([[0.5], [-1.0], [0.0]])
    assert penalty(objectives, constraints)[:, 0].tolist() == [2.0 + 40.0 * 0.5, 4.0, 6.0]
    assert penalty(10.0 * objectives, constraints)[0, 0] == 20.0 + 40.0 * 0.5


def test_first_generations_hold_the_starts_and_the_box():
    first = strewn_about(STARTS, 40, np.random.default_rng(0))
    assert first.shape == (40, 2)
    assert np.array_equal(first[:2], STARTS)
    assert first.min() >= 0.0
    assert first.max() <= 1.0
    assert len(strewn_about(STARTS, 1, np.random.default_rng(0))) == 1


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=1, max_size=30))
def test_nothing_beats_the_front_and_the_front_beats_the_rest(rows):
    objectives = np.array(rows, dtype=float)
    kept = set(nondominated(objectives).tolist())
    for k, row in enumerate(objectives):
        beaten = any((other <= row).all() and (other < row).any() for other in objectives)
        twin = any((other == row).all() for other in objectives[:k])
        assert (k in kept) == (not beaten and not twin)


def test_a_search_that_saw_nothing_has_no_result():
    with pytest.raises(InputError, match="ended before"):
        Archive().result(seconds_per_generation=0.0, interrupted=True)


def evaluation(seed=0):
    random = np.random.default_rng(seed)
    return Evaluation(random.random((3, 2)), random.random((3, 1)), random.random((3, 4)))


def test_a_record_reads_back_exactly(tmp_path):
    path = tmp_path / "a.search.npz"
    record = Record(path, "this search")
    record.add(evaluation(1))
    record.add(evaluation(2))
    back = Record(path, "this search").generations
    assert len(back) == 2
    for read, seed in zip(back, (1, 2), strict=True):
        for name in ("variables", "objectives", "constraints"):
            assert np.array_equal(getattr(read, name), getattr(evaluation(seed), name))
    assert [file.name for file in tmp_path.iterdir()] == ["a.search.npz"]


def test_a_record_of_another_search_is_refused(tmp_path):
    path = tmp_path / "a.search.npz"
    Record(path, "this search").add(evaluation())
    with pytest.raises(InputError, match="another search"):
        Record(path, "that search")
    with pytest.raises(OutputError, match="cannot be written"):
        Record(tmp_path / "missing" / "a.npz", "this search").add(evaluation())


def damaged_records(whole):
    yield b"not a record"
    yield b""
    yield whole[: len(whole) // 2]
    yield whole[:200] + bytes(64) + whole[264:]
    buffer = io.BytesIO()
    np.save(buffer, np.zeros(3))
    yield buffer.getvalue()
    for change in ({"format": 2}, {"sizes": np.array("x")}, {"variables": np.zeros(())}):
        buffer = io.BytesIO()
        np.savez(buffer, **(dict(np.load(io.BytesIO(whole))) | change))
        yield buffer.getvalue()


def test_damaged_records_are_told_in_a_sentence(tmp_path):
    path = tmp_path / "a.search.npz"
    Record(path, "this search").add(evaluation())
    for content in damaged_records(path.read_bytes()):
        path.write_bytes(content)
        with pytest.raises(InputError, match="record of a search") as told:
            Record(path, "this search")
        assert "pickle" not in str(told.value)
        assert not Record(path, "this search", resume=False).generations


def test_the_fingerprint_leaves_the_length_out():
    spec = SearchSpec()
    longer = checked_spec({"search": {"generations": 99}})
    other = checked_spec({"search": {"seed": 1}})
    assert fingerprint(spec, "h") == fingerprint(longer, "h")
    assert fingerprint(spec, "h") != fingerprint(other, "h")
    assert fingerprint(spec, "h") != fingerprint(spec, "g")


@pytest.mark.parametrize("name", PATH_NAMES)
def test_every_path_has_its_constraint_set(name):
    spec = spec_like(name)
    assert spec.name == f"best_like_{name}"
    assert spec.nacelle_rate_deg_s == (12.0 if name == "centre_line_variable" else 3.0)
    assert spec.acceleration.caps().airplane_kt_s == 5.0


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        ("points = '7'", "points", "must be a whole number"),
        ("points = true", "points", "must be a whole number"),
        ("[limits]\npitch_deg = true", "limits.pitch_deg", "must be a number"),
        ("[robust]\npilot_noise = 'no'", "robust.pilot_noise", "must be true or false"),
        ("search = 3", "search", "must be a table"),
        ("points = 0", "points", "1 to 30"),
        ("colour = 1", "colour", "not a known key"),
        ("[search]\nmethod = 'luck'", "search.method", "cma-es"),
        ("[search]\npopulation = 2", "search.population", "4 to 10000"),
        ("objectives = ['beauty']", "objectives[0]", "flapping_integral"),
        ("objectives = ['energy', 'energy']", "objectives", "twice"),
        ("objectives = ['energy', 'duration']", "search.method", "several objectives"),
        ("name = 'Not A Name'", "name", "pattern"),
        ("nacelle_rate_deg_s = 20", "nacelle_rate_deg_s", "12"),
        ("points = ", None, "not valid TOML"),
    ],
)
def test_mistakes_in_specifications_are_named(tmp_path, text, key, words):
    file = tmp_path / "spec.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_spec(file)
    assert caught.value.key == key
    assert words in str(caught.value)
    assert "spec.toml" in str(caught.value) or key in {"search.method", "objectives"}


def test_specifications_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        load_spec(tmp_path / "none.toml")
    with pytest.raises(InputError, match="is a directory"):
        load_spec(tmp_path)
    (tmp_path / "large.toml").write_text("#" * 1_100_000, encoding="utf-8")
    with pytest.raises(InputError, match="too large"):
        load_spec(tmp_path / "large.toml")
    with pytest.raises(InputError, match="is not a path"):
        spec_like("scenic")


def test_a_missing_package_is_named_with_its_extra(monkeypatch):
    real = importlib.import_module

    def without_cma(name, *rest):
        if name == "cma":
            raise ModuleNotFoundError("No module named 'cma'", name="cma")
        return real(name, *rest)

    monkeypatch.setattr(importlib, "import_module", without_cma)
    with pytest.raises(InputError, match=r"rtsim\[optimize\]"):
        make_method("cma-es", STARTS, population=8, seed=0, penalty=False, objectives=1, constraints=len(CONSTRAINTS))


def test_files_may_name_every_objective():
    """The schema spells the objectives out for the type checker; the table flies them."""
    assert set(get_args(Objective)) == set(OBJECTIVES)
