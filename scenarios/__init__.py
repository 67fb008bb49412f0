"""Scenarios: flights declared as data, flown live or as fast as the machine allows, and judged.

``fly`` is what most programs need; ``load_scenario`` reads a file, ``replay_log`` flies a recording again.
Names are loaded when first used, so that importing this package stays cheap.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scenarios.loader import library_names, load_scenario
    from scenarios.metrics import FlightMetrics, flight_metrics
    from scenarios.record import FlightRecord
    from scenarios.replay import replay_log
    from scenarios.runner import fly
    from scenarios.scenario import Scenario

_HOME = {
    "FlightMetrics": "metrics",
    "FlightRecord": "record",
    "Scenario": "scenario",
    "flight_metrics": "metrics",
    "fly": "runner",
    "library_names": "loader",
    "load_scenario": "loader",
    "replay_log": "replay",
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
    return getattr(importlib.import_module(f"scenarios.{_HOME[name]}"), name)
