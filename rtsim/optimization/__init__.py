"""The best conversion: paths as data, figures of merit in compiled batches, the search for the best path.

The names below are loaded when first used: flying candidates needs numba, and the command line must start without it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rtsim.optimization.batch import BatchFlight, BatchFlyer
    from rtsim.optimization.path import AccelerationCaps, ConversionPath, path_through
    from rtsim.optimization.paths import PATH_NAMES, paper_path
    from rtsim.optimization.problem import ConversionProblem
    from rtsim.optimization.search import SearchResult, run_search
    from rtsim.optimization.spec import SearchSpec, checked_spec, load_spec

_HOME = {
    "BatchFlight": "batch",
    "BatchFlyer": "batch",
    "AccelerationCaps": "path",
    "ConversionPath": "path",
    "path_through": "path",
    "PATH_NAMES": "paths",
    "paper_path": "paths",
    "ConversionProblem": "problem",
    "SearchResult": "search",
    "run_search": "search",
    "SearchSpec": "spec",
    "checked_spec": "spec",
    "load_spec": "spec",
}

__all__ = [
    "PATH_NAMES",
    "AccelerationCaps",
    "BatchFlight",
    "BatchFlyer",
    "ConversionPath",
    "ConversionProblem",
    "SearchResult",
    "SearchSpec",
    "checked_spec",
    "load_spec",
    "paper_path",
    "path_through",
    "run_search",
]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"rtsim.optimization.{_HOME[name]}"), name)
