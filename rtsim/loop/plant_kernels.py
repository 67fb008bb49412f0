"""The plants as parts of the frame: the same two calls, whichever aircraft flies.

Legend:
    lpv: Its tables.
    aircraft: Its tables.
    tables: Its tables.
    x: State; a step overwrites it.
    angle: Nacelle angle [rad].
    path: Nacelle motion over the step, shape (3, 3).
    y: Written: outputs.
    xdot: Work space; the LPV aircraft needs none.
    work: Work array.
"""

from __future__ import annotations

from rtsim.aircraft.xv15 import dynamics_kernels as nonlinear
from rtsim.aircraft.xv15.tables import AircraftTables
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import part
from rtsim.lpv.lpv_kernels import WORK, LpvTables, lpv_outputs, lpv_step
from rtsim.lpv.sideways_kernels import sideways_outputs, sideways_step
from rtsim.lpv.sideways_tables import SidewaysTables


@part
def outputs_of_lpv(
    lpv: LpvTables,
    x: FloatArray,
    u: FloatArray,
    angle: float,
    y: FloatArray,
    xdot: FloatArray,
    work: FloatArray,
) -> float:
    """Outputs of the LPV aircraft."""
    lpv_outputs(lpv, x, u, angle, y, work)
    return 0.0


@part
def outputs_of_nonlinear(
    aircraft: AircraftTables,
    x: FloatArray,
    u: FloatArray,
    angle: float,
    y: FloatArray,
    xdot: FloatArray,
    work: FloatArray,
) -> float:
    """Outputs of the nonlinear aircraft."""
    nonlinear.outputs(aircraft, x, u, angle, y, xdot, work)
    return 0.0


@part
def outputs_of_sideways(
    tables: SidewaysTables,
    x: FloatArray,
    u: FloatArray,
    angle: float,
    y: FloatArray,
    xdot: FloatArray,
    work: FloatArray,
) -> float:
    """Outputs of the LPV aircraft in six degrees of freedom."""
    sideways_outputs(tables, x, u, angle, y, work)
    return 0.0


@part
def step_of_lpv(lpv: LpvTables, x: FloatArray, u: FloatArray, path: FloatArray, dt: float, work: FloatArray) -> float:
    """Advance the LPV aircraft by one step.

    Returns:
        The flags of ``rtsim.lpv.lpv_kernels``.
    """
    lpv_step(lpv, x, u, path, dt, work)
    return float(work[WORK.flags])


@part
def step_of_sideways(
    tables: SidewaysTables, x: FloatArray, u: FloatArray, path: FloatArray, dt: float, work: FloatArray
) -> float:
    """Advance the LPV aircraft in six degrees of freedom by one step.

    Returns:
        The flags of ``rtsim.lpv.schedule_kernels``.
    """
    sideways_step(tables, x, u, path, dt, work)
    return float(work[WORK.flags])


@part
def step_of_nonlinear(
    aircraft: AircraftTables, x: FloatArray, u: FloatArray, path: FloatArray, dt: float, work: FloatArray
) -> float:
    """Advance the nonlinear aircraft by one step; there are no flags."""
    nonlinear.step(aircraft, x, u, path, dt, work)
    return 0.0


PLANT_PARTS = {
    LpvTables: (outputs_of_lpv, step_of_lpv),
    SidewaysTables: (outputs_of_sideways, step_of_sideways),
    AircraftTables: (outputs_of_nonlinear, step_of_nonlinear),
}
"""Outputs and step by what holds the aircraft's tables."""
