"""The conversion corridor: boundaries, signed margins and warning levels.

Import ``rtsim.corridor.corridor_kernels`` for the compiled functions; this package itself starts without numba.
"""

from rtsim.corridor.boundaries import (
    LEVEL_NAMES,
    Boundary,
    Corridor,
    Levels,
    load_corridor,
)

__all__ = ["LEVEL_NAMES", "Boundary", "Corridor", "Levels", "load_corridor"]
