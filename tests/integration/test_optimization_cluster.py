"""A search on a real Dask cluster of worker processes: the result of a local search, also when a worker dies."""

from __future__ import annotations

import os
import signal
import threading
import time

import numpy as np
import pytest

from rtsim.cluster.work import Cluster
from rtsim.lpv.files.storage import load_database
from rtsim.optimization.cluster import ClusterEvaluator, evaluate_here, search_identity
from rtsim.optimization.problem import ConversionProblem
from rtsim.optimization.search import run_search
from rtsim.optimization.spec import checked_spec

pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")


@pytest.fixture(scope="module")
def problem():
    return ConversionProblem(checked_spec({"search": {"generations": 3, "population": 8}}), workers=1)


@pytest.fixture(scope="module")
def cluster():
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0", host="127.0.0.1"
    ) as made:
        yield made


def test_a_search_on_a_cluster_ends_as_a_local_one_though_a_worker_is_killed(problem, cluster):
    here = run_search(problem)
    victims = [worker.pid for worker in cluster.workers.values()]
    killed = []

    def kill_one(progress):
        if progress.generation == 1:

            def later():
                time.sleep(0.3)  # into the next generation
                os.kill(victims[0], signal.SIGKILL)

            killed.append(threading.Thread(target=later))
            killed[0].start()

    with Cluster(cluster.scheduler_address, goes_on="") as connected:
        there = run_search(problem, evaluator=ClusterEvaluator(problem, connected), on_progress=kill_one)
    killed[0].join()
    assert there.history == here.history
    assert np.array_equal(there.best, here.best)
    assert there.objectives == here.objectives
    assert [point.objectives for point in there.front] == [point.objectives for point in here.front]


def test_a_worker_evaluates_as_the_problem_does(problem):
    variables = np.full((2, problem.variables), 0.5)
    variables[1] = problem.encode(problem.baselines()["typical"])
    objectives, constraints = evaluate_here(problem.spec.model_dump_json(), problem.database_hash, variables)
    here = problem.evaluate(variables)
    assert np.array_equal(objectives, here.objectives)
    assert np.array_equal(constraints, here.constraints)


def test_another_aircraft_has_another_identity(tmp_path):
    shipped, missing = search_identity(""), search_identity(str(tmp_path / "none.nc"))
    assert shipped == {"database": load_database().aircraft_hash}
    assert "does not exist" in missing["database"]


def test_a_database_that_changed_is_read_anew(problem, monkeypatch):
    made = []
    monkeypatch.setattr("rtsim.optimization.cluster.ConversionProblem", lambda spec, **_: made.append(spec) or problem)
    variables = np.full((1, problem.variables), 0.5)
    for aircraft_hash in ("before", "before", "after"):
        evaluate_here(problem.spec.model_dump_json(), aircraft_hash, variables)
    assert len(made) == 2
