"""What a finished search hands to people: the best path as a scenario, beside the paper's paths.

Legend:
    problem: What was searched.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from rtsim.loop.options import CONDITION, declared
from rtsim.measures.metrics import OBJECTIVES, FlightFigures, objective_value
from rtsim.optimization.batch import BatchFlight, BatchFlyer
from rtsim.optimization.path import ConversionPath
from rtsim.optimization.problem import ConversionProblem
from rtsim.optimization.search import SearchResult


def best_path(problem: ConversionProblem, result: SearchResult) -> ConversionPath:
    """The best path with a description of what it is.

    Args:
        result: What was found.
    """
    spec = problem.spec
    values = ", ".join(f"{name} {value:.6g}" for name, value in zip(spec.objectives, result.objectives, strict=True))
    search = spec.search
    robust = f", over {spec.robust.flights} flights in turbulence" if spec.robust.flights else ""
    text = (
        f"Found by {search.method}, seed {search.seed}, {result.generations} x {search.population} candidates{robust}: "
        f"{values}. Nacelle rate {spec.nacelle_rate_deg_s:g} deg/s."
    )
    return dataclasses.replace(problem.path(result.best), description=text)


def scenario_text(problem: ConversionProblem, path: ConversionPath) -> str:
    """The scenario file of a path found: it flies exactly as the search flew it, but for turbulence and pilot noise.

    Args:
        path: The path.
    """
    spec = problem.spec
    # What a robust search asked for in turbulence is all that is known to hold; in calm air it holds all the more.
    limits = spec.robust if spec.robust.flights else spec.limits
    flown = problem.setup.options
    said = ("plant", "outer_loop", "rate_hz", *(("database",) if flown.database else ()))
    said += tuple(declared()[name].key for name in CONDITION if getattr(flown, name) != declared()[name].default)
    flight = {"corridor": flown.corridor_name, **{key: flown.shown()[key] for key in said}}
    expectations = (
        ("keeps its distance to the corridor's boundaries", "corridor.worst_margin_kt", limits.margin_kt, None),
        ("holds altitude", "altitude_m.max_deviation", None, limits.altitude_m),
        ("follows the airspeed reference", "airspeed_kt.max_error", None, limits.airspeed_error_kt),
        ("flapping stays below its limit", "flapping_deg.peak", None, limits.flapping_deg),
        ("no control reaches its stop", "controls_on_stop_frames", None, 0.0),
    )
    return path.to_scenario_toml(flight=flight, altitude_m=spec.flight.altitude_m, expectations=expectations)


def baseline_summary(problem: ConversionProblem) -> dict[str, dict[str, Any]]:
    """The paper's paths within the same constraint set: objectives, and whether they keep the limits."""
    paths = problem.baselines()
    summary: dict[str, dict[str, Any]] = {}
    for (name, path), figures in zip(paths.items(), problem.fly(list(paths.values())), strict=True):
        objectives, constraints = problem.worth(path, figures)
        summary[name] = {
            "value": objectives[0],
            "objectives": dict(zip(problem.spec.objectives, objectives, strict=True)),
            "feasible": max(constraints) <= 0.0,
            "duration_s": figures[0].duration_s,
        }
    return summary


def nonlinear_check(problem: ConversionProblem, path: ConversionPath) -> FlightFigures:
    """The path flown once in calm air by the nonlinear model, which the search does not use.

    Args:
        path: The path.
    """
    altitude = problem.spec.flight.altitude_m
    setup = dataclasses.replace(
        problem.setup.with_options(plant="nonlinear", pilot_noise=False),
        programme=path.programme(altitude),
        air=type(problem.setup.air)(),
    )
    return BatchFlyer(setup, workers=1).fly_one(BatchFlight(path.programme(altitude)))


def figures_summary(figures: FlightFigures) -> dict[str, Any]:
    """Figures of merit with every objective, for JSON.

    Args:
        figures: The flight.
    """
    return {
        **figures.asdict(),
        "objectives": {name: objective_value(figures, name) for name in OBJECTIVES},
    }
