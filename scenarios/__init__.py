"""Scenarios: flights declared as data, flown live or as fast as the machine allows, and judged.

``fly`` is what most programs need; ``load_scenario`` reads a file, ``replay_log`` flies a recording again.
Names are loaded when first used, so that importing this package stays cheap.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rtsim.measures.metrics import FlightMetrics, flight_metrics
    from scenarios.files.loader import library_names, load_scenario
    from scenarios.files.scenario import Scenario
    from scenarios.flight.replay import replay_log
    from scenarios.flight.result import FlightRecord
    from scenarios.flight.runner import fly

_HOME = {
    "FlightMetrics": "rtsim.measures.metrics",
    "FlightRecord": "scenarios.flight.result",
    "Scenario": "scenarios.files.scenario",
    "flight_metrics": "rtsim.measures.metrics",
    "fly": "scenarios.flight.runner",
    "library_names": "scenarios.files.loader",
    "load_scenario": "scenarios.files.loader",
    "replay_log": "scenarios.flight.replay",
}

__all__ = [
    "FlightMetrics",
    "FlightRecord",
    "Scenario",
    "flight_metrics",
    "fly",
    "library_names",
    "load_scenario",
    "replay_log",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'scenarios' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)
