"""The two plants behind one call, chosen when a kernel is compiled by the type of the aircraft's tables.

A flight of the LPV aircraft carries only the few numbers of the nonlinear model that the frame itself reads, so its
compiled frame contains one plant, compiles in half the time, and is handed a hundred arrays less per call.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types
from numba.extending import overload

from rtsim.aircraft.table_kernels import FloatArray
from rtsim.aircraft.xv15 import dynamics_kernels as nonlinear
from rtsim.aircraft.xv15.tables import AircraftTables, Configuration, ControlTables
from rtsim.lpv.lpv_kernels import LpvTables, lpv_outputs, lpv_step


class AircraftFrame(NamedTuple):
    """What the frame reads of the nonlinear aircraft where the LPV aircraft flies."""

    configuration: Configuration
    """Mass, air, rotor speed, flap."""
    controls: ControlTables
    """Mixing, limits, flap schedule."""


def plant_outputs(
    aircraft: AircraftTables | AircraftFrame,
    lpv: LpvTables,
    x: FloatArray,
    u: FloatArray,
    angle: float,
    space: tuple[FloatArray, FloatArray, FloatArray],
) -> None:
    """Outputs of whichever plant flies; for kernels only.

    Args:
        aircraft: The nonlinear aircraft, or its part where the LPV aircraft flies.
        lpv: The LPV aircraft.
        x: State.
        u: Inputs.
        angle: Nacelle angle [rad].
        space: Outputs (written), state derivative (scratch), work array.
    """
    raise TypeError("plant_outputs is for compiled kernels")


def plant_step(
    aircraft: AircraftTables | AircraftFrame,
    lpv: LpvTables,
    x: FloatArray,
    u: FloatArray,
    path: FloatArray,
    dt: float,
    work: FloatArray,
) -> float:
    """Advance whichever plant flies by one step and give the LPV aircraft's flags; for kernels only.

    Args:
        aircraft: The nonlinear aircraft, or its part where the LPV aircraft flies.
        lpv: The LPV aircraft.
        x: State, overwritten.
        u: Inputs.
        path: Nacelle motion over the step, shape (3, 3).
        dt: Length of the step [s].
        work: Work array.
    """
    raise TypeError("plant_step is for compiled kernels")


_OPTIONS: Any = {"error_model": "numpy", "_nrt": False}  # as rtsim.kernels.compiled.inner_kernel


def _is_nonlinear(kind: types.Type) -> bool:
    return isinstance(kind, (types.NamedTuple, types.NamedUniTuple)) and kind.instance_class is AircraftTables


@overload(plant_outputs, jit_options=_OPTIONS)
def _choose_outputs(aircraft: Any, lpv: Any, x: Any, u: Any, angle: Any, space: Any) -> Callable[..., None]:
    if _is_nonlinear(aircraft):

        def from_nonlinear(aircraft: Any, lpv: Any, x: Any, u: Any, angle: Any, space: Any) -> None:
            nonlinear.outputs(aircraft, x, u, angle, space[0], space[1], space[2])

        return from_nonlinear

    def from_lpv(aircraft: Any, lpv: Any, x: Any, u: Any, angle: Any, space: Any) -> None:
        lpv_outputs(lpv, x, u, angle, space[0], space[2])

    return from_lpv


@overload(plant_step, jit_options=_OPTIONS)
def _choose_step(aircraft: Any, lpv: Any, x: Any, u: Any, path: Any, dt: Any, work: Any) -> Callable[..., float]:
    if _is_nonlinear(aircraft):

        def by_nonlinear(aircraft: Any, lpv: Any, x: Any, u: Any, path: Any, dt: Any, work: Any) -> float:
            nonlinear.step(aircraft, x, u, path, dt, work)
            return 0.0

        return by_nonlinear

    def by_lpv(aircraft: Any, lpv: Any, x: Any, u: Any, path: Any, dt: Any, work: Any) -> float:
        lpv_step(lpv, x, u, path, dt, work)
        return float(work[0])

    return by_lpv
