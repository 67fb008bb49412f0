"""Pilot aids out of the plane of symmetry: what they promise about roots and bandwidth, about switching, in flight."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rtsim.aids.lateral_aids_kernels import LATERAL_MAP
from rtsim.aids.lateral_design import LATERAL_AIDS, design_lateral_aids, knows_lateral_aids
from rtsim.aircraft.variables import ALL_STATES, INPUT, LATERAL_INPUTS, LATERAL_STATES, STATE, STATES, position
from rtsim.analysis.handling import Response, handling, lateral_handling
from rtsim.analysis.handling_levels import bandwidth_level, dutch_roll_level, roll_mode_level, spiral_level
from rtsim.analysis.handling_loop import symmetric_loop
from rtsim.arrays import FloatArray
from rtsim.choices import AidName
from rtsim.command import Command
from rtsim.corridor.boundaries import load_corridor
from rtsim.errors import InputError
from rtsim.frame import COLUMN
from rtsim.loop.setup import build_parts
from rtsim.loop.simulation import FlightSetup, Simulation
from rtsim.lpv.aircraft import load_aircraft
from rtsim.lpv.lateral import LateralData
from rtsim.lpv.reduction import eliminated
from rtsim.programme import Programme
from rtsim.units import deg, kt, to_deg

CONDITIONS = [(0, 90), (20, 90), (40, 90), (60, 75), (80, 75), (100, 60), (120, 30), (170, 0)]
PITCH: tuple[AidName, ...] = ("rate_damping", "attitude_retention", "trim_bias", "altitude_hold")
DAMPED: tuple[AidName, ...] = ("roll_damping", "yaw_damping")
TURNING: tuple[AidName, ...] = (*DAMPED, "bank_retention", "heading_hold", "turn_coordination")
PLANTS = pytest.mark.parametrize("plant", ["lpv", "nonlinear"])
LATERAL = slice(len(STATES), len(STATES) + len(LATERAL_STATES))


def simulation(airspeed_kt: float, nacelle_deg: float, *aids: AidName, plant: str = "lpv") -> Simulation:
    """A flight in other hands than the MOCM's, from a trim, with the pitch aids and height held, and those named."""
    programme = Programme.hold(airspeed=kt(airspeed_kt), nacelle_angle=deg(nacelle_deg), altitude=300.0)
    setup = FlightSetup(programme=programme)
    return Simulation(setup.with_options(pilot="external", plant=plant, aids=(*PITCH, *aids)))


def fly(
    flight: Simulation,
    seconds: float,
    lateral: Callable[[float], float] = lambda _: 0.0,
    pedal: Callable[[float], float] = lambda _: 0.0,
    stick: Callable[[float], float] = lambda _: 0.0,
) -> FloatArray:
    """Aircraft states of a flight with movements of the controls over time, the stick's centre being its trim."""
    lever, states = float(flight._state.u[INPUT.lever]), []
    for frame in range(round(250 * seconds)):
        time = 0.004 * frame
        flight.step(Command(stick(time), lever, 0.0, lateral(time), pedal(time)))
        states.append(flight._state.x.copy())
    return np.array(states)


def pulse(size: float, start: float, end: float) -> Callable[[float], float]:
    """A deflection from one time to another."""
    return lambda time: size if start <= time < end else 0.0


@pytest.mark.parametrize(("airspeed", "nacelle"), CONDITIONS)
def test_aids_make_roll_and_yaw_easier(airspeed: float, nacelle: float) -> None:
    """Dampers raise both bandwidths, roll to level 1 with the bank retained; with the heading held all decays."""
    bare, damped, turning = (
        lateral_handling(load_aircraft(), airspeed=kt(airspeed), nacelle=deg(nacelle), aids=aids)
        for aids in ((), DAMPED, TURNING)
    )
    assert damped.roll.bandwidth > bare.roll.bandwidth + 0.7
    assert damped.yaw.bandwidth > bare.yaw.bandwidth + 0.15
    assert turning.roll.bandwidth > 1.95
    assert damped.rightmost < max(0.02, bare.rightmost)
    assert turning.rightmost < -0.005
    assert dutch_roll_level(turning.dutch_roll) == 1


def test_dutch_roll_roll_mode_and_spiral_are_the_lateral_blocks() -> None:
    """At a grid point, without aids, the modes of the sampled loop are the eigenvalues of the database's block."""
    database = load_aircraft().database
    i, j = int(np.argmin(np.abs(database.airspeed - kt(80.0)))), int(np.argmin(np.abs(database.nacelle - deg(75.0))))
    found = lateral_handling(
        load_aircraft(), airspeed=float(database.airspeed[i]), nacelle=float(database.nacelle[j]), aids=()
    )
    slow = np.linalg.eigvals(LateralData.of(database).A[0, i, j])
    for root in (found.dutch_roll, found.spiral, found.roll_mode):
        assert np.min(np.abs(slow - root)) < 1e-5
    assert 0.05 < -found.dutch_roll.real < 0.12
    assert -1.6 < found.roll_mode < -1.1


def test_holds_are_stable_over_the_corridor() -> None:
    """No root beyond +0.02 rad/s at every fifteenth valid point inside the design corridor, and none in the hover."""
    aircraft, corridor = load_aircraft(), load_corridor("design")
    database = aircraft.database
    valid = np.argwhere(database.valid[database.level_layer] & (database.nacelle >= 0.0))
    inside = [(i, j) for i, j in valid if corridor.inside(database.airspeed[i], database.nacelle[j])]
    for i, j in inside[::15]:
        where = {"airspeed": float(database.airspeed[i]), "nacelle": float(database.nacelle[j])}
        assert lateral_handling(aircraft, aids=TURNING, **where).rightmost < 0.02, where
    aids: tuple[AidName, ...] = (*PITCH, "heading_hold", "position_hold")
    assert lateral_handling(aircraft, airspeed=0.0, nacelle=deg(90.0), aids=aids).rightmost < -0.05
    assert symmetric_loop(aircraft, airspeed=0.0, nacelle=deg(90.0), aids=aids).roots[0].real < -0.05


def test_gains_are_those_of_the_settled_lateral_block() -> None:
    """Sensitivities and dampings of the schedules: accelerations of the full block with the fast states at rest."""
    database = load_aircraft().database
    data, maps = LateralData.of(database), design_lateral_aids(database).maps
    p, pedal = position(LATERAL_STATES, "p"), position(LATERAL_INPUTS, "pedal")
    fast = [k for k, variable in enumerate(LATERAL_STATES) if variable.role in {"rotor", "inflow", "actuator"}]
    a, b = data.A[0, 12, 9], data.B[0, 12, 9]
    x, u = np.zeros(len(LATERAL_STATES)), np.zeros(len(LATERAL_INPUTS))
    x[p], u[pedal] = 0.3, 0.2
    x[fast] = -np.linalg.solve(a[np.ix_(fast, fast)], (a @ x + b @ u)[fast])
    rates = a @ x + b @ u
    rigid = [position(LATERAL_STATES, name) for name in ("v", "p", "r", "bank", "heading")]
    reduced_a, reduced_b = eliminated(a, b, rigid, [pedal])
    np.testing.assert_allclose(reduced_a @ x[rigid] + reduced_b[:, 0] * u[pedal], rates[rigid], atol=1e-10)
    assert maps[LATERAL_MAP.roll_damping, 12, 9] == pytest.approx(reduced_a[1, 1])
    assert maps[LATERAL_MAP.yaw_sensitivity, 12, 9] == pytest.approx(reduced_b[2, 0])
    valid = database.valid[database.level_layer]
    assert np.all(maps[LATERAL_MAP.roll_sensitivity][valid] > 0.2)
    assert np.all(maps[LATERAL_MAP.yaw_sensitivity][valid] > 0.05)


@PLANTS
@pytest.mark.parametrize(("airspeed", "nacelle"), [(0, 90), (60, 75), (170, 0)])
def test_bank_retention_holds_the_bank_that_the_stick_left(plant: str, airspeed: float, nacelle: float) -> None:
    """After a push to some 6 deg the bank stays within 2 deg for eight seconds; the bare one moves on."""
    held = fly(simulation(airspeed, nacelle, "bank_retention", "yaw_damping", plant=plant), 11.0, pulse(0.3, 0.5, 1.5))
    bank = np.degrees(held[:, STATE.bank])
    assert 4.0 < bank[750] < 8.0
    np.testing.assert_allclose(bank[750:], bank[750], atol=2.0)
    bare = np.degrees(fly(simulation(airspeed, nacelle, plant=plant), 11.0, pulse(0.15, 0.5, 1.5))[:, STATE.bank])
    assert np.ptp(bare[750:]) > 1.5 * np.ptp(bank[750:])


@PLANTS
def test_heading_hold_cures_forty_knots(plant: str) -> None:
    """At 40 kn in helicopter mode the bare aircraft leaves its heading after a touch of the pedals, and goes on."""
    bare = np.degrees(fly(simulation(40, 90, plant=plant), 20.0, pedal=pulse(0.2, 0.5, 1.0)))
    held = np.degrees(fly(simulation(40, 90, "heading_hold", plant=plant), 20.0, pedal=pulse(0.2, 0.5, 1.0)))
    assert bare[-1, STATE.heading] > 30.0
    assert np.abs(held[:, STATE.heading]).max() < 3.0
    assert np.ptp(held[2500:, STATE.heading]) < 0.6


@PLANTS
def test_heading_comes_back_by_bank_in_airplane_mode(plant: str) -> None:
    """Ten degrees off at 170 kn: a bank of 20 deg at most brings the heading back with little sideslip."""
    flight = simulation(170, 0, "heading_hold", plant=plant)
    fly(flight, 0.5)
    flight._state.x[STATE.heading] += deg(10.0)
    states = fly(flight, 16.0)
    heading, bank = np.degrees(states[:, STATE.heading]), np.degrees(states[:, STATE.bank])
    assert -20.5 < bank.min() < -12.0
    assert abs(heading[-1]) < 0.3
    assert np.degrees(np.abs(states[:, STATE.v] / states[:, STATE.u])).max() < 3.0


@PLANTS
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_turns_by_stick_alone_are_coordinated(plant: str, side: float) -> None:
    """A 20 deg bank at 80 kn, feet on the floor: sideslip below 2 deg, turn rate that of the bank; less without."""
    push = pulse(0.52 * side, 0.5, 2.5)
    flown = fly(simulation(80, 75, "bank_retention", "turn_coordination", plant=plant), 12.0, push)
    slip = np.degrees(np.arctan2(flown[:, STATE.v], flown[:, STATE.u]))
    bank = flown[-1, STATE.bank]
    assert abs(to_deg(float(bank)) - 20.0 * side) < 1.5
    assert np.abs(slip).max() < 1.5
    assert np.abs(slip[2000:]).max() < 0.4
    turn_rate = (flown[-1, STATE.heading] - flown[-251, STATE.heading]) / 1.0
    assert turn_rate == pytest.approx(9.81 * math.tan(bank) / flown[-1, STATE.u], rel=0.05)
    alone = fly(simulation(80, 75, "bank_retention", plant=plant), 12.0, push)
    assert np.degrees(np.abs(np.arctan2(alone[:, STATE.v], alone[:, STATE.u]))).max() > 2.0


def test_a_heading_is_taken_after_the_turn() -> None:
    """Out of a turn the wings become level and the heading stays."""
    flight = simulation(70, 80, "heading_hold", "turn_coordination")
    states = np.degrees(fly(flight, 25.0, lambda t: pulse(0.4, 1.0, 3.0)(t) - pulse(0.39, 8.0, 10.0)(t)))
    assert states[1900, STATE.bank] > 12.0
    assert states[-1, STATE.heading] > 20.0
    assert abs(states[-1, STATE.bank]) < 0.1
    assert np.ptp(states[-1500:, STATE.heading]) < 0.5


def over_ground(x: FloatArray, wind: FloatArray) -> FloatArray:
    """Velocity north and east [m/s] in a wind that blows to north and east."""
    sp, cp, sb, cb = (
        math.sin(x[STATE.pitch]),
        math.cos(x[STATE.pitch]),
        math.sin(x[STATE.bank]),
        math.cos(x[STATE.bank]),
    )
    sh, ch = math.sin(x[STATE.heading]), math.cos(x[STATE.heading])
    ahead = x[STATE.u] * cp + (x[STATE.v] * sb + x[STATE.w] * cb) * sp
    right = x[STATE.v] * cb - x[STATE.w] * sb
    return np.array([ahead * ch - right * sh, ahead * sh + right * ch]) + wind


def hover(flight: Simulation, seconds: float, wind: FloatArray, **controls: Callable[[float], float]) -> FloatArray:
    """States of a flight over the ground in a wind that begins at once."""
    x, place = flight._state.x, flight._state.x[[STATE.north, STATE.east]].copy()
    x[STATE.u] -= wind[0]  # from level hover, heading north
    x[STATE.v] -= wind[1]
    lever, states = float(flight._state.u[INPUT.lever]), []
    for frame in range(round(250 * seconds)):
        before = over_ground(x, wind)
        moved = {name: move(0.004 * frame) for name, move in controls.items()}
        flight.step(Command(**{"stick": 0.0, "lever": lever, "nacelle_rate": 0.0} | moved))
        place += 0.002 * (before + over_ground(x, wind))
        x[[STATE.north, STATE.east]] = place
        states.append(x.copy())
    return np.array(states)


@pytest.mark.parametrize(
    ("plant", "direction"), [("lpv", 0.0), ("lpv", 90.0), ("lpv", -135.0), ("lpv", 180.0), ("nonlinear", 45.0)]
)
def test_position_hold_stays_in_a_step_of_wind(plant: str, direction: float) -> None:
    """Ten knots from one frame to the next: 2.5 m away at most, and back at the place; the others drift off."""
    to = kt(10.0) * np.array([math.cos(deg(direction)), math.sin(deg(direction))])
    drifted = {}
    for aids in (("position_hold", "heading_hold"), ("bank_retention", "heading_hold")):
        flight = simulation(0, 90, *aids, plant=plant)
        hover(flight, 2.0, np.zeros(2))
        states = hover(flight, 30.0, to)
        drifted[aids[0]] = np.hypot(states[:, STATE.north], states[:, STATE.east])
        assert np.abs(np.degrees(states[:, STATE.heading])).max() < 4.0
    assert drifted["position_hold"].max() < 2.5
    assert drifted["position_hold"][-1] < 0.8
    assert drifted["bank_retention"][-1] > 5.0


@pytest.mark.parametrize("direction", [0.0, 120.0, 270.0])
def test_position_hold_stops_a_drift_with_the_wind(direction: float) -> None:
    """Let go in 12 kn of wind, the aircraft comes to rest over the ground within 60 m and stays where it is."""
    programme = Programme.hold(airspeed=0.0, nacelle_angle=deg(90.0), altitude=100.0)
    aids = (*PITCH, "position_hold", "heading_hold")
    setup = FlightSetup(programme=programme).with_options(
        pilot="external", aids=aids, wind=kt(12.0), wind_from=deg(direction)
    )
    place = fly(Simulation(setup), 50.0)[:, [STATE.north, STATE.east]]
    assert 15.0 < np.hypot(*place[-1]) < 60.0
    assert np.cos(deg(direction)) * place[-1, 0] + np.sin(deg(direction)) * place[-1, 1] < -15.0
    np.testing.assert_allclose(place[-2500:], np.broadcast_to(place[-1], (2500, 2)), atol=0.7)


def test_the_stick_moves_the_place_that_is_held() -> None:
    """A push lets it go, and the aircraft comes to rest elsewhere and stays."""
    flight = simulation(0, 90, "position_hold", "heading_hold")
    hover(flight, 1.0, np.zeros(2))
    states = hover(flight, 45.0, np.zeros(2), lateral_stick=pulse(0.3, 1.0, 2.5), stick=pulse(0.2, 1.0, 2.0))
    place = states[:, [STATE.north, STATE.east]]
    assert np.all(place.max(axis=0) > 1.0)
    np.testing.assert_allclose(place[-2500:], np.broadcast_to(place[-1], (2500, 2)), atol=0.3)
    assert np.abs(np.degrees(states[-1, STATE.bank])) < 0.3


@PLANTS
def test_mirrored_hands_fly_mirrored_flights(plant: str) -> None:
    """With every lateral aid on, hands to the other side fly the same flight to the other side, to the last bit."""
    flights = []
    for side in (1.0, -1.0):
        flight = simulation(45, 85, *sorted(LATERAL_AIDS), plant=plant)
        flights.append(
            fly(flight, 8.0, pulse(0.4 * side, 1.0, 2.5), pulse(-0.3 * side, 4.0, 5.0), pulse(0.2, 2.0, 3.0))
        )
    right, left = flights
    sign = np.ones(len(ALL_STATES))
    sign[LATERAL] = -1.0
    sign[STATE.east] = -1.0
    assert np.abs(right[:, STATE.bank]).max() > deg(5.0)
    np.testing.assert_array_equal(right, left * sign)


@PLANTS
def test_lateral_aids_leave_a_symmetric_flight_symmetric(plant: str) -> None:
    """With all of them on and a stick that moves, nothing out of the plane of symmetry is other than zero."""
    states = fly(
        simulation(60, 75, *sorted(LATERAL_AIDS - {"position_hold"}), plant=plant), 4.0, stick=pulse(0.2, 1, 2)
    )
    without = fly(simulation(60, 75, plant=plant), 4.0, stick=pulse(0.2, 1, 2))
    assert not states[:, LATERAL].any()
    np.testing.assert_array_equal(states, without)


@pytest.mark.parametrize("aid", sorted(LATERAL_AIDS))
@pytest.mark.parametrize(("airspeed", "nacelle"), [(5, 90), (60, 75), (170, 0)])
def test_switching_a_lateral_aid_does_not_step_the_controls(aid: AidName, airspeed: float, nacelle: float) -> None:
    """On and off in a turn with hands off their centre: no control moves by more than 2 % of half its travel."""
    flight = simulation(airspeed, nacelle)
    lever = float(flight._state.u[INPUT.lever])
    columns = [COLUMN.stick, COLUMN.lever, COLUMN.lateral_stick, COLUMN.pedal]
    hands = Command(0.0, lever, 0.0, 0.1, -0.1)
    for _ in range(300):
        before = flight.step(hands)
    for on in (True, False, True):
        flight.set_aid(aid, on)
        for _ in range(150):
            after = flight.step(hands)
            assert np.abs(after[columns] - before[columns]).max() < 0.02
            before = after
    flight.set_pilot("hold")
    flight.step()
    flight.set_pilot("external")
    after = flight.step(hands)
    assert np.abs(after[columns] - before[columns]).max() < 0.02


def test_an_aircraft_that_cannot_turn_refuses_the_lateral_aids() -> None:
    """The plain form stays in its plane of symmetry: refused in one sentence, at the start and in flight."""
    programme = Programme.hold(airspeed=kt(60.0), nacelle_angle=deg(75.0), altitude=100.0)
    plain = FlightSetup(programme=programme).with_options(pilot="external", plant="lpv-plain")
    flight = Simulation(plain)
    for name in LATERAL_AIDS:
        with pytest.raises(InputError, match=rf"{name}.*does not say how the aircraft rolls"):
            build_parts(plain.with_options(aids=(name,)))
        with pytest.raises(InputError, match=f"{name}.*does not say how"):
            flight.set_aid(name, True)  # type: ignore[arg-type]
    database = load_aircraft().database
    assert knows_lateral_aids(database)
    symmetric = dataclasses.replace(database, lateral=None)
    assert not knows_lateral_aids(symmetric)
    assert not design_lateral_aids(symmetric).maps.any()


def test_levels() -> None:
    """Each boundary separates its levels."""
    assert [bandwidth_level("roll", Response(w, 0.05)) for w in (2.1, 1.9, 0.4)] == [1, 2, 3]
    assert [bandwidth_level("pitch", Response(w, 0.05)) for w in (1.1, 0.9, 0.4)] == [1, 2, 3]
    assert bandwidth_level("yaw", Response(3.0, 0.3)) == 3
    assert [dutch_roll_level(complex(-z, 1.5)) for z in (0.2, 0.1, 0.01, -0.01)] == [1, 2, 3, 4]
    assert dutch_roll_level(complex(-0.2, 0.2)) == 4  # slower than 0.4 rad/s
    assert [roll_mode_level(-1.0 / t) for t in (1.0, 2.0, 5.0, 20.0)] == [1, 2, 3, 4]
    assert [spiral_level(math.log(2.0) / t) for t in (30.0, 10.0, 5.0, 2.0)] == [1, 2, 3, 4]
    assert spiral_level(-0.1) == roll_mode_level(math.nan) == 1


def test_the_page_has_the_numbers() -> None:
    """docs/aids.md was written by ``python -m docs.handling`` for this aircraft and these aids."""
    page = (Path(__file__).parents[2] / "docs" / "aids.md").read_text(encoding="utf-8")
    found = lateral_handling(load_aircraft(), airspeed=kt(80.0), nacelle=deg(75.0), aids=DAMPED)
    cells = next(line for line in page.splitlines() if line.startswith("| 80 kn, 75° | damped")).split("|")
    for cell, response in ((cells[3], found.roll), (cells[4], found.yaw)):
        assert float(cell.split(",")[0]) == pytest.approx(response.bandwidth, abs=0.0051)
    assert float(cells[8]) == pytest.approx(found.rightmost, abs=0.0051)
    pitch = handling(load_aircraft(), airspeed=kt(170.0), nacelle=deg(0.0), aids=()).pitch
    bare = next(line for line in page.splitlines() if line.startswith("| 170 kn, 0° | -"))
    assert float(bare.split("|")[2].split("/")[2].split("(")[0]) == pytest.approx(pitch.bandwidth, abs=0.0051)
