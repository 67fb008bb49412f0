"""Prepares a scheduled pilot for the compiled kernels: packs gains and commanded trims by grid cell."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from rtsim.aircraft.variables import RIGID_BODY_STATES
from rtsim.arrays import FloatArray, IntArray
from rtsim.choices import OuterLoop
from rtsim.errors import InputError
from rtsim.kernels.compiled import interpreted
from rtsim.kernels.kept import kept
from rtsim.kernels.packed import Size, packed
from rtsim.lpv.database import Database
from rtsim.lpv.lateral import LateralData
from rtsim.outside import understanding
from rtsim.pilot import layout_kernels as kernels
from rtsim.pilot.delay import delay_filter
from rtsim.pilot.design_plant import CONTROLS, PlantLayout, plant_layout
from rtsim.pilot.layout_kernels import PilotRoles, PilotTables, noise_width, pilot_state_size

if TYPE_CHECKING:
    from rtsim.pilot.schedule import ScheduledPilot  # which designs pilots, with scipy

__all__ = ["PilotTables", "load_pilot_tables", "noise_width", "pack_pilot", "pilot_state_size"]

ACCELERATION_REACH = 2.0
"""Commanded accelerations beyond this multiple of the outermost layer's get that layer's feed-forward."""
CLIMB_SPEED = 15.0
"""Airspeed below which the commanded climb angle fades from the pitch reference [m/s]."""
INTEGRAL_REACH = 2.0
"""Limit of an integral when the pilot takes over, in multiples of its maximum in the design's weights."""


@functools.lru_cache(maxsize=8)
def load_pilot_tables(database: Database, outer_loop: OuterLoop = "integrators", *, dt: float = 0.004) -> PilotTables:
    """Take a pilot from a database and pack it for the kernels.

    Args:
        outer_loop: How airspeed and altitude are held.

    Returns:
        The kernels' tables.

    Raises:
        InputError: The database carries no such pilot.
    """
    if outer_loop not in database.pilot:
        raise InputError(
            "the database holds no gains for this pilot", key=f"pilot/{outer_loop}",
            allowed=", ".join(database.pilot) or "none",
            mend="design them with rtsim model import FILE --design-pilots",
        )  # fmt: skip

    def prepare() -> PilotTables:
        from rtsim.pilot.schedule import ScheduledPilot

        mend = "design the pilots anew (rtsim model import FILE --design-pilots)"
        with understanding("pilot of a database", file=f"pilot/{outer_loop}", mend=mend):
            return _tables(database, ScheduledPilot.from_arrays(database.pilot[outer_loop]), dt)

    return packed(kept("pilot", f"{database.content_hash} {outer_loop} {dt!r}".encode(), prepare))


def pack_pilot(database: Database, pilot: ScheduledPilot, *, dt: float) -> PilotTables:
    """Pack a pilot for the kernels.

    Args:
        database: The trims it follows.
        pilot: Its gains, on the database's axes.

    Returns:
        The kernels' tables.

    Raises:
        InputError: Pilot and database do not belong together.
    """
    return packed(_tables(database, pilot, dt))


def _tables(database: Database, pilot: ScheduledPilot, dt: float) -> PilotTables:
    integrators = pilot.outer_loop == "integrators"
    layout = plant_layout(database, integrators=integrators)
    grid = (database.airspeed.size, database.nacelle.size)
    if layout.states != pilot.states or pilot.A.shape[:2] != grid:
        raise InputError(
            "the gains were designed for another database", key=f"pilot/{pilot.outer_loop}", value=pilot.A.shape[:2],
            allowed=f"{grid} cells, states {' '.join(layout.states)}", mend="build them again with rtsim model build",
        )  # fmt: skip
    positions = dict(zip(RIGID_BODY_STATES, layout.rigid, strict=True))
    roles, cells, a_columns, c_columns = pack_cells(pilot, positions, integrators=layout.integrators)
    settings = pilot.attributes
    tau = np.full(len(CONTROLS), float(settings["delay"]))
    order, kind = int(settings["pade_order"]), "taylor" if settings["pade_kind"] == "taylor" else "pade"
    model = delay_filter(tau, order=order, kind="taylor" if kind == "taylor" else "pade")
    # the output is held over a frame and its inputs over another: half a frame each, so the true filter is shorter
    true = delay_filter(np.maximum(tau - dt, 0.1 * tau), order=order, kind="taylor" if kind == "taylor" else "pade")
    return PilotTables(
        airspeed=database.airspeed,
        nacelle=database.nacelle,
        trim=_trim_table(database, layout),
        loaded=_loaded_table(database, layout),
        load_factor=np.zeros(0) if database.lateral is None else LateralData.of(database).load_factor,
        cells=cells,
        a_columns=a_columns,
        c_columns=c_columns,
        lags=np.array([pilot.states.index(f"{n}_lag") if f"{n}_lag" in pilot.states else -1 for n in CONTROLS]),
        model_delay_a=np.ascontiguousarray(model.A),
        delay_b=np.ascontiguousarray(model.B),
        model_delay_c=np.ascontiguousarray(model.C),
        delay_d=np.ascontiguousarray(np.diag(model.D)),
        output_delay_a=np.ascontiguousarray(true.A),
        output_delay_c=np.ascontiguousarray(true.C),
        limits=np.array(
            [[-1.0, 0.0], [1.0, 1.0], [float(settings["stick_rate_limit"]), float(settings["lever_rate_limit"])]]
        ),
        numbers=_numbers(pilot, database, dt),
        roles=roles,
    )


def _numbers(pilot: ScheduledPilot, database: Database, dt: float) -> FloatArray:
    settings = {key: value for key, value in pilot.attributes.items() if not isinstance(value, str)}
    numbers = np.zeros(kernels.NUMBER.size)
    numbers[kernels.NUMBER.filter] = -np.expm1(-dt / settings["schedule_time"])
    numbers[kernels.NUMBER.acceleration_limit] = ACCELERATION_REACH * float(np.max(np.abs(database.layer_acceleration)))
    numbers[kernels.NUMBER.climb_speed] = CLIMB_SPEED
    numbers[kernels.NUMBER.kp_v] = settings["airspeed_proportional"]
    numbers[kernels.NUMBER.ki_v] = settings["airspeed_integral"]
    numbers[kernels.NUMBER.kp_h] = settings["altitude_proportional"]
    numbers[kernels.NUMBER.ki_h] = settings["altitude_integral"]
    reach = INTEGRAL_REACH * settings["integral_time"]
    numbers[kernels.NUMBER.z_v] = reach * settings["airspeed_maximum"]
    numbers[kernels.NUMBER.z_h] = reach * settings["altitude_maximum"]
    numbers[kernels.NUMBER.dt] = dt
    return numbers


def _padded(count: int) -> int:
    return interpreted(kernels.pad4)(count)


def _columns(matrix: FloatArray, padded: int) -> FloatArray:
    """Flatten (..., rows, columns) column after column, each padded with zeros."""
    filled = np.zeros((*matrix.shape[:-2], matrix.shape[-1], padded))
    filled[..., : matrix.shape[-2]] = np.swapaxes(matrix, -1, -2)
    return filled.reshape(*matrix.shape[:-2], -1)


def pack_cells(
    pilot: ScheduledPilot, positions: Mapping[str, int], *, integrators: bool
) -> tuple[PilotRoles, FloatArray, IntArray, IntArray]:
    """Flatten the gains of each cell and note where each section starts.

    Args:
        pilot: The gains.
        positions: Places of the rigid body in the aircraft state.
        integrators: The plant's last states are integrals of the first displays' errors.
    """
    n, hands, displays = pilot.A.shape[-1], pilot.G2.shape[-1], pilot.C.shape[-2]
    estimate = pilot.F.shape[-2]
    rows, seen, wide = _padded(n), _padded(displays), _padded(estimate)
    a_columns = np.flatnonzero(np.any(pilot.A != 0.0, axis=(0, 1, 2)))
    c_columns = np.flatnonzero(np.any(pilot.C != 0.0, axis=(0, 1, 2)))
    noise = np.sqrt(np.concatenate([pilot.V_y, pilot.V_u], axis=-1))
    grid = pilot.A.shape[:2]
    sections = {
        "a": _columns(pilot.A[..., a_columns], rows),
        "b": _columns(pilot.B, rows),
        "nacelle": _columns(pilot.nacelle_effect[..., :1], rows),
        "c": _columns(pilot.C[..., c_columns], seen),
        "f": _columns(pilot.F, wide),
        "l": _columns(pilot.l, hands),
        "g": pilot.G2.reshape(*grid, -1),
        "v": noise,
    }
    starts = np.cumsum([0, *(section.shape[-1] for section in sections.values())]).tolist()
    roles = PilotRoles(
        loop=Size(kernels.LOOP_INTEGRATORS if integrators else kernels.LOOP_PI),
        plant=Size(n),
        delay=Size(estimate - n - hands),
        hands=Size(hands),
        displays=Size(displays),
        a_columns=Size(a_columns.size),
        c_columns=Size(c_columns.size),
        **{name: Size(place) for name, place in positions.items()},
        **{name: Size(place) for name, place in zip((*sections, "end"), starts, strict=True)},
    )
    cells = np.ascontiguousarray(np.concatenate(list(sections.values()), axis=-1))
    return roles, cells, a_columns.astype(np.int64), c_columns.astype(np.int64)


def _trim_table(database: Database, layout: PlantLayout) -> FloatArray:
    """Pitch and hands of the level trim, how they change with acceleration (two orders) and with airspeed.

    Where an accelerated trim is missing, its *difference* from the level trim is taken from the nearest airspeed at
    which both exist, so that the feed-forward never mixes trims of different airspeeds.
    """
    level = database.level_layer
    values = np.concatenate(
        [database.x_ref[..., [layout.rigid[3]]], database.u_ref[..., list(layout.controls)]], axis=-1
    )
    base = values[level]
    layers = [k for k in range(database.layer_acceleration.size) if k != level]
    slopes = np.zeros((2, *base.shape))
    if layers:
        a = database.layer_acceleration[layers]
        steps = np.stack([_difference(database, values, layer) for layer in layers])
        orders = min(2, len(layers))
        powers = np.stack([a ** (order + 1) for order in range(orders)], axis=1)
        slopes[:orders] = np.tensordot(np.linalg.pinv(powers), steps, axes=1)
    along = _airspeed_slope(base, database)
    return np.ascontiguousarray(np.concatenate([base, slopes[0], slopes[1], along], axis=-1))


def _loaded_table(database: Database, layout: PlantLayout) -> FloatArray:
    """What trims at load factors above 1 add to pitch and hands."""
    grid = (database.airspeed.size, database.nacelle.size)
    if database.lateral is None:
        return np.zeros((*grid, 1))
    data, level = LateralData.of(database), database.level_layer
    pitch = data.loaded_x_ref[..., [layout.rigid[3]]] - database.x_ref[level][..., [layout.rigid[3]]]
    hands = data.loaded_u_ref[..., list(layout.controls)] - database.u_ref[level][..., list(layout.controls)]
    entries = np.moveaxis(np.concatenate([pitch, hands], axis=-1), 0, 2)
    return np.ascontiguousarray(entries.reshape(*grid, -1))


def _airspeed_slope(base: FloatArray, database: Database) -> FloatArray:
    """Slope of the level trim with airspeed, one-sided at the rim of the trims, then filled outwards."""
    valid = database.valid[database.level_layer]
    slope = np.zeros_like(base)
    for nacelle in range(valid.shape[1]):
        good = np.flatnonzero(valid[:, nacelle])
        if good.size > 1:
            slope[good, nacelle] = np.gradient(base[good, nacelle], database.airspeed[good], axis=0)
        for v in np.flatnonzero(~valid[:, nacelle]):
            slope[v, nacelle] = slope[good[np.argmin(np.abs(database.airspeed[good] - database.airspeed[v]))], nacelle]
    return slope


def _difference(database: Database, values: FloatArray, layer: int) -> FloatArray:
    """Accelerated minus level trim, filled along airspeed where one of them is missing."""
    level = database.level_layer
    difference = np.asarray(values[layer] - values[level])
    both = database.valid[layer] & database.valid[level]
    for nacelle in range(both.shape[1]):
        good = np.flatnonzero(both[:, nacelle])
        if not good.size:
            difference[:, nacelle] = 0.0
            continue
        for v in np.flatnonzero(~both[:, nacelle]):
            difference[v, nacelle] = difference[
                good[np.argmin(np.abs(database.airspeed[good] - database.airspeed[v]))], nacelle
            ]
    return difference
