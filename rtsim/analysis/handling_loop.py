"""The aircraft in the pilot's hands as a linear sampled system: what flies, frame by frame, linearized numerically.

The LPV aircraft's Runge-Kutta step, out of the plane of symmetry its linear model, the aids' kernels and where the
aircraft is over the ground. About a symmetric trim the motion in the plane of symmetry and that out of it do not meet.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.linalg

from rtsim.aids.aids_kernels import AID_COUNT, MEMORY, aids_engage, aids_step
from rtsim.aids.design import design_aids, switches_of
from rtsim.aids.lateral_aids_kernels import QUIET_TIME, lateral_aids_step
from rtsim.aids.lateral_design import design_lateral_aids
from rtsim.aircraft.variables import (
    ALL_INPUTS,
    ALL_STATES,
    INPUT,
    INPUTS,
    LATERAL_INPUTS,
    LATERAL_STATES,
    STATE,
    STATES,
    whole,
)  # fmt: skip
from rtsim.arrays import FloatArray
from rtsim.choices import AidName
from rtsim.command import CHANNELS
from rtsim.kernels.grid_kernels import cell
from rtsim.lpv.aircraft import LpvAircraft
from rtsim.lpv.lateral import LateralData
from rtsim.lpv.lpv_kernels import lpv_step, work_size
from rtsim.lpv.tables import prepare_tables

DT = 0.004
"""Frame of the linearized loop [s]."""
_STEP = 1e-5
_PULSE = 0.2
"""Movement of a control beyond the aids' dead zone."""
_PLACE = ("north", "north_integral", "last_north"), ("east", "east_integral", "last_east")
_SYMMETRIC = tuple(MEMORY.asdict())[: MEMORY.lateral_offset]
_LATERAL = slice(len(STATES), len(STATES) + len(LATERAL_STATES))
_LATERAL_INPUTS = slice(len(INPUTS), len(INPUTS) + len(LATERAL_INPUTS))
_Step = Callable[[FloatArray, FloatArray], None]
_REFERENCES = ("bank_reference", "heading_reference")


@dataclass(frozen=True, slots=True)
class LinearLoop:
    """One half of the motion, of one frame to the next."""

    a: FloatArray
    """How a frame moves the deviations (n, n)."""
    b: dict[str, FloatArray]
    """How much a frame moves them per movement of a control (n,)."""
    names: tuple[str, ...]
    """States, then memories of the aids."""

    @property
    def roots(self) -> npt.NDArray[np.complex128]:
        """Roots as log(z)/dt [rad/s], rightmost first; integrators that nothing feeds, at the origin, are left out."""
        z = np.linalg.eigvals(self.a)
        roots = np.log(z[np.abs(z) > 1e-6].astype(complex)) / DT
        roots = roots[np.abs(roots) > 2e-3]
        return np.asarray(roots[np.argsort(-roots.real)])

    def response(self, control: str, state: str, frequencies: FloatArray) -> npt.NDArray[np.complex128]:
        """Frequency response.

        Args:
            control: Which control moves.
            state: What is looked at.
            frequencies: Where [rad/s].
        """
        place, eye = self.names.index(state), np.eye(len(self.names))
        return np.array(
            [np.linalg.solve(np.exp(1j * w * DT) * eye - self.a, self.b[control])[place] for w in frequencies]
        )


def symmetric_loop(aircraft: LpvAircraft, *, airspeed: float, nacelle: float, aids: tuple[AidName, ...]) -> LinearLoop:
    """Linearize the motion in the plane of symmetry about level flight.

    Args:
        aircraft: The LPV aircraft.
        aids: The aids that are on.
    """
    names = (*(variable.name for variable in STATES), *_SYMMETRIC)
    names += _PLACE[0] if "position_hold" in aids else ()
    return _linearized(aircraft, airspeed, nacelle, aids, names, ("stick",), held=True)


def lateral_loop(
    aircraft: LpvAircraft, *, airspeed: float, nacelle: float, aids: tuple[AidName, ...], held: bool
) -> LinearLoop:
    """Linearize the motion out of the plane of symmetry about level flight.

    Args:
        aircraft: The LPV aircraft; its database must have a lateral half.
        aids: The aids that are on.
        held: Heading and place are held; else they are the hands', which move.
    """
    names = tuple(variable.name for variable in LATERAL_STATES)
    names += ("heading_integral",) if held else _REFERENCES
    names += _PLACE[1] if held and "position_hold" in aids else ()
    return _linearized(aircraft, airspeed, nacelle, aids, names, ("lateral_stick", "pedal"), held=held)


def _linearized(
    aircraft: LpvAircraft,
    airspeed: float,
    nacelle: float,
    aids: tuple[AidName, ...],
    names: tuple[str, ...],
    controls: tuple[str, ...],
    *,
    held: bool,
) -> LinearLoop:
    """Central differences of one frame with the named states and memories, and pulses of the controls."""
    trim, switches = aircraft.trim(airspeed=airspeed, nacelle=nacelle), switches_of(aids)
    tables, lateral_tables = design_aids(aircraft.database), design_lateral_aids(aircraft.database)
    lateral = controls[0] != "stick"
    move = _lateral_step(aircraft, airspeed, nacelle) if lateral else _symmetric_step(aircraft, nacelle)
    x0, u0 = whole(trim.x, ALL_STATES), whole(trim.u, ALL_INPUTS)
    acting0 = np.array([u0[INPUT.stick], u0[INPUT.lever], 0.0, 0.0, 0.0])
    hands0 = acting0.copy()
    if {"attitude_retention", "position_hold"} & set(aids):
        hands0[0] = 0.0
    state0 = np.zeros(MEMORY.size)
    aids_engage(tables, state0, switches, x0, nacelle, hands0, np.zeros(3), acting0)
    if held:
        state0[[MEMORY.heading_held, MEMORY.place_share, MEMORY.quiet_time]] = 1.0, 1.0, 2.0 * QUIET_TIME
    on_place = "position_hold" in aids
    places = [STATE.asdict().get(name, len(ALL_STATES) + MEMORY.asdict().get(name, 0)) for name in names]

    def frame(z: FloatArray, control: str = "stick", moved: float = 0.0) -> FloatArray:
        x, state, acting, u = z[: x0.size].copy(), z[x0.size :].copy(), acting0.copy(), u0.copy()
        hands = hands0.copy()
        hands[CHANNELS.index(control)] += moved
        state[MEMORY.last_switches :] = switches[:AID_COUNT]
        if lateral or on_place:
            at = float(state[MEMORY.schedule_airspeed])
            lateral_aids_step(lateral_tables, state, switches, x, nacelle, at, hands, acting, DT)
        aids_step(tables, state, switches, x, nacelle, hands, np.zeros(3), acting, DT)
        u[[INPUT.stick, INPUT.lever, INPUT.lateral_stick, INPUT.pedal]] = acting[[0, 1, 3, 4]]
        before = _over_ground(x)
        move(x, u)
        x[[STATE.north, STATE.east]] += 0.5 * DT * (before + _over_ground(x))
        return np.concatenate([x, state])[places]

    z0, shifts = np.concatenate([x0, state0]), _STEP * np.eye(x0.size + state0.size)[places]
    a = np.array([(frame(z0 + shift) - frame(z0 - shift)) / (2.0 * _STEP) for shift in shifts]).T
    # Pulses beyond the dead zone, so that commanded rates are seen too.
    b = {c: (frame(z0, c, _PULSE) - frame(z0, c, -_PULSE)) / (2.0 * _PULSE) for c in controls}
    return LinearLoop(a, b, names)


def _symmetric_step(aircraft: LpvAircraft, nacelle: float) -> _Step:
    """The step that flies in the plane of symmetry."""
    tables, path = prepare_tables(aircraft.database), np.tile([nacelle, 0.0, 0.0], (3, 1))
    work = np.zeros(work_size(tables))
    return lambda x, u: lpv_step(tables, x, u, path, DT, work)


def _lateral_step(aircraft: LpvAircraft, airspeed: float, nacelle: float) -> _Step:
    """One frame of the linear model out of it; the flying step takes chords over 2.5 kn of sideward speed."""
    database = aircraft.database
    data = LateralData.of(database)
    (i, s), (j, t) = cell(database.airspeed, airspeed), cell(database.nacelle, nacelle)
    share = np.array([[(1.0 - s) * (1.0 - t), (1.0 - s) * t], [s * (1.0 - t), s * t]])
    a, b = (np.tensordot(share, array[0, i : i + 2, j : j + 2]) for array in (data.A, data.B))
    n, m = b.shape
    over_frame = scipy.linalg.expm(DT * np.block([[a, b], [np.zeros((m, n + m))]]))[:n]

    def step(x: FloatArray, u: FloatArray) -> None:
        x[_LATERAL] = over_frame @ np.concatenate([x[_LATERAL], u[_LATERAL_INPUTS]])

    return step


def _over_ground(x: FloatArray) -> FloatArray:
    """Velocity north and east in still air [m/s]."""
    sp, cp, sb, cb = (
        math.sin(x[STATE.pitch]),
        math.cos(x[STATE.pitch]),
        math.sin(x[STATE.bank]),
        math.cos(x[STATE.bank]),
    )
    sh, ch = math.sin(x[STATE.heading]), math.cos(x[STATE.heading])
    ahead = x[STATE.u] * cp + (x[STATE.v] * sb + x[STATE.w] * cb) * sp
    right = x[STATE.v] * cb - x[STATE.w] * sb
    return np.array([ahead * ch - right * sh, ahead * sh + right * ch])
