"""Imports go one way and in no circle: import-linter holds pyproject.toml's contracts, and would notice a breach."""

from __future__ import annotations

import copy
from pathlib import Path

import grimp
import pytest
from importlinter.api import read_configuration
from importlinter.contracts.acyclic_siblings import AcyclicSiblingsContract
from importlinter.contracts.forbidden import ForbiddenContract
from importlinter.contracts.layers import LayersContract

CONFIGURATION = read_configuration(str(Path(__file__).parents[2] / "pyproject.toml"))
KINDS = {"layers": LayersContract, "forbidden": ForbiddenContract, "acyclic_siblings": AcyclicSiblingsContract}
SESSION = CONFIGURATION["session_options"]
CONTRACTS = {options["name"]: options for options in CONFIGURATION["contracts_options"]}


@pytest.fixture(scope="module")
def modules():
    """Every module of the project and what it imports, inside functions and for the type checker too."""
    graph = grimp.build_graph(*SESSION["root_packages"], cache_dir=None)
    assert len(graph.modules) > 250
    return graph


def held(name, graph):
    options = CONTRACTS[name]
    contract = KINDS[options["type"]](name, SESSION, options)
    return contract.check(copy.deepcopy(graph), verbose=False)


@pytest.mark.parametrize("name", CONTRACTS)
def test_contracts_hold(name, modules):
    check = held(name, modules)
    assert check.kept, f"run lint-imports to see where: {check.metadata}"


@pytest.mark.parametrize(
    ("start", "importer", "imported"),
    [
        ("A part of rtsim", "rtsim.corridor.boundaries", "rtsim.lpv.tables"),
        ("A part of rtsim", "rtsim.pilot.design", "rtsim.aids.design"),
        ("Flights are composed", "rtsim.loop.simulation", "telemetry.exchange.ring"),
        ("Flights are composed", "rtsim.analysis.handling", "scenarios.flight.runner"),
        ("Telemetry knows", "telemetry.log.reader", "rtsim.corridor.boundaries"),
        ("Scenarios do not", "scenarios.flight.runner", "rtsim.cli.output"),
        ("No circles", "rtsim.lpv.database", "rtsim.lpv.cells"),
        ("No circles", "scenarios.files.loader", "scenarios.flight.runner"),
        ("No circles", "telemetry.mavlink.services", "telemetry.mavlink.vehicle"),
    ],
)
def test_a_breach_would_be_found(start, importer, imported, modules):
    (name,) = [name for name in CONTRACTS if name.startswith(start)]
    graph = copy.deepcopy(modules)
    graph.add_import(importer=importer, imported=imported)
    assert not held(name, graph).kept


def test_a_part_without_a_place_would_be_found(modules):
    (name,) = [name for name in CONTRACTS if name.startswith("A part of rtsim")]
    graph = copy.deepcopy(modules)
    graph.add_module("rtsim.utils")
    assert not held(name, graph).kept
