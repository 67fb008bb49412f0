"""What the process beside a first flight compiles (``rtsim.loop.beside`` starts it): all but the flight's own half."""

from __future__ import annotations

import importlib
import math
import sys

import numpy as np

from rtsim.kernels.packed import packed
from rtsim.loop.data import PART, Flight
from rtsim.loop.loading import load_part
from rtsim.loop.setup import FlightSetup, build_parts, new_scratch, start_state
from rtsim.processes import end_with_parent
from rtsim.programme import Programme
from rtsim.protection.monitor import compile_watch


def main() -> None:
    """Compile the parts that are not the flight's own half."""
    end_with_parent()
    programme = Programme.hold(airspeed=0.0, nacelle_angle=math.pi / 2.0, altitude=100.0)
    setup = FlightSetup(programme=programme).with_options(protection="monitor")
    parts = build_parts(setup)
    state, addresses = start_state(setup, parts, np.zeros(3)), np.zeros(PART.size, dtype=np.int64)
    flight = packed(Flight(parts.tables, state, new_scratch(parts.tables), np.zeros(0), addresses))
    for name in ("ask", "advance", "decide"):
        load_part(flight, name, nonlinear=False)
    compile_watch()
    for name in sys.argv[1:]:
        module, _, function = name.partition(":")
        getattr(importlib.import_module(module), function)()


if __name__ == "__main__":
    main()
