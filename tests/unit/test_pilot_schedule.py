"""The design plant of a grid point, and the schedule of gains stored with the database."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rtsim.aircraft.profile import xv15_profile
from rtsim.choices import OUTER_LOOPS, OuterLoop
from rtsim.errors import InputError
from rtsim.lpv.database import GRIDDED, Database
from rtsim.lpv.files.storage import load_database
from rtsim.pilot.design import design_problem
from rtsim.pilot.design_plant import CONTROLS, GUSTS, design_plant, plant_layout
from rtsim.pilot.response import frequency_response
from rtsim.pilot.schedule import ScheduledPilot, design_schedule, point_problem
from rtsim.pilot.tables import load_pilot_tables, pack_pilot
from rtsim.pilot.weights import pilot_settings
from rtsim.units import deg, kt

DATABASE = load_database()
SETTINGS = pilot_settings(xv15_profile())
LEVEL = DATABASE.level_layer
POINTS = [(0.0, 90.0), (40.0, 82.5), (81.0, 75.0), (109.0, 50.0), (150.0, 0.0)]


def place(airspeed_kt: float, nacelle_deg: float) -> tuple[int, int, int]:
    i = int(np.argmin(np.abs(DATABASE.airspeed - kt(airspeed_kt))))
    j = int(np.argmin(np.abs(DATABASE.nacelle - deg(nacelle_deg))))
    assert DATABASE.valid[LEVEL, i, j]
    return LEVEL, i, j


def part(rows: slice, columns: slice) -> Database:
    """A corner of the database with all its layers, without gains."""
    arrays = {name: getattr(DATABASE, name)[:, rows, columns] for name in GRIDDED}
    return replace(
        DATABASE,
        airspeed=DATABASE.airspeed[rows],
        nacelle=DATABASE.nacelle[columns],
        rotor_speed=DATABASE.rotor_speed[columns],
        flap=DATABASE.flap[rows, columns],
        pilot={},
        lateral=None,
        **arrays,
    )


def test_layout_sorts_the_states() -> None:
    layout = plant_layout(DATABASE, integrators=True)
    names = [variable.name for variable in DATABASE.states]
    assert [names[k] for k in layout.rigid] == ["u", "w", "q", "pitch", "altitude"]
    assert [[names[k] for k in rows] for rows in layout.actuators] == [["cyclic_1s", "elevator"], ["collective_75"]]
    assert layout.states[-2:] == ("airspeed_integral", "altitude_integral")
    assert plant_layout(DATABASE, integrators=False).states == layout.states[:-2]


@pytest.mark.parametrize(("airspeed_kt", "nacelle_deg"), POINTS)
def test_design_plant_agrees_with_the_whole_model(airspeed_kt: float, nacelle_deg: float) -> None:
    """Against the full 17 states: exact in the static limit, flight modes within 5 %."""
    where = place(airspeed_kt, nacelle_deg)
    layout = plant_layout(DATABASE, integrators=False)
    plant = design_plant(DATABASE, layout, where=where, settings=SETTINGS)
    inputs = [*layout.controls, *layout.gusts]
    rows = list(layout.rigid[:4])
    full_c = np.eye(len(DATABASE.states))[rows]
    gust_columns = [layout.states.index(name) for name in GUSTS]
    moving = [k for k in range(len(layout.states)) if k not in gust_columns]
    reduced_a = plant.A[np.ix_(moving, moving)]
    reduced_b = np.hstack([plant.B[moving], plant.A[np.ix_(moving, gust_columns)]])
    reduced_c = np.eye(len(moving))[:4]
    for frequency, tolerance in ((1e-4, 1e-4), (1e-3, 1e-3)):
        w = np.array([frequency])
        full = frequency_response(DATABASE.A[where], DATABASE.B[where][:, inputs], full_c, None, w)[0]
        reduced = frequency_response(reduced_a, reduced_b, reduced_c, None, w)[0]
        size = np.max(np.abs(full), axis=0)
        assert np.max(np.abs(reduced - full) / size) < tolerance, frequency
    full_modes = np.linalg.eigvals(DATABASE.A[where])
    for mode in np.linalg.eigvals(plant.A[:5, :5]):
        assert np.min(np.abs(full_modes - mode)) < 0.01 + 0.05 * abs(mode), mode


@pytest.mark.parametrize(("airspeed_kt", "nacelle_deg"), POINTS)
def test_displays_are_the_derivatives_of_what_is_seen(airspeed_kt: float, nacelle_deg: float) -> None:
    where = place(airspeed_kt, nacelle_deg)
    layout = plant_layout(DATABASE, integrators=True)
    plant = design_plant(DATABASE, layout, where=where, settings=SETTINGS)
    trim = DATABASE.x_ref[where][list(layout.rigid)]

    def seen(x: np.ndarray, gust: np.ndarray) -> np.ndarray:
        u, w, q, pitch, altitude = x
        airspeed = (u + gust[0]) * np.cos(pitch) + (w + gust[1]) * np.sin(pitch)
        return np.array([airspeed, altitude, u * np.sin(pitch) - w * np.cos(pitch), pitch, q])

    step = 1e-6
    for k in range(5):
        ahead, behind = trim.copy(), trim.copy()
        ahead[k] += step
        behind[k] -= step
        slope = (seen(ahead, np.zeros(2)) - seen(behind, np.zeros(2))) / (2.0 * step)
        assert plant.C[:5, k] == pytest.approx(slope, abs=1e-7)
    for k, name in enumerate(GUSTS):
        gust = np.zeros(2)
        gust[k] = 1.0
        column = layout.states.index(name)
        assert plant.C[:5, column] == pytest.approx(seen(trim, gust) - seen(trim, np.zeros(2)), abs=1e-12)
    # the integrals' rows: airspeed without gusts, and altitude
    assert plant.A[-2, :5] == pytest.approx(plant.C[0, :5])
    assert plant.A[-1, :5] == pytest.approx(plant.C[1, :5])
    assert np.all(plant.A[-2:, [layout.states.index(name) for name in GUSTS]] == 0.0)


def test_gust_filters_have_the_asked_intensity() -> None:
    layout = plant_layout(DATABASE, integrators=False)
    for airspeed_kt, nacelle_deg in POINTS:
        plant = design_plant(DATABASE, layout, where=place(airspeed_kt, nacelle_deg), settings=SETTINGS)
        for k, name in enumerate(GUSTS):
            row = layout.states.index(name)
            variance = plant.E[row, k] ** 2 / (-2.0 * plant.A[row, row])
            assert np.sqrt(variance) == pytest.approx(SETTINGS.gust_intensity)


def test_one_lag_stands_for_both_actuators_of_the_stick() -> None:
    where = place(40.0, 82.5)
    layout = plant_layout(DATABASE, integrators=False)
    plant = design_plant(DATABASE, layout, where=where, settings=SETTINGS)
    names = [variable.name for variable in DATABASE.states]
    for hand, name, actuator in ((0, "stick_lag", "cyclic_1s"), (1, "lever_lag", "collective_75")):
        row = layout.states.index(name)
        rate = -DATABASE.A[where][names.index(actuator), names.index(actuator)]
        assert plant.A[row, row] == pytest.approx(-rate, rel=1e-5)
        assert plant.B[row, hand] == pytest.approx(rate, rel=1e-5)
        assert np.all(plant.B[:5, hand] == 0.0)


def test_a_database_without_a_needed_state_is_refused() -> None:
    states = tuple(replace(v, name="height") if v.name == "altitude" else v for v in DATABASE.states)
    with pytest.raises(InputError, match="altitude"):
        plant_layout(replace(DATABASE, states=states, pilot={}), integrators=True)


@pytest.mark.parametrize("loop", OUTER_LOOPS)
def test_stored_gains_are_those_of_a_fresh_design(loop: OuterLoop) -> None:
    stored = ScheduledPilot.from_arrays(DATABASE.pilot[loop])
    layout = plant_layout(DATABASE, integrators=loop == "integrators")
    for airspeed_kt, nacelle_deg in POINTS:
        where = place(airspeed_kt, nacelle_deg)
        plant = design_plant(DATABASE, layout, where=where, settings=SETTINGS)
        design = design_problem(point_problem(plant, SETTINGS, integrators=layout.integrators))
        for name, fresh in (("l", design.regulator.l), ("F", design.estimator.F), ("G2", design.regulator.G2)):
            kept = getattr(stored, name)[where[1:]]
            assert np.max(np.abs(kept - fresh)) < 1e-4 * np.max(np.abs(fresh)), (name, airspeed_kt)
        assert np.diag(np.linalg.inv(stored.G2[where[1:]])) == pytest.approx([0.1, 0.2], rel=1e-5)


def test_every_valid_level_point_of_the_shipped_database_has_a_pilot() -> None:
    for loop in OUTER_LOOPS:
        stored = ScheduledPilot.from_arrays(DATABASE.pilot[loop])
        assert np.array_equal(stored.valid > 0.0, DATABASE.valid[LEVEL])


@pytest.mark.parametrize("loop", OUTER_LOOPS)
def test_schedule_fills_marks_and_reports(loop: OuterLoop) -> None:
    database = part(slice(2, 7), slice(20, 22))
    level = database.level_layer
    valid = database.valid.copy()
    valid[level, 0] = False
    shares: list[float] = []
    database = replace(database, valid=valid)
    pilot = design_schedule(database, outer_loop=loop, progress=shares.append)
    assert sum(shares) == pytest.approx(1.0)
    assert np.array_equal(pilot.valid > 0.0, valid[level])
    for j in range(2):
        first = int(np.flatnonzero(valid[level, :, j])[0])
        assert np.array_equal(pilot.F[0, j], pilot.F[first, j])
    again = ScheduledPilot.from_arrays(pilot.to_arrays())
    assert again.states == pilot.states
    assert np.array_equal(again.l, pilot.l)
    tables = pack_pilot(database, again, dt=0.004)
    assert tables.cells.shape[:2] == (5, 2)


def test_the_number_of_processes_does_not_matter() -> None:
    database = part(slice(4, 7), slice(23, 25))
    one, two = (design_schedule(database, jobs=jobs) for jobs in (1, 2))
    assert np.array_equal(one.F, two.F)
    assert np.array_equal(one.l, two.l)


def test_gains_that_are_missing_or_of_another_grid_are_refused() -> None:
    with pytest.raises(InputError, match="rtsim model import FILE --design-pilots"):
        load_pilot_tables(replace(DATABASE, pilot={}))
    pilot = ScheduledPilot.from_arrays(DATABASE.pilot["integrators"])
    with pytest.raises(InputError, match="another database"):
        pack_pilot(part(slice(2, 7), slice(20, 24)), pilot, dt=0.004)


def test_feed_forward_meets_the_accelerated_trims() -> None:
    """Pitch and hands at +-3 kn/s: within 0.3 deg and 2 % of travel of the accelerated layers inside the corridor."""
    tables = load_pilot_tables(DATABASE)
    layout = plant_layout(DATABASE, integrators=True)
    count = 1 + len(CONTROLS)
    values = tables.trim.reshape(*tables.trim.shape[:2], 4, count)
    for layer, a in enumerate(DATABASE.layer_acceleration):
        wanted = np.concatenate(
            [DATABASE.x_ref[layer][..., [layout.rigid[3]]], DATABASE.u_ref[layer][..., list(layout.controls)]], axis=-1
        )
        got = values[:, :, 0] + a * values[:, :, 1] + a * a * values[:, :, 2]
        good = DATABASE.valid[layer] & DATABASE.valid[LEVEL]
        error = np.abs(got - wanted)[good]
        assert np.quantile(error[:, 0], 0.95) < deg(0.3), a
        assert np.quantile(error[:, 1], 0.95) < 0.04, a
        assert np.quantile(error[:, 2], 0.95) < 0.02, a
