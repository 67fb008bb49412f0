"""What ``rtsim linearize`` answers about the motion out of the plane of symmetry.

Legend:
    request: What was asked for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from rtsim.analysis.flight_condition import (
    AskedCondition,
    asked_aircraft,
    asked_condition,
    described,
    lpv_aircraft,
    model_result,
    no_trim,
)
from rtsim.errors import InputError

if TYPE_CHECKING:
    from rtsim.arrays import FloatArray

Axis = Literal["longitudinal", "lateral", "both"]
AXES: tuple[Axis, ...] = ("longitudinal", "lateral", "both")
"""Motions that can be asked for."""


def checked_axis(axis: str) -> Axis:
    """Refuse an axis that there is not.

    Args:
        axis: What was asked for.

    Raises:
        InputError: Naming the option and the choices.
    """
    for name in AXES:
        if name == axis:
            return name
    raise InputError("no such motion", key="--axis", value=axis, allowed=", ".join(AXES), mend="choose one")


def lateral_model(request: AskedCondition) -> dict[str, Any]:
    """Linear model out of the plane of symmetry, from the database or of the nonlinear model.

    Returns:
        The model by JSON key.

    Raises:
        InputError: The aircraft knows no such motion.
        TrimError: There is no trim.
    """
    from rtsim.aircraft.variables import LATERAL_INPUTS, LATERAL_OUTPUTS, LATERAL_STATES

    variables = (LATERAL_STATES, LATERAL_INPUTS, LATERAL_OUTPUTS)
    if request.sideways:
        raise InputError(
            "a turn or sideslip joins both motions, and this answers about straight flight",
            key="--bank-deg, --sideslip-deg, --lateral-kt", mend="leave them out",
        )  # fmt: skip
    if request.solves_nonlinear:
        from rtsim.aircraft.xv15.model import Xv15

        aircraft, condition = Xv15.under(asked_aircraft(request)), asked_condition(request)
        point = aircraft.trim(condition)
        if not point.converged:
            raise no_trim(request, point)
        model = aircraft.linearize_lateral(condition, point)
        return model_result(variables, (model.A, model.B, model.C, model.D))
    return model_result(variables, _matrices(request))


def _matrices(request: AskedCondition) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    from rtsim.lpv.lateral import LateralData
    from rtsim.units import deg, kt

    lpv = lpv_aircraft(request)
    if lpv.database.lateral is None:
        raise _symmetric_only()
    airspeed, nacelle = kt(request.airspeed_kt), deg(request.nacelle_deg)
    lpv.matrices(airspeed=airspeed, nacelle=nacelle)  # refuses what lies outside
    if not lpv.is_valid(airspeed=airspeed, nacelle=nacelle):
        raise no_trim(request, lpv.trim(airspeed=airspeed, nacelle=nacelle))
    data = LateralData.of(lpv.database)
    A, B, C, D = (lpv.interpolated(array[0], airspeed, nacelle) for array in (data.A, data.B, data.C, data.D))
    return A, B, C, D


def _symmetric_only() -> InputError:
    return InputError(
        "the database knows the plane of symmetry only", key="--axis", mend="leave it out, or build the database anew"
    )


def lateral_closed_loop(request: AskedCondition) -> dict[str, Any]:
    """Linearize the loop of aircraft and the pilot's lateral half, frozen at straight flight and sampled as flown.

    Returns:
        The model by JSON key; ``A`` is the map over one frame; margins of lateral stick and pedals.

    Raises:
        InputError: Another condition than the database's is asked for, or it has no lateral half.
        TrimError: There is no trim.
    """
    import numpy as np

    from rtsim.aircraft.variables import LATERAL_STATES
    from rtsim.analysis.frozen_loop import FrozenCommand
    from rtsim.analysis.lateral_loop import lateral_loop
    from rtsim.pilot.lateral_plant import HANDS
    from rtsim.units import deg, kt

    if request.solves_nonlinear:
        raise InputError(
            "the pilot is designed for the database's own condition",
            key="--closed-loop",
            mend="leave out --nonlinear and everything that asks for another condition",
        )
    lpv = lpv_aircraft(request)
    if lpv.database.lateral is None:
        raise _symmetric_only()
    airspeed, nacelle = kt(request.airspeed_kt), deg(request.nacelle_deg)
    point = lpv.trim(airspeed=airspeed, nacelle=nacelle)
    if not point.converged:
        raise no_trim(request, point)
    loop = lateral_loop(lpv.database, FrozenCommand(airspeed, nacelle))
    pilot_states = loop.matrix.shape[0] - len(loop.names)
    names, growth, margins = [*loop.names, *(f"pilot_{k}" for k in range(pilot_states))], loop.growth(), loop.margins()
    return {
        "states": names,
        "inputs": [],
        "outputs": [],
        "units": {"states": [*(v.unit for v in LATERAL_STATES), *[""] * pilot_states], "inputs": [], "outputs": []},
        "A": loop.matrix,
        "B": np.zeros((len(names), 0)),
        "C": np.zeros((0, len(names))),
        "D": np.zeros((0, 0)),
        "dt_s": loop.dt,
        "eigenvalues": described(loop.eigenvalues()),
        "growth_rad_s": growth,
        "stable": growth < 0.0,
        "margins": {
            hand: {
                "crossover_rad_s": float(margins.w_c[k]),
                "phase_deg": float(margins.phase_margin[k]),
                "gain_db": float(margins.gain_margin[k]),
            }
            for k, hand in enumerate(HANDS)
        },
    }


def joined(one: dict[str, Any], other: dict[str, Any]) -> dict[str, Any]:
    """Two models that do not meet as one.

    Args:
        one: A model by JSON key.
        other: Another.
    """
    from scipy.linalg import block_diag

    both = one | other
    for kind in ("states", "inputs", "outputs"):
        both[kind] = [*one[kind], *other[kind]]
    both["units"] = {kind: [*one["units"][kind], *other["units"][kind]] for kind in one["units"]}
    both |= {name: block_diag(one[name], other[name]) for name in "ABCD"}
    if "growth_rad_s" in one:
        both["eigenvalues"] = [*one["eigenvalues"], *other["eigenvalues"]]
        both["growth_rad_s"] = max(one["growth_rad_s"], other["growth_rad_s"])
        both["stable"] = one["stable"] and other["stable"]
    return both
