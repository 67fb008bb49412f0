"""Envelope protection: margin monitor, boundaries, laws compiled and in Python.

The names below are loaded when first used: laws need numba, and the command line must start without it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rtsim.protection.boundary import check_consistency, load_boundary
    from rtsim.protection.chain import LawChain, LawEvent, compiled_law
    from rtsim.protection.laws import BuiltInLaw, LawSpec, load_law, load_laws
    from rtsim.protection.limits import LIMIT_KINDS, Limits, load_limits
    from rtsim.protection.monitor import MarginHistory, MarginMonitor, Reading
    from rtsim.protection.monitor_kernels import LIMIT_WORDS
    from rtsim.protection.tables import LAW_NAMES, law_tables

_HOME = {
    "check_consistency": "boundary",
    "load_boundary": "boundary",
    "LawChain": "chain",
    "LawEvent": "chain",
    "compiled_law": "chain",
    "BuiltInLaw": "laws",
    "LawSpec": "laws",
    "load_law": "laws",
    "load_laws": "laws",
    "LIMIT_KINDS": "limits",
    "LIMIT_WORDS": "monitor_kernels",
    "Limits": "limits",
    "load_limits": "limits",
    "MarginHistory": "monitor",
    "MarginMonitor": "monitor",
    "Reading": "monitor",
    "LAW_NAMES": "tables",
    "law_tables": "tables",
}

__all__ = [
    "LAW_NAMES",
    "LIMIT_KINDS",
    "LIMIT_WORDS",
    "BuiltInLaw",
    "LawChain",
    "LawEvent",
    "LawSpec",
    "Limits",
    "MarginHistory",
    "MarginMonitor",
    "Reading",
    "check_consistency",
    "compiled_law",
    "law_tables",
    "load_boundary",
    "load_law",
    "load_laws",
    "load_limits",
]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"rtsim.protection.{_HOME[name]}"), name)
