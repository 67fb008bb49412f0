"""What ``rtsim trim`` and ``rtsim linearize`` answer: a flight condition solved from the database or afresh.

Legend:
    request: What was asked for.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtsim.analysis.trim_result import named, trim_result
from rtsim.errors import InputError, TrimError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtsim.aircraft.condition import AircraftCondition
    from rtsim.aircraft.points import Condition, TrimPoint
    from rtsim.aircraft.variables import Variable
    from rtsim.arrays import FloatArray
    from rtsim.choices import OuterLoop
    from rtsim.lpv.aircraft import LpvAircraft


@dataclass(frozen=True, slots=True)
class AskedCondition:
    """A flight condition as asked for on the command line, in the units of the options."""

    airspeed_kt: float
    """Horizontal airspeed."""
    nacelle_deg: float
    """Nacelle angle."""
    nonlinear: bool
    """Solve the nonlinear model even at the default condition."""
    flap_deg: float | None
    """Flap deflection; None: the schedule."""
    rotor_rpm: float | None
    """Rotor speed; None: the database's."""
    weight_lb: float | None
    """Weight; None: the database's."""
    altitude_m: float | None
    """Pressure altitude; None: sea level."""
    acceleration_kt_s: float | None
    """Level acceleration; None: none."""
    database: Path | None
    """Database file; None: the shipped one."""
    density_altitude_ft: float | None = None
    """Density altitude, in place of the pressure altitude; None: sea level."""
    cg_in: float | None = None
    """Centre of gravity forward of the aft limit; None: at it."""
    bank_deg: float | None = None
    """Bank of a coordinated level turn; None: straight."""
    sideslip_deg: float | None = None
    """Sideslip in straight flight; None: none."""
    lateral_kt: float | None = None
    """Airspeed to the right; None: none."""

    @property
    def solves_nonlinear(self) -> bool:
        """Whether the nonlinear model must be solved: the database holds one condition only."""
        asked = (self.flap_deg, self.rotor_rpm, self.acceleration_kt_s)
        turns = self.sideways and self.database is None
        return self.nonlinear or self.asks_condition or turns or any(value is not None for value in asked)

    @property
    def sideways(self) -> bool:
        """Whether anything out of the plane of symmetry was asked for."""
        return bool(self.bank_deg or self.sideslip_deg or self.lateral_kt)

    @property
    def asks_condition(self) -> bool:
        """Whether weight, air or centre of gravity were asked for."""
        asked = (self.weight_lb, self.altitude_m, self.density_altitude_ft, self.cg_in)
        return any(value is not None for value in asked)


_LIMITS: tuple[tuple[str, float, float, str], ...] = (
    ("airspeed_kt", -100.0, 400.0, "kn"),
    ("nacelle_deg", 0.0, 95.0, "deg"),
    ("flap_deg", 0.0, 75.0, "deg"),
    ("rotor_rpm", 100.0, 1000.0, "rpm"),
    ("weight_lb", 5000.0, 20000.0, "lb"),
    ("altitude_m", -1000.0, 11000.0, "m"),
    ("acceleration_kt_s", -20.0, 20.0, "kn/s"),
    ("density_altitude_ft", -3000.0, 36000.0, "ft"),
    ("cg_in", 0.0, 9.4, "in"),
    ("bank_deg", -80.0, 80.0, "deg"),
    ("sideslip_deg", -45.0, 45.0, "deg"),
    ("lateral_kt", -60.0, 60.0, "kn"),
)


SLOWEST_TURN_KT = 5.0
"""Airspeed from which a coordinated turn is solved [kn]."""


def eigenvalues(A: FloatArray) -> list[dict[str, float]]:
    """Eigenvalues with natural frequency and damping ratio, slowest first.

    Args:
        A: State matrix (n, n) [1/s].

    Returns:
        For each: ``re``, ``im``, ``wn_rad_s`` and ``zeta`` (1 or -1 for real ones, 0 at the origin).
    """
    import numpy as np

    return described(np.linalg.eigvals(A))


def described(roots: Iterable[complex]) -> list[dict[str, float]]:
    """Roots as ``eigenvalues`` gives them.

    Args:
        roots: The roots.
    """
    return [
        {
            "re": float(root.real),
            "im": float(root.imag),
            "wn_rad_s": float(abs(root)),
            "zeta": float(-root.real / abs(root)) if abs(root) > 0.0 else 0.0,
        }
        for root in sorted(roots, key=lambda root: (abs(root), root.imag))
    ]


def checked(request: AskedCondition) -> AskedCondition:
    """Refuse values out of range.

    Returns:
        The same request.

    Raises:
        InputError: Naming the option and its range.
    """
    for name, low, high, unit in _LIMITS:
        value = getattr(request, name)
        if value is not None and not (math.isfinite(value) and low <= value <= high):
            option = "--" + name.replace("_", "-")
            raise InputError(
                "out of range",
                key=option,
                value=value,
                allowed=f"{low:g} to {high:g} {unit}",
                mend="choose a value in this range",
            )
    if request.altitude_m is not None and request.density_altitude_ft is not None:
        raise InputError("says the same as --altitude-m", key="--density-altitude-ft", mend="give one of the two")
    asked = [name for name in ("bank_deg", "sideslip_deg", "lateral_kt") if getattr(request, name)]
    if len(asked) > 1:
        flags = " and ".join("--" + name.replace("_", "-") for name in asked)
        raise InputError("asks for several motions at once", key=flags, mend="give one of them")
    if request.bank_deg and abs(request.airspeed_kt) < SLOWEST_TURN_KT:
        raise InputError(
            "a turn with bank needs airspeed: standing still the aircraft turns with its pedals alone",
            key="--airspeed-kt", value=request.airspeed_kt, allowed=f"{SLOWEST_TURN_KT:g} kn or more with --bank-deg",
        )  # fmt: skip
    return request


def checked_outer_loop(outer_loop: str) -> OuterLoop:
    """Refuse an outer loop that there is not.

    Args:
        outer_loop: What was asked for.

    Returns:
        The same, as its type.

    Raises:
        InputError: Naming the option and the choices.
    """
    from rtsim.choices import OUTER_LOOPS

    for name in OUTER_LOOPS:
        if name == outer_loop:
            return name
    raise InputError(
        "no such outer loop",
        key="--outer-loop",
        value=outer_loop,
        allowed=", ".join(OUTER_LOOPS),
        mend="choose one",
    )


def asked_condition(request: AskedCondition) -> Condition:
    """The flight condition, in SI."""
    from rtsim.aircraft.points import Condition
    from rtsim.units import deg, kt, rpm

    return Condition(
        airspeed=kt(request.airspeed_kt),
        nacelle_angle=deg(request.nacelle_deg),
        acceleration=kt(request.acceleration_kt_s or 0.0),
        flap=None if request.flap_deg is None else deg(request.flap_deg),
        rotor_speed=None if request.rotor_rpm is None else rpm(request.rotor_rpm),
        bank=deg(request.bank_deg or 0.0),
        sideslip=deg(request.sideslip_deg or 0.0),
        lateral_airspeed=kt(request.lateral_kt or 0.0),
    )


def asked_aircraft(request: AskedCondition) -> AircraftCondition:
    """Weight, air and centre of gravity: those of the database where nothing else is asked for."""
    from rtsim.aircraft.condition import SHIPPED, AircraftCondition
    from rtsim.units import FOOT, INCH, lb

    base = SHIPPED if request.database is None else AircraftCondition.stored(lpv_aircraft(request).database.attributes)
    changes = {
        "mass": None if request.weight_lb is None else lb(request.weight_lb),
        "density_altitude": request.altitude_m,
        "cg_forward": None if request.cg_in is None else request.cg_in * INCH,
    }
    if request.density_altitude_ft is not None:
        changes["density_altitude"] = request.density_altitude_ft * FOOT
    return dataclasses.replace(base, **{name: value for name, value in changes.items() if value is not None})


def _thinner(request: AskedCondition) -> float:
    """True over calibrated airspeed in the air of the condition."""
    return asked_aircraft(request).true_over_calibrated


def nonlinear_trim(request: AskedCondition) -> tuple[dict[str, Any], TrimPoint]:
    """Trim the nonlinear model at the condition.

    Returns:
        The result by JSON key, and the trim.
    """
    from rtsim.aircraft.profile import xv15_profile
    from rtsim.aircraft.variables import ALL_INPUTS, ALL_OUTPUTS, ALL_STATES
    from rtsim.aircraft.xv15.dynamics_kernels import flap_schedule
    from rtsim.aircraft.xv15.model import Xv15
    from rtsim.units import to_deg, to_rpm

    aircraft = Xv15.under(asked_aircraft(request))
    condition = asked_condition(request)
    point = aircraft.trim(condition)
    tables = aircraft.tables
    flap = condition.flap
    if flap is None:
        flap = float(flap_schedule(tables.controls, condition.airspeed, condition.nacelle_angle))
    rotor_speed = tables.configuration.rotor_speed if condition.rotor_speed is None else condition.rotor_speed
    values = named(point, ALL_STATES, ALL_INPUTS, ALL_OUTPUTS)
    configuration = (to_deg(flap), to_rpm(float(rotor_speed)))
    where = (request.airspeed_kt, request.nacelle_deg)
    thinner = _thinner(request)
    return trim_result(where, "nonlinear", xv15_profile(), values, configuration, point.converged, thinner), point


def database_trim(request: AskedCondition) -> tuple[dict[str, Any], TrimPoint]:
    """Trim the LPV aircraft.

    Returns:
        The result by JSON key, and the trim.

    Raises:
        InputError: The condition is outside the database, or is a turn or sideslip and the database knows the plane of
            symmetry only.
    """
    from rtsim.aircraft.variables import ALL_INPUTS, ALL_OUTPUTS, ALL_STATES
    from rtsim.units import deg, kt, to_deg, to_rpm

    aircraft = lpv_aircraft(request)
    airspeed, nacelle = kt(request.airspeed_kt), deg(request.nacelle_deg)
    database = aircraft.database
    if request.sideways:
        point = _sideways_trim(request, aircraft)
        values = named(point, ALL_STATES, ALL_INPUTS, ALL_OUTPUTS)
    else:
        point = aircraft.trim(airspeed=airspeed, nacelle=nacelle)
        values = named(point, database.states, database.inputs, database.outputs)
    flap = aircraft.flap(airspeed=airspeed, nacelle=nacelle)
    configuration = (to_deg(flap), to_rpm(database.governed_speed))
    where = (request.airspeed_kt, request.nacelle_deg)
    thinner = _thinner(request)
    return trim_result(where, "database", database.profile, values, configuration, point.converged, thinner), point


def _sideways_trim(request: AskedCondition, aircraft: LpvAircraft) -> TrimPoint:
    """Trim the LPV aircraft in a turn, in sideslip or in sideward flight."""
    from rtsim.analysis.sideways_trim import sideways_trim
    from rtsim.lpv.aircraft import LpvAircraft
    from rtsim.lpv.flown import flown_database

    if aircraft.database.lateral is None:
        solve = ", or solve the nonlinear model (--nonlinear)" if aircraft.database.profile.is_xv15 else ""
        raise InputError(
            "the database knows the plane of symmetry only, and a turn or sideslip is asked for",
            key="--database", value=str(request.database), mend=f"take one with a lateral half{solve}",
        )  # fmt: skip
    return sideways_trim(LpvAircraft(flown_database(aircraft.database)), asked_condition(request))


def solvable(request: AskedCondition) -> AskedCondition:
    """Ask the nonlinear model where the shipped database has no answer: beside its edge there may be a trim.

    Returns:
        The request, or the same for the nonlinear model.

    Raises:
        InputError: The condition is outside the database, or the aircraft has no nonlinear model that could be asked.
    """
    from rtsim.units import deg, kt

    if request.database is not None:
        profile = lpv_aircraft(request).database.profile
        if request.solves_nonlinear and not profile.is_xv15:
            raise InputError(
                f"there is no nonlinear model of the {profile.name}",
                key="--nonlinear",
                mend="leave it out, and flaps, rotor speed, weight, altitude, centre of gravity and acceleration too",
            )
        return request
    if request.solves_nonlinear:
        return request
    if lpv_aircraft(request).trim(airspeed=kt(request.airspeed_kt), nacelle=deg(request.nacelle_deg)).converged:
        return request
    return dataclasses.replace(request, nonlinear=True)


def lpv_aircraft(request: AskedCondition) -> LpvAircraft:
    """The LPV aircraft that is asked."""
    from rtsim.lpv.aircraft import load_aircraft

    return load_aircraft(request.database)


STOPPED = {"stick": "the stick", "elevator": "the stick", "lateral_stick": "the lateral stick", "pedal": "a pedal"}
"""Controls that end a branch of trims, in words."""
_BALANCES = {
    "u": "the forces along the body do not balance",
    "v": "the side forces do not balance",
    "w": "the forces upright to the body do not balance",
    "p": "the rolling moments do not balance",
    "q": "the pitching moments do not balance",
    "r": "the yawing moments do not balance",
}
"""What is left over where no trim is found, by the rate that does not vanish."""


def _reached(request: AskedCondition, point: TrimPoint) -> str:
    """How far the branch went."""
    from rtsim.aircraft.variables import STATE
    from rtsim.units import to_deg, to_kt

    if len(point.x) <= STATE.v:
        return ""
    u, v, w, bank = (float(point.x[place]) for place in (STATE.u, STATE.v, STATE.w, STATE.bank))
    if request.bank_deg:
        return f" (it ends at {to_deg(bank):.1f} deg)"
    if request.sideslip_deg:
        return f" (it ends at {to_deg(math.atan2(v, math.hypot(u, w))):.1f} deg)"
    return f" (it ends at {to_kt(v):.1f} kn)"


def no_trim(request: AskedCondition, point: TrimPoint) -> TrimError:
    """Say that there is no trim, and what did not close.

    Args:
        point: Where the search ended.

    Returns:
        The error to raise.
    """
    from rtsim.analysis.sideways_trim import VALIDITY

    where = f"{request.airspeed_kt:g} kn at nacelle {request.nacelle_deg:g} deg"
    for name, words in (
        ("bank_deg", "bank {:g} deg"),
        ("sideslip_deg", "sideslip {:g} deg"),
        ("lateral_kt", "{:g} kn to the right"),
    ):
        if getattr(request, name):
            where += ", " + words.format(getattr(request, name)) + _reached(request, point)
    if point.unclosed in STOPPED:
        where += f": {STOPPED[point.unclosed]} would pass its stop"
    elif point.unclosed in VALIDITY.values():
        where += f": {point.unclosed}"
    closes = point.unclosed in {"", *STOPPED, *VALIDITY.values()}
    left = "" if closes else f"; {_BALANCES.get(point.unclosed, f'{point.unclosed} does not come to rest')}"
    mend = "see where the aircraft flies with 'rtsim corridor'"
    if not request.solves_nonlinear:
        mend += ", or solve exactly there with --nonlinear"
    return TrimError(f"there is no level-flight trim at {where}{left}", mend=mend)


def nonlinear_model(request: AskedCondition) -> dict[str, Any]:
    """Linearize the nonlinear model at the condition.

    Returns:
        The model by JSON key.

    Raises:
        TrimError: There is no trim to linearize at.
    """
    from rtsim.aircraft.variables import INPUTS, OUTPUTS, STATES
    from rtsim.aircraft.xv15.model import Xv15
    from rtsim.lpv.building.xv15_grid import flown_model

    aircraft, condition = Xv15.under(asked_aircraft(request)), asked_condition(request)
    point = aircraft.trim(condition)
    if not point.converged:
        raise no_trim(request, point)
    model = flown_model(aircraft, condition, point)
    return model_result((STATES, INPUTS, OUTPUTS), (model.A, model.B, model.C, model.D))


def database_model(request: AskedCondition) -> dict[str, Any]:
    """Take the linear model from the database.

    Returns:
        The model by JSON key.

    Raises:
        TrimError: There is no trim around.
    """
    from rtsim.units import deg, kt

    aircraft = lpv_aircraft(request)
    airspeed, nacelle = kt(request.airspeed_kt), deg(request.nacelle_deg)
    matrices = aircraft.matrices(airspeed=airspeed, nacelle=nacelle)
    if not aircraft.is_valid(airspeed=airspeed, nacelle=nacelle):
        raise no_trim(request, aircraft.trim(airspeed=airspeed, nacelle=nacelle))
    database = aircraft.database
    return model_result((database.states, database.inputs, database.outputs), matrices)


def closed_loop_model(request: AskedCondition, outer_loop: str) -> dict[str, Any]:
    """Linearize the loop of aircraft and pilot, frozen at the condition and sampled as flown.

    Args:
        outer_loop: ``integrators`` or ``pi``.

    Returns:
        The model by JSON key; ``A`` is the map over one frame.

    Raises:
        InputError: Another condition than the database's is asked for, or a pilot that it does not hold.
        TrimError: There is no trim.
    """
    import numpy as np

    from rtsim.analysis.frozen_loop import FrozenCommand, frozen_loop
    from rtsim.units import deg, kt

    if request.solves_nonlinear:
        raise InputError(
            "the pilot is designed for the database's own condition",
            key="--closed-loop",
            mend="leave out --nonlinear, flaps, rotor speed, weight, altitude, centre of gravity and acceleration; "
            "--database names one for another condition",
        )
    chosen = checked_outer_loop(outer_loop)
    aircraft = lpv_aircraft(request)
    airspeed, nacelle = kt(request.airspeed_kt), deg(request.nacelle_deg)
    point = aircraft.trim(airspeed=airspeed, nacelle=nacelle)
    if not point.converged:
        raise no_trim(request, point)
    database = aircraft.database
    if chosen not in database.pilot:
        raise InputError(
            "the database holds no gains of this pilot",
            key="--outer-loop",
            value=outer_loop,
            allowed=", ".join(database.pilot) or "none",
            mend="run 'rtsim model build'",
        )
    loop = frozen_loop(database, FrozenCommand(airspeed, nacelle), outer_loop=chosen)
    matrix = loop.matrix
    pilot_states = matrix.shape[0] - len(database.states)
    names = [variable.name for variable in database.states] + [f"pilot_{k}" for k in range(pilot_states)]
    growth = loop.growth()
    return {
        "states": names,
        "inputs": [],
        "outputs": [],
        "units": {
            "states": [variable.unit for variable in database.states] + [""] * pilot_states,
            "inputs": [],
            "outputs": [],
        },
        "A": matrix,
        "B": np.zeros((len(names), 0)),
        "C": np.zeros((0, len(names))),
        "D": np.zeros((0, 0)),
        "dt_s": loop.dt,
        "outer_loop": outer_loop,
        "eigenvalues": described(loop.eigenvalues()),
        "growth_rad_s": growth,
        "stable": growth < 0.0,
    }


def model_result(
    variables: tuple[tuple[Variable, ...], tuple[Variable, ...], tuple[Variable, ...]],
    matrices: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
) -> dict[str, Any]:
    """A linear model by JSON key.

    Args:
        variables: States, inputs and outputs.
        matrices: A, B, C, D.
    """
    kinds = ("states", "inputs", "outputs")
    return {
        **{kind: [variable.name for variable in row] for kind, row in zip(kinds, variables, strict=True)},
        "units": {kind: [variable.unit for variable in row] for kind, row in zip(kinds, variables, strict=True)},
        **dict(zip("ABCD", matrices, strict=True)),
    }
