"""How the processes beside the flight are started: same interpreter, same packages, few threads."""

from __future__ import annotations

import os
from pathlib import Path


def child_environment() -> dict[str, str]:
    """The environment in which ``python -m telemetry...`` finds this very package, also from a source tree."""
    environment = dict(os.environ)
    root = str(Path(__file__).resolve().parents[2])
    paths = [root, *filter(None, environment.get("PYTHONPATH", "").split(os.pathsep))]
    environment["PYTHONPATH"] = os.pathsep.join(dict.fromkeys(paths))
    # A helper beside a 250 Hz loop must not spread numpy's or Arrow's thread pools over its cores.
    environment |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "ARROW_NUM_THREADS": "1"}
    return environment


def lower_priority() -> None:
    """Let the flight go first: nice 5 for the calling process."""
    if hasattr(os, "nice"):
        os.nice(5)
