"""A whole database of the XV-15: trims and linear models over the grid, and the pilots designed for them."""

from __future__ import annotations

from collections.abc import Callable

from rtsim.aircraft.condition import AircraftCondition
from rtsim.choices import OUTER_LOOPS
from rtsim.lpv.building.build import build_database
from rtsim.lpv.building.grid import conversion_grid
from rtsim.lpv.building.lateral import with_lateral
from rtsim.lpv.building.xv15_grid import Xv15Grid
from rtsim.lpv.cells import JACOBIAN_BITS, round_mantissa
from rtsim.lpv.database import Database, StoredArrays
from rtsim.pilot.lateral_schedule import LATERAL, design_lateral
from rtsim.pilot.schedule import design_schedule

LATERAL_SHARE = 0.5
"""Share of the lateral half in the trims and linear models."""
BUILD_SHARE = 0.5
"""Share of the work that trims and linear models are; the rest are the pilots."""


def build_xv15(
    condition: AircraftCondition, *, jobs: int, progress: Callable[[float], None], pilots: bool = True
) -> Database:
    """Build the database of a condition from the nonlinear model.

    Args:
        condition: Weight, air and centre of gravity.
        jobs: Processes to use; the result does not depend on it.
        progress: Called with the share of the work done since the last call; the shares add up to 1.
        pilots: Design the pilots too.

    Raises:
        TrimError: The aircraft cannot be trimmed there at all.
    """
    share = BUILD_SHARE if pilots else 1.0
    grid = Xv15Grid.under(condition)
    database = build_database(
        grid, conversion_grid(), jobs=jobs, progress=lambda part: progress(share * (1.0 - LATERAL_SHARE) * part)
    )
    database = with_lateral(database, grid, jobs=jobs, progress=lambda part: progress(share * LATERAL_SHARE * part))
    if not pilots:
        return database
    return with_pilots(database, jobs=jobs, progress=lambda part: progress((1.0 - share) * part))


def with_pilots(database: Database, *, jobs: int, progress: Callable[[float], None]) -> Database:
    """Design the MOCM in all its forms.

    Args:
        database: The aircraft.
        jobs: Processes to use; the result does not depend on it.
        progress: Called with the share of the work done since the last call; the shares add up to 1.

    Returns:
        The database with the pilots' gains.
    """
    designs = len(OUTER_LOOPS) + (database.lateral is not None)
    for outer_loop in OUTER_LOOPS:
        pilot = design_schedule(
            database, outer_loop=outer_loop, jobs=jobs, progress=lambda part: progress(part / designs)
        )
        stored = pilot.to_arrays()
        rounded = {name: round_mantissa(array, JACOBIAN_BITS) for name, array in stored.arrays.items()}
        database = database.with_pilot(outer_loop, StoredArrays(rounded, stored.attributes))
    if database.lateral is None:
        return database
    stored = design_lateral(database, jobs=jobs, progress=lambda part: progress(part / designs)).to_arrays()
    return database.with_pilot(LATERAL, stored)
