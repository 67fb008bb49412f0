"""A search on a real Dask cluster of worker processes: the result of a local search, also when a worker dies."""

from __future__ import annotations

import os
import signal
import threading
import time

import numpy as np
import pytest

from rtsim.errors import InputError
from rtsim.optimization.cluster import ClusterEvaluator, evaluate_here
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
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
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

    with ClusterEvaluator(problem, cluster.scheduler_address) as evaluator:
        there = run_search(problem, evaluator=evaluator, on_progress=kill_one)
    killed[0].join()
    assert there.history == here.history
    assert np.array_equal(there.best, here.best)
    assert there.objectives == here.objectives
    assert [point.objectives for point in there.front] == [point.objectives for point in here.front]


def test_a_worker_evaluates_as_the_problem_does(problem):
    variables = np.full((2, problem.variables), 0.5)
    variables[1] = problem.encode(problem.baselines()["typical"])
    database_hash, objectives, constraints = evaluate_here(problem.spec.model_dump_json(), variables)
    here = problem.evaluate(variables)
    assert database_hash == problem.database_hash
    assert np.array_equal(objectives, here.objectives)
    assert np.array_equal(constraints, here.constraints)


def test_a_worker_with_another_database_is_refused(problem, cluster, monkeypatch):
    with ClusterEvaluator(problem, cluster.scheduler_address) as evaluator:
        monkeypatch.setattr(evaluator, "_hash", "another")
        with pytest.raises(InputError, match="another LPV database"):
            evaluator.evaluate(np.full((1, problem.variables), 0.5))


def test_nobody_at_the_address(problem, monkeypatch):
    monkeypatch.setattr("rtsim.optimization.cluster.CONNECT_TIMEOUT_S", 1)
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        ClusterEvaluator(problem, "tcp://127.0.0.1:1")


@pytest.mark.parametrize("address", ["nonsense", "nonsense://x:1", "tcp://127.0.0.1", "127.0.0.1:port", ""])
def test_what_is_no_address_is_told_at_once(problem, monkeypatch, address):
    def no_client(*_, **__):
        raise AssertionError

    monkeypatch.setattr("distributed.Client", no_client)
    with pytest.raises(InputError, match="is not the address of a Dask scheduler"):
        ClusterEvaluator(problem, address)
