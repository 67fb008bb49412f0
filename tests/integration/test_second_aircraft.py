"""A second, made-up tiltrotor (examples/second_tiltrotor): nothing of the XV-15 may fly with it."""

from __future__ import annotations

import dataclasses
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import scenarios
from rtsim.aids.aids_kernels import MAP
from rtsim.aids.design import design_aids
from rtsim.aircraft.profile import parse_profile, xv15_profile
from rtsim.aircraft.variables import position
from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.faults.fault import Fault
from rtsim.loop.options import FlightOptions
from rtsim.lpv.aircraft import LpvAircraft
from rtsim.lpv.database import Database, StoredArrays
from rtsim.lpv.files.storage import load_database, save_database
from rtsim.optimization.problem import ConversionProblem
from rtsim.optimization.report import scenario_text
from rtsim.optimization.search import run_search
from rtsim.optimization.spec import SearchSpec, load_spec
from rtsim.protection.limits import load_limits
from rtsim.units import HORSEPOWER, INCH_POUND, deg, kt
from scenarios.campaign.chunks import Chunk, LawVariant, Task, fly_chunk
from scenarios.files.loader import load_scenario
from scenarios.files.options import Overrides
from scenarios.flight.mavlink_options import MavlinkOptions, mavlink_config
from scenarios.verdicts import tester

EXAMPLE = Path(__file__).parents[2] / "examples" / "second_tiltrotor"
CAMPAIGN = """
format = 1
name = "small"
title = "Small"
law = "full"
duration_s = 10
runs = 2
[[classes]]
name = "early"
start = { above_low_kt = { uniform = [15, 30] }, nacelle_deg = { uniform = [55, 70] } }
pulses = [{ channel = "switch", time_s = 1, duration_s = 8, amount = { uniform = [-7.5, -6] } }]
"""


@pytest.fixture(scope="module")
def example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_aircraft", EXAMPLE / "make_aircraft.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["make_aircraft"] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def folder(example: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("second")
    example.make(made, outer_loops=("integrators",))
    return made


def test_it_flies_a_conversion_by_its_own_pilot_inside_its_own_corridor(folder: Path) -> None:
    flight = scenarios.fly(folder / "conversion.toml", speed="max")
    assert flight.completed
    assert flight.held  # corridor, arrival, altitude, stops: the scenario's expectations
    database = load_database(folder / "two_thirds.nc")
    assert flight.database_hash == database.aircraft_hash != database.content_hash
    assert database.profile.borrowed == ()
    assert flight["engine_power_shp"] == pytest.approx(flight["power_shp"] / 0.94)  # its own transmission
    assert flight["rotor_speed_rpm"] == pytest.approx(589.0 / 0.8)
    with pytest.raises(InputError, match="no nonlinear model of the two-thirds tiltrotor"):
        scenarios.fly(folder / "conversion.toml", speed="max", overrides=Overrides(plant="nonlinear"))


def test_it_is_tested_against_its_own_limits(folder: Path) -> None:
    scenario = load_scenario(folder / "wrong_nacelle_command.toml")
    own, xv15 = tester.Tester().run(scenario), tester.Tester(database="").run(scenario)
    assert (own.law, own.verdict, xv15.verdict) == ("full", "passed", "failed")
    assert own.metrics["worst_margin_kt"] != xv15.metrics["worst_margin_kt"]
    profile = load_database(folder / "two_thirds.nc").profile
    assert load_limits(profile).flapping == deg(11.0) != load_limits().flapping
    with pytest.raises(InputError, match="does not exist"):
        tester.Tester(database=str(folder / "missing.nc"))


def test_it_is_optimized(folder: Path) -> None:
    changes = {"search.generations": 1, "search.population": 4, "search.start_from": ["centre_line"]}
    problem = ConversionProblem(load_spec(folder / "search.toml", changes))
    result = run_search(problem)
    path = problem.path(result.best)
    assert path.points[-1].airspeed_kt == problem.final_airspeed_kt == 136.0
    assert not problem.has_nonlinear_model
    shipped = ConversionProblem(SearchSpec.model_validate({"points": 5, "nacelle_rate_deg_s": 3.75}))
    assert problem.database_hash != shipped.database_hash
    assert run_search_value(problem) != run_search_value(shipped)
    file = folder / "best.toml"
    file.write_text(scenario_text(problem, path), encoding="utf-8")
    assert load_scenario(file).options.database == str(folder / "two_thirds.nc")
    with pytest.raises(InputError, match="does not exist"):
        ConversionProblem(SearchSpec.model_validate({"flight": {"database": str(folder / "missing.nc")}}))


def run_search_value(problem: ConversionProblem) -> float:
    """What the middle of the unit box is worth."""
    return float(problem.evaluate(np.full((1, problem.variables), 0.5)).objectives[0, 0])


def test_campaigns_fly_it_and_refuse_another(folder: Path) -> None:
    own = str(folder / "two_thirds.nc")
    task = Task(CAMPAIGN, "small.toml", (LawVariant("full"), LawVariant("off")), seed=0, options=FlightOptions())
    task = dataclasses.replace(task, aircraft_hash=load_database().aircraft_hash)
    shipped = fly_chunk(task, Chunk(0, 0, 2))
    with pytest.raises(InputError, match="another aircraft than the campaign"):
        fly_chunk(dataclasses.replace(task, options=FlightOptions(database=own)), Chunk(0, 0, 2))
    task = dataclasses.replace(
        task, options=FlightOptions(database=own), aircraft_hash=load_database(own).aircraft_hash
    )
    assert not np.array_equal(fly_chunk(task, Chunk(0, 0, 2)).metrics, shipped.metrics)


def test_a_similar_aircraft_answers_alike_in_scaled_time(example: ModuleType) -> None:
    """The Froude-scaled plant's open loop is the XV-15's with scaled numbers: nothing in between knows the XV-15."""
    size = 0.64
    profile = parse_profile(
        'name = "similar"\nborrows = ["nacelle", "corridor", "protection", "systems", "controls", "pilot", "aids"]\n'
        f"[dimensions]\nspan_ft = 20.6\nscheduling_speed_m_s = {4.5 * size**0.5!r}\nconversion_end_kt = 136.0\n",
        file="similar",
    )
    shipped = load_database()
    similar = dataclasses.replace(example.scaled(shipped, size), profile=profile)
    scale = np.array([size ** example.POWERS[variable.unit] for variable in shipped.states])
    for form in ("layered", "plain"):
        one, other = LpvAircraft(shipped, form=form), LpvAircraft(similar, form=form)
        for airspeed, nacelle in ((kt(20.0), 85.0), (kt(95.0), 60.0), (kt(150.0), 0.2)):
            np.testing.assert_allclose(
                response(other, airspeed * size**0.5, deg(nacelle), size**0.5) / scale,
                response(one, airspeed, deg(nacelle), 1.0),
                rtol=1e-9,
                atol=1e-9,
            )
    damping = design_aids(similar).maps[MAP.pitch_damping] * size**0.5
    np.testing.assert_allclose(damping, design_aids(shipped).maps[MAP.pitch_damping], rtol=1e-9, atol=1e-12)


def response(aircraft: LpvAircraft, airspeed: float, nacelle: float, time: float) -> np.ndarray:
    """States over three seconds (times the time scale) of a stick doublet while the nacelles tilt."""
    database = aircraft.database
    i = int(np.argmin(np.abs(database.airspeed - airspeed)))
    j = int(np.argmin(np.abs(database.nacelle - nacelle)))
    level, stick = database.level_layer, position(database.inputs, "stick")
    x, u = database.x_ref[level, i, j].copy(), database.u_ref[level, i, j].copy()
    dt, rate, angle = 0.004 * time, deg(3.0) / time, float(database.nacelle[j])
    states = []
    for frame in range(750):
        pushed = u.copy()
        pushed[stick] += 0.1 if frame < 250 else -0.1 if frame < 500 else 0.0
        x = aircraft.step(x, pushed, nacelle_angle=angle, nacelle_rate=rate, dt=dt)
        angle += rate * dt
        states.append(x)
    return np.array(states)


@pytest.mark.parametrize("suffix", [".nc", ".mat"])
def test_a_profile_travels_inside_its_database(folder: Path, tmp_path: Path, suffix: str) -> None:
    database = load_database(folder / "two_thirds.nc")
    save_database(database, tmp_path / f"moved{suffix}")
    moved = load_database(tmp_path / f"moved{suffix}")
    assert moved.profile.name == "two-thirds tiltrotor"
    assert moved.aircraft_hash == database.aircraft_hash


def test_a_database_without_a_profile_says_what_it_borrows(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    shipped = load_database()
    # What was built here bears its condition, and is an XV-15; what another wrote does not.
    anonymous = {key: value for key, value in shipped.attributes.items() if key != "cg_in"}
    save_database(dataclasses.replace(shipped, attributes=anonymous), tmp_path / "plain.nc")
    plain = load_database(tmp_path / "plain.nc")
    load_database(tmp_path / "plain.nc")
    assert [record.getMessage().count("flies with the XV-15's nacelle, corridor") for record in caplog.records] == [1]
    assert plain.aircraft_hash == shipped.content_hash
    assert plain.profile.corridor is xv15_profile().corridor


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            ("flapping_deg = 11.0", "flapping_deg = 99.0"),
            ["limits.flapping_deg: is out of range", "0.1 to 60"],
        ),
        (("rate_deg_s = 15.0", 'rate_deg_s = "fast"'), ["nacelle.assigned.rate_deg_s: is not a number"]),
        (("[aids]", "[aid]"), ["aid: is no part of an aircraft profile"]),
        (("span_ft = 20.6\n", ""), ["dimensions.span_ft: is missing"]),
        (('name = "two', 'borrows = ["aids"]\nname = "two'), ["aids: is given and borrowed"]),
        (("speed_kn = [96.0, 100.0, 112.0", "speed_kn = [96.0, 100.0"), ["corridor.high.fast.speed_kn", "6 numbers"]),
        (("contingency_shp = 378.0", "contingency_shp = -1"), ["systems.engine.contingency_shp", "1 to 100000"]),
    ],
)
def test_mistakes_in_a_profile_are_one_sentence(
    folder: Path, tmp_path: Path, change: tuple[str, str], words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    from rtsim.cli.main import run

    text = (folder / "two_thirds.profile.toml").read_text(encoding="utf-8")
    assert change[0] in text
    (tmp_path / "wrong.profile.toml").write_text(text.replace(*change), encoding="utf-8")
    (tmp_path / "wrong.nc").hardlink_to(folder / "two_thirds.nc")
    assert run(["check", str(tmp_path / "wrong.nc")]) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert told.count("rtsim: error:") == 1
    for word in ["wrong.profile.toml", *words]:
        assert word in told


def test_the_order_of_variables_is_data(folder: Path) -> None:
    shipped = load_database()
    save_database(shuffled(shipped), folder / "shuffled.nc")
    own = Overrides(duration=3.0, database=str(folder / "shuffled.nc"))
    flight = scenarios.fly("typical_conversion", speed="max", overrides=own)
    assert flight.history_sha256 == scenarios.fly(
        "typical_conversion", speed="max", overrides=Overrides(duration=3.0)
    ).history_sha256  # fmt: skip


def reordered(array: FloatArray, places: tuple[list[int], ...]) -> FloatArray:
    for axis, place in enumerate(places, start=array.ndim - len(places)):
        array = np.take(array, place, axis=axis)
    return array


def shuffled(database: Database) -> Database:
    """The same aircraft with its variables in reverse order, and an output more."""
    x, u, y = (list(range(len(v)))[::-1] for v in (database.states, database.inputs, database.outputs))
    axes = {"x_ref": (x,), "u_ref": (u,), "y_ref": (y,), "xdot_ref": (x,)}
    axes |= {"A": (x, x), "B": (x, u), "C": (y, x), "D": (y, u)}
    lateral = dict(database.lateral.arrays)
    for name, places in axes.items():
        if f"loaded_{name}" in lateral:
            lateral[f"loaded_{name}"] = reordered(lateral[f"loaded_{name}"], places)
        if f"slip_{name}" in lateral:
            array, split = lateral[f"slip_{name}"], len(places[-1])
            parts = (reordered(array[..., :split], places), array[..., split:])
            lateral[f"slip_{name}"] = np.concatenate(parts, axis=-1)
    return dataclasses.replace(
        database,
        lateral=StoredArrays(lateral, database.lateral.attributes),
        states=tuple(database.states[k] for k in x),
        inputs=tuple(database.inputs[k] for k in u),
        outputs=tuple(database.outputs[k] for k in y),
        x_ref=database.x_ref[..., x],
        u_ref=database.u_ref[..., u],
        y_ref=database.y_ref[..., y],
        xdot_ref=database.xdot_ref[..., x],
        df_dnacelle=database.df_dnacelle[..., x],
        A=database.A[..., x, :][..., x],
        B=database.B[..., x, :][..., u],
        C=database.C[..., y, :][..., x],
        D=database.D[..., y, :][..., u],
    )


def test_ground_stations_see_shares_of_its_own_torque_and_rotor_speed(folder: Path) -> None:
    shipped = mavlink_config(MavlinkOptions(), load_scenario("hover"))[0].ratings
    limits = load_limits().torque
    assert (shipped.torque_inlb, shipped.hover_torque_inlb) == pytest.approx(
        (limits.cruise / INCH_POUND, limits.takeoff / INCH_POUND)
    )
    own = mavlink_config(MavlinkOptions(), load_scenario(folder / "conversion.toml"))[0].ratings
    assert own.torque_inlb == pytest.approx(21800.0)
    assert own.rotor_speed_rpm == pytest.approx(589.0 / 0.8)


def test_the_paper_is_not_reproduced_with_another_aircraft(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from rtsim.cli.main import run

    assert run(["reproduce", "--out", str(folder / "paper"), "--database", str(folder / "two_thirds.nc")]) == 2
    assert "the paper's claims are about the XV-15" in " ".join(capsys.readouterr().err.split())


def test_a_failure_is_one_of_its_own_engines(folder: Path) -> None:
    own = load_database(folder / "two_thirds.nc").profile
    fault = Fault(kind="engine-limit", start=0.0, power=200.0 * HORSEPOWER, other_engine="takeoff")
    assert fault.size(own) == pytest.approx(0.94 * (200.0 + 325.0) * HORSEPOWER)
    assert fault.size() == pytest.approx(0.93 * (200.0 + 1550.0) * HORSEPOWER)
    with pytest.raises(InputError, match="power: is out of range"):
        Fault(kind="engine-limit", start=0.0, power=1000.0 * HORSEPOWER).size(own)
