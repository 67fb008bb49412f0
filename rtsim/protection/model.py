"""The laws' model of the aircraft, reduced from the LPV database: rigid body, settled rotor, mast torque, flapping."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from rtsim.aircraft.variables import LATERAL_INPUTS, LATERAL_OUTPUTS, LATERAL_STATES, position, required_position
from rtsim.arrays import FloatArray
from rtsim.lpv.database import Database
from rtsim.lpv.lateral import LateralData
from rtsim.lpv.reduction import eliminated, settle, settled
from rtsim.lpv.tables import scheduling_speed
from rtsim.nacelle.switch import load_nacelle_tables
from rtsim.protection import prediction_kernels as kernels
from rtsim.protection.prediction_kernels import ModelTables
from rtsim.units import GRAVITY

_RIGID = ("u", "w", "q", "pitch")
_CONTROLS = ("stick", "lever")
_SIDEWAYS = ("v", "p", "r", "bank", "heading")
_LATERAL_CONTROLS = ("lateral_stick", "pedal")


@dataclass(frozen=True, slots=True, kw_only=True)
class RegulatorWeights:
    """Just acceptable deviations and control uses of the recovery's regulator. SI and radians."""

    airspeed: float
    """Airspeed [m/s]."""
    climb_rate: float
    """Climb rate [m/s]."""
    pitch: float
    """Pitch [rad]."""
    pitch_rate: float
    """Pitch rate [rad/s]."""
    stick: float
    """Stick [-]."""
    lever: float
    """Lever [-]."""


@functools.lru_cache(maxsize=4)
def reduce_model(database: Database, weights: RegulatorWeights) -> ModelTables:
    """Reduce the level layer of a database to what the laws need.

    Rotor and actuator states settle within 0.2 s and are replaced by their settled values.

    Args:
        weights: Weights of the recovery's regulator.

    Returns:
        The kernels' tables.
    """
    level = database.level_layer
    model = settled(
        database, keep=_RIGID, inputs=(*_CONTROLS, "nacelle_rate"), purpose="the protection", by_inverse=True
    )
    slow, fast, inputs = list(model.kept), list(model.fast), list(model.inputs)
    a, b, of_state, of_input = model.a, model.b, model.of_state, model.of_input
    C, D = database.C[level], database.D[level]
    of_nacelle = settle(model.inner, database.df_dnacelle[level][..., fast, None], by_inverse=True)
    n = database.df_dnacelle[level][..., slow] + (model.coupling @ of_nacelle)[..., 0]

    z = database.x_ref[level][..., slow]
    cells = np.zeros((*z.shape[:2], kernels.CELL.size))
    cells[..., kernels.CELL.state : kernels.CELL.state + 4] = z
    cells[..., kernels.CELL.control : kernels.CELL.control + 2] = database.u_ref[level][..., inputs[:2]]
    u, w, q, pitch = (z[..., k] for k in range(4))
    air = a[..., :3, :3].copy()
    # Coriolis terms leave the aerodynamics; gravity goes with the pitch column, which is left out.
    air[..., 0, 1] -= -q
    air[..., 0, 2] -= -w
    air[..., 1, 0] -= q
    air[..., 1, 2] -= u
    cells[..., kernels.CELL.air] = GRAVITY * np.sin(pitch) + q * w
    cells[..., kernels.CELL.air + 1] = -GRAVITY * np.cos(pitch) - q * u
    cells[..., kernels.CELL.a : kernels.CELL.a + 9] = air.reshape(*z.shape[:2], 9)
    cells[..., kernels.CELL.b : kernels.CELL.b + 9] = b[..., :3, :].reshape(*z.shape[:2], 9)
    cells[..., kernels.CELL.nacelle : kernels.CELL.nacelle + 3] = n[..., :3]

    torque = required_position(database.outputs, "torque", "protection")
    row = C[..., torque, :]
    rows = {
        kernels.CELL.torque: (
            database.y_ref[level][..., torque],
            row[..., slow] + np.einsum("...f,...fz->...z", row[..., fast], of_state),
            D[..., torque, :][..., inputs] + np.einsum("...f,...fu->...u", row[..., fast], of_input),
        )
    }
    for place, name in ((kernels.CELL.flap_c, "flap_1c"), (kernels.CELL.flap_s, "flap_1s")):
        state = required_position(database.states, name, "protection")
        k = fast.index(state)
        rows[place] = (database.x_ref[level][..., state], of_state[..., k, :], of_input[..., k, :])
    for place, (value, with_state, with_input) in rows.items():
        cells[..., place] = value
        cells[..., place + 1 : place + 4] = with_state[..., :3]
        cells[..., place + 4 : place + 7] = with_input
    cells[..., kernels.CELL.load] = 1.0
    if database.lateral is not None:
        data = LateralData.of(database)
        lateral = _lateral_rows(data)  # of side, roll, yaw, twist
        cells[..., kernels.CELL.side : kernels.CELL.side + lateral.shape[-1]] = lateral
        flapping = [required_position(database.states, name, "protection") for name in ("flap_1c", "flap_1s")]
        loaded = np.concatenate(
            [
                data.loaded_x_ref[0][..., slow] - database.x_ref[level][..., slow],
                (data.loaded_u_ref[0] - database.u_ref[level])[..., inputs[:2]],
                (data.loaded_y_ref[0] - database.y_ref[level])[..., [torque]],
                (data.loaded_x_ref[0] - database.x_ref[level])[..., flapping],
            ],
            axis=-1,
        )
        cells[..., kernels.CELL.turn : kernels.CELL.turn + 9] = loaded / (data.load_factor[0] - 1.0)
    gain = regulator_gains(a, b[..., :2], z, weights)
    cells[..., kernels.CELL.gain : kernels.CELL.gain + 8] = gain.reshape(*z.shape[:2], 8)
    nacelle = load_nacelle_tables(database.profile)
    cells.setflags(write=False)
    return ModelTables(
        airspeed=database.airspeed,
        nacelle=database.nacelle,
        cells=cells,
        nacelle_frequency=nacelle.frequency,
        forward_stop=nacelle.forward_stop,
        aft_stop=nacelle.aft_stop,
        alpha_speed=scheduling_speed(database),
        turns=int(database.lateral is not None),
    )


def _lateral_rows(data: LateralData) -> FloatArray:
    """What v, p, r, lateral stick and pedals do in level flight [V, N, 20].

    Rows: sideward, rolling and yawing acceleration, and the difference of the masts' torques.
    """
    kept = [position(LATERAL_STATES, name) for name in _SIDEWAYS]
    inputs = [position(LATERAL_INPUTS, name) for name in _LATERAL_CONTROLS]
    a, b = eliminated(data.A[0], data.B[0], kept, inputs)
    fast = [place for place in range(len(LATERAL_STATES)) if place not in kept]
    quick = data.A[0][..., fast, :]
    push = np.concatenate([quick[..., kept[:3]], data.B[0][..., fast, :][..., inputs]], axis=-1)
    twist = position(LATERAL_OUTPUTS, "torque_difference")
    direct = np.concatenate([data.C[0][..., twist, kept[:3]], data.D[0][..., twist, inputs]], axis=-1)
    torque = direct + np.einsum("...f,...fk->...k", data.C[0][..., twist, fast], settle(quick[..., fast], push))
    rows = np.concatenate([np.concatenate([a[..., :3, :3], b[..., :3, :]], axis=-1), torque[..., None, :]], axis=-2)
    return np.asarray(rows.reshape(*rows.shape[:2], 20))


def regulator_gains(a: FloatArray, b: FloatArray, z: FloatArray, weights: RegulatorWeights) -> FloatArray:
    """Linear-quadratic regulators of all grid points at once, from the stable half of the Hamiltonians' eigenvectors.

    Args:
        a: Dynamics of u, w, q, pitch [..., 4, 4].
        b: Stick and lever [..., 4, 2].
        z: Trim states [..., 4].
        weights: Weights.

    Returns:
        Gains [..., 2, 4]: controls = -gain (z - trim).
    """
    u, w, pitch = z[..., 0], z[..., 1], z[..., 3]
    sine, cosine = np.sin(pitch), np.cos(pitch)
    seen = np.zeros((*z.shape[:-1], 4, 4))
    seen[..., 0, 0], seen[..., 0, 1], seen[..., 0, 3] = cosine, sine, w * cosine - u * sine
    seen[..., 1, 0], seen[..., 1, 1], seen[..., 1, 3] = sine, -cosine, u * cosine + w * sine
    seen[..., 2, 3] = 1.0
    seen[..., 3, 2] = 1.0
    scale = 1.0 / np.array([weights.airspeed, weights.climb_rate, weights.pitch, weights.pitch_rate]) ** 2
    transposed = np.swapaxes
    cost = transposed(seen, -1, -2) @ (scale[:, None] * seen)
    effort = np.array([weights.stick, weights.lever]) ** 2
    quadratic = (b * effort) @ transposed(b, -1, -2)
    upper = np.concatenate([a, -quadratic], axis=-1)
    lower = np.concatenate([-cost, -transposed(a, -1, -2)], axis=-1)
    values, vectors = np.linalg.eig(np.concatenate([upper, lower], axis=-2))
    order = np.argsort(values.real, axis=-1)[..., :4]
    stable = np.take_along_axis(vectors, order[..., None, :], axis=-1)
    riccati = (stable[..., 4:, :] @ np.linalg.inv(stable[..., :4, :])).real
    gain: FloatArray = effort[:, None] * (transposed(b, -1, -2) @ riccati)
    return gain
