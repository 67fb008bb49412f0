"""The virtual pilot: design by the Modified Optimal Control Model (MOCM), schedule over the corridor, online kernels.

Names are imported when first used, so that ``import rtsim.pilot`` costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rtsim.pilot.cases import load_cases
    from rtsim.pilot.design import MocmDesign, design_mocm, design_problem
    from rtsim.pilot.problem import MocmError, MocmProblem, build_problem

__all__ = [
    "MocmDesign",
    "MocmError",
    "MocmProblem",
    "build_problem",
    "design_mocm",
    "design_problem",
    "load_cases",
]

_HOME = {
    "MocmDesign": "rtsim.pilot.design",
    "MocmError": "rtsim.pilot.problem",
    "MocmProblem": "rtsim.pilot.problem",
    "build_problem": "rtsim.pilot.problem",
    "design_mocm": "rtsim.pilot.design",
    "design_problem": "rtsim.pilot.design",
    "load_cases": "rtsim.pilot.cases",
}


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOME[name]), name)
