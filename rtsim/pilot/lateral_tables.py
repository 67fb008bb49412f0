"""Prepares the pilot's lateral half for the compiled kernels."""

from __future__ import annotations

import functools

import numpy as np

from rtsim.aircraft.variables import LATERAL_INPUTS, LATERAL_STATES, STATES, position
from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.kernels.kept import kept
from rtsim.kernels.packed import packed
from rtsim.lpv.database import Database
from rtsim.lpv.lateral import LateralData
from rtsim.pilot import layout_kernels as kernels
from rtsim.pilot.delay import delay_filter
from rtsim.pilot.lateral_kernels import LateralPilotTables
from rtsim.pilot.lateral_plant import HANDS, RIGID
from rtsim.pilot.lateral_schedule import LATERAL
from rtsim.pilot.layout_kernels import PilotTables
from rtsim.pilot.schedule import ScheduledPilot
from rtsim.pilot.tables import INTEGRAL_REACH, pack_cells


@functools.lru_cache(maxsize=8)
def load_lateral_pilot(database: Database, *, dt: float = 0.004) -> LateralPilotTables:
    """Take the lateral half of the pilot from a database and pack it for the kernels.

    Args:
        database: One with a lateral half.

    Raises:
        InputError: It carries no such pilot.
    """
    if LATERAL not in database.pilot:
        raise InputError(
            "the database holds no gains for the pilot's lateral half", key=f"pilot/{LATERAL}",
            mend="design them with rtsim model import FILE --design-pilots",
        )  # fmt: skip
    key = f"{database.content_hash} {LATERAL} {dt!r}".encode()
    return packed(kept("pilot", key, lambda: _tables(database, dt)))


def _tables(database: Database, dt: float) -> LateralPilotTables:
    pilot, data = ScheduledPilot.from_arrays(database.pilot[LATERAL]), LateralData.of(database)
    nowhere = dict.fromkeys(("u", "w", "q", "pitch", "altitude"), -1)
    roles, cells, a_columns, c_columns = pack_cells(pilot, nowhere, integrators=True)
    settings = {name: value for name, value in pilot.attributes.items() if not isinstance(value, str)}
    tau = np.full(len(HANDS), settings["delay"])
    model = delay_filter(tau, order=2, kind="pade")
    true = delay_filter(np.maximum(tau - dt, 0.1 * tau), order=2, kind="pade")
    numbers = np.zeros(kernels.NUMBER.size)
    numbers[kernels.NUMBER.filter] = -np.expm1(-dt / settings["schedule_time"])
    reach = INTEGRAL_REACH * settings["integral_time"]
    numbers[kernels.NUMBER.z_v] = reach * settings["heading_maximum"]
    numbers[kernels.NUMBER.z_h] = reach * settings["lateral_velocity_maximum"]
    numbers[kernels.NUMBER.dt] = dt
    rates = [settings[f"{hand}_rate_limit"] for hand in HANDS]
    mocm = PilotTables(
        airspeed=database.airspeed,
        nacelle=database.nacelle,
        trim=np.concatenate([_slip_entries(data), _lead_entries(pilot)], axis=-1),
        loaded=np.zeros((database.airspeed.size, database.nacelle.size, 1)),
        load_factor=np.zeros(0),
        cells=cells,
        a_columns=a_columns,
        c_columns=c_columns,
        lags=np.array([pilot.states.index(f"{hand}_lag") for hand in HANDS]),
        model_delay_a=np.ascontiguousarray(model.A),
        delay_b=np.ascontiguousarray(model.B),
        model_delay_c=np.ascontiguousarray(model.C),
        delay_d=np.ascontiguousarray(np.diag(model.D)),
        output_delay_a=np.ascontiguousarray(true.A),
        output_delay_c=np.ascontiguousarray(true.C),
        limits=np.array([[-1.0, -1.0], [1.0, 1.0], rates]),
        numbers=numbers,
        roles=roles,
    )
    return LateralPilotTables(mocm, data.lateral_velocity)


def _slip_entries(data: LateralData) -> FloatArray:
    """Bank, lateral stick and pedals of each trim in sideslip, node after node (V, N, 3 M)."""
    inputs = data.slip_u_ref.shape[-1] - len(LATERAL_INPUTS)
    bank = data.slip_x_ref[..., len(STATES) + position(LATERAL_STATES, "bank")]
    hands = [data.slip_u_ref[..., inputs + position(LATERAL_INPUTS, hand)] for hand in HANDS]
    entries = np.moveaxis(np.stack([bank, *hands], axis=-1), 0, 2)
    return np.ascontiguousarray(entries.reshape(*entries.shape[:2], -1))


def _lead_entries(pilot: ScheduledPilot) -> FloatArray:
    """Hands that roll and yaw rates and accelerations need (V, N, 8)."""
    rates = [RIGID.index("p"), RIGID.index("r")]
    lags = [pilot.states.index(f"{hand}_lag") for hand in HANDS]
    by_rate = pilot.A[..., rates, :][..., rates]
    by_hand = pilot.A[..., rates, :][..., lags]
    inverse = np.linalg.inv(by_hand)
    lead = np.concatenate([-inverse @ by_rate, inverse], axis=-1)  # [hand][p, r, p', r']
    shape = lead.shape[:2]
    return np.concatenate([lead[..., :2].reshape(*shape, 4), lead[..., 2:].reshape(*shape, 4)], axis=-1)
