"""The search for the flight that breaks a law, part by part, without flights: space, methods, shrinking, record.

Sources: the campaign's own draws (the same distribution by another way); functions whose least value is known.
"""

from __future__ import annotations

import copy
import dataclasses

import numpy as np
import pytest
from scipy.stats import kstest

from rtsim.errors import InputError
from rtsim.frame import COLUMN, SIGNAL_COUNT
from rtsim.loop.options import FlightOptions
from rtsim.optimization.methods import CmaMethod
from scenarios.campaign.chance import PointChance, RecordingChance, number_at
from scenarios.campaign.draws import NoStart, draw_plan, plan_by
from scenarios.campaign.spec import Choice, Normal, Uniform, draw, load_campaign, parse_campaign
from scenarios.falsification.archive import Archive
from scenarios.falsification.drawing import RandomSearch, reflected
from scenarios.falsification.evaluation import (
    AIRSPEED_CELLS,
    NACELLE_CELLS,
    SITUATIONS,
    Answer,
    Query,
    cells_of,
    margins_of,
    nearest_of,
)
from scenarios.falsification.methods import DescentSearch
from scenarios.falsification.record import Record
from scenarios.falsification.scenario_tables import scenario_tables, scenario_text
from scenarios.falsification.shrinking import MOST_FLIGHTS, Shrinker
from scenarios.falsification.situations import SituationSearch
from scenarios.falsification.space import class_spaces
from scenarios.falsification.subject import subject_of
from scenarios.falsification.surrogate import SurrogateSearch
from scenarios.files.loader import parse_scenario
from scenarios.flight.flight_setup import flight_setup

SIGNALS = """
format = 1
name = "moved"
title = "moved all the time"
[[classes]]
name = "moved"
start = { airspeed_kt = 100, nacelle_deg = 60 }
signals = [
    { channel = "stick", begin_s = 2, duration_s = 4, bandwidth_hz = 0.5, amount = { uniform = [-0.3, 0.3] } },
    { channel = "switch", duration_s = 3, bandwidth_hz = 0.25, amount = { choice = [-3, 0, 3] } },
]
"""


def answer(value, near=(), flights=1, margin=5.0):
    nearest = np.full(SITUATIONS, 255, dtype=np.uint8)
    nearest[list(near)] = round((margin + 10.0) * 8.0)
    known = np.array([value])
    return Answer(known, known, flights, 0.0, 0.0, 0.0, b"\1" * 62, nearest.tobytes(), "", 0.1)


# --- space ---


@pytest.mark.parametrize(
    ("number", "cumulative"),
    [
        (Uniform(uniform=[2.0, 5.0]), lambda x: np.clip((x - 2.0) / 3.0, 0.0, 1.0)),
        (Normal(normal=[1.0, 0.5]), None),
        (Choice(choice=[1.0, 2.0, 3.0], weights=[1.0, 0.0, 3.0]), None),
    ],
)
def test_a_point_has_the_distribution_that_a_campaign_draws(number, cumulative):
    generator = np.random.default_rng(1)
    points = np.array([number_at(number, share) for share in generator.random(4000)])
    drawn = np.array([draw(number, generator) for _ in range(4000)])
    if cumulative is not None:
        assert kstest(points, cumulative).pvalue > 1e-3
    assert points.mean() == pytest.approx(drawn.mean(), abs=0.06)
    assert points.std() == pytest.approx(drawn.std(), abs=0.06)
    assert set(points) <= set(drawn) or not isinstance(number, Choice)


@pytest.mark.parametrize("name", ["misuse", "turns", "nominal"])
def test_every_class_is_a_cube_whose_points_fly(name):
    """Nine in ten points of every class have a start; each coordinate moves something."""
    spec, _ = load_campaign(name)
    generator = np.random.default_rng(0)
    for space in class_spaces(spec):
        plans = []
        for _ in range(20):
            try:
                plans.append(space.plan(spec, generator.random(space.size)))
            except NoStart:
                continue
        assert len(plans) >= 10, space.name
        middle = np.full(space.size, 0.5)
        known = repr(_plan(space, spec, middle))
        for place in range(space.size):
            changed = [middle.copy() for _ in range(3)]
            for share, vector in zip((0.02, 0.3, 0.97), changed, strict=True):
                vector[place] = share
                # Whether pulses that are not drawn in the middle move anything shows with all of them.
                vector[[k for k, one in enumerate(space.coordinates) if one.place.endswith(".count")]] = 1.0
            assert any(repr(_plan(space, spec, vector)) != known for vector in changed), space.coordinates[place]


def _plan(space, spec, vector):
    try:
        return space.plan(spec, vector)
    except NoStart:
        return None


def test_a_point_without_a_coordinate_is_in_its_middle():
    spec, _ = load_campaign("misuse")
    assert repr(plan_by(PointChance({}), spec, 0)) == repr(class_spaces(spec)[0].plan(spec, np.full(4, 0.5)))


def test_what_changes_nothing_is_no_coordinate():
    spec, _ = load_campaign("misuse")
    places = {one.place for space in class_spaces(spec) for one in space.coordinates}
    assert "seed" not in places  # no turbulence, no noise
    assert "pilot.yields" in places  # of the random classes
    assert not any(one.place.startswith("pilot") for one in class_spaces(spec)[0].coordinates)


def test_signals_follow_each_other_at_their_bandwidth():
    spec, problems = parse_campaign(SIGNALS, file="moved")
    assert not problems
    plan = draw_plan(spec, seed=1, class_number=0, run=0)
    sticks = [pulse for pulse in plan.setup.pulses if pulse.channel == "stick"]
    assert [pulse.start for pulse in sticks] == [2.0, 3.0, 4.0, 5.0]
    assert all(pulse.duration == 1.0 and abs(pulse.amount) <= 0.3 for pulse in sticks)
    assert len({pulse.amount for pulse in sticks}) == 4
    assert [pulse.start for pulse in plan.setup.pulses if pulse.channel == "switch"] == [1.0, 3.0]
    assert class_spaces(spec)[0].size == 6


def test_around_a_scenario_are_hands_and_a_gust():
    spec, _, _ = subject_of("typical_conversion", bandwidth_hz=0.1)
    [space] = class_spaces(spec)
    places = {one.place.split("[")[0] for one in space.coordinates}
    assert places == {"signals", "gusts", "pilot.yields", "pilot.reaction_s"}
    with pytest.raises(InputError, match="typical_conversion"):
        subject_of("typical_conversoin")


def test_recording_asks_for_everything_once():
    spec, _ = load_campaign("turns")
    chance = RecordingChance()
    plan_by(chance, spec, 6)
    assert "faults[0].actuator" in chance.found
    assert "turn.sign" in chance.found


# --- what is told of a flight ---


def test_cells_and_situations_of_a_flight():
    rows = np.zeros((3, SIGNAL_COUNT))
    rows[:, COLUMN.nacelle_deg], rows[:, COLUMN.airspeed_kt] = [90.0, 45.0, 0.0], [5.0, 105.0, 199.0]
    rows[:, COLUMN.margin_kt], rows[:, COLUMN.margin_low_kt] = [20.0, 8.0, 3.0], [20.0, 8.0, 60.0]
    rows[:, COLUMN.margin_high_kt], rows[:, COLUMN.time_s] = [60.0, 50.0, 3.0], [0.0, 5.0, 9.9]
    cells = np.unpackbits(np.frombuffer(cells_of(rows), np.uint8))[: NACELLE_CELLS * AIRSPEED_CELLS]
    assert np.argwhere(cells.reshape(NACELLE_CELLS, AIRSPEED_CELLS)).tolist() == [[0, 19], [9, 10], [18, 0]]
    margins = margins_of(nearest_of(rows, 10.0)).reshape(2, 4, 37)
    assert np.argwhere(margins < np.inf).tolist() == [[0, 2, 18], [1, 3, 0]]
    assert (margins[0, 2, 18], margins[1, 3, 0]) == (8.0, 3.0)


def test_the_account_of_margins_holds_what_lies_outside():
    """Steps of an eighth of a knot, rounded up; nothing below -10 kn is told apart, nothing from 20 kn on is near."""
    for margin, told in ((-50.0, -10.0), (-0.3, -0.25), (3.01, 3.125), (19.9, 20.0), (20.0, np.inf)):
        rows = np.full((1, SIGNAL_COUNT), 50.0)
        rows[:, COLUMN.margin_low_kt], rows[:, COLUMN.time_s] = margin, 0.0
        assert margins_of(nearest_of(rows, 10.0)).min() == told


def test_the_archive_keeps_the_worst_of_every_situation():
    archive = Archive()
    queries = [Query(0, np.array([share])) for share in (0.1, 0.2, 0.3, 0.4)]
    answers = [answer(4.0, (1, 2)), answer(2.0, (2,), margin=9.0), answer(np.inf, flights=0), answer(-1.0, (7,))]
    archive.add(queries, answers)
    assert (len(archive.flown), archive.without_start) == (3, 1)
    assert [archive.elites[0][place].query.vector[0] for place in (1, 2, 7)] == [0.1, 0.2, 0.4]
    assert [archive.nearest[place].query.vector[0] for place in (1, 2, 7)] == [0.1, 0.1, 0.4]
    assert (archive.least(0), archive.first_broken(0)) == (-1.0, 3)
    assert archive.worst(0).query.vector[0] == 0.4


def test_classes_have_situations_of_their_own():
    archive = Archive()
    archive.add([Query(0, np.array([0.1])), Query(3, np.array([0.2]))], [answer(4.0, (1,)), answer(5.0, (1,))])
    assert sorted(archive.nearest) == [1, 3 * SITUATIONS + 1]


# --- methods ---


def bowl(vectors, centre=0.3):
    return ((vectors - centre) ** 2).sum(axis=1) - 0.05


def searched(make, size=6, generations=60, seed=0):
    """Least value of a bowl that a method finds."""
    spaces = [dataclasses.replace(class_spaces(load_campaign("misuse")[0])[0], coordinates=(None,) * size)]
    archive = Archive()
    first = RandomSearch(spaces, np.random.default_rng(seed))
    method = make(spaces, archive)
    for number in range(generations):
        current = first if number == 0 else method
        queries = current.ask()
        values = bowl(np.array([query.vector for query in queries]))
        answers = [answer(value, (int(20 * query.vector[0]),)) for value, query in zip(values, queries, strict=True)]
        archive.add(queries, answers)
        current.tell(answers)
    return archive


@pytest.mark.parametrize("kind", ["cma-es", "surrogate"])
def test_descents_find_the_lowest_point(kind):
    """The bowl's bottom, -0.05, within 0.01; random points of the same number stay above it."""
    found = searched(lambda spaces, archive: DescentSearch(kind, archive, 0, 3, spaces))
    chance = searched(lambda spaces, _: RandomSearch(spaces, np.random.default_rng(9)))
    assert found.least(0) < -0.04
    assert chance.least(0) > found.least(0)


def test_descents_go_on_where_they_get_lower():
    """One class is flat, the other a bowl: most generations go to the bowl, and some still to the flat one."""
    space = class_spaces(load_campaign("misuse")[0])[0]
    spaces = [dataclasses.replace(space, number=number, coordinates=(None,) * 6) for number in range(2)]
    archive, generator = Archive(), np.random.default_rng(2)
    first, method = RandomSearch(spaces, generator), DescentSearch("cma-es", archive, 0, 3, spaces)
    asked = []
    for number in range(40):
        queries = (first if number == 0 else method).ask()
        values = [1.0 if one.class_number == 0 else float(bowl(one.vector[None, :])[0]) for one in queries]
        answers = [answer(value, (3,)) for value in values]
        archive.add(queries, answers)
        if number:
            method.tell(answers)
            asked.append(queries[0].class_number)
    assert asked.count(1) > 20
    assert asked.count(0) > 3


def test_situations_are_gone_round():
    """Situations are fortieths of a mean of eight numbers; the margin is their scatter: flights come nearer in all."""

    def reached(make):
        archive, space = Archive(), class_spaces(load_campaign("misuse")[0])[0]
        method = make([dataclasses.replace(space, coordinates=(None,) * 8)], archive)
        for _ in range(60):
            queries = method.ask()
            archive.add(queries, [situated(query.vector) for query in queries])
        return archive.margins

    def situated(vector):
        return answer(1.0, (min(int(40 * vector.mean()), 39),), margin=30.0 * float(np.std(vector)))

    generator = np.random.default_rng(4)
    by_chance = reached(lambda spaces, _: RandomSearch(spaces, generator))
    gone_round = reached(lambda spaces, archive: SituationSearch(spaces, archive, generator))
    both = set(by_chance) & set(gone_round)
    assert len(both) > 20
    assert np.mean([gone_round[one] for one in both]) < 0.7 * np.mean([by_chance[one] for one in both])


def test_methods_are_functions_of_their_seed():
    for kind in ("cma-es", "surrogate"):
        first, second = (
            searched(lambda spaces, archive: DescentSearch(kind, archive, 0, 3, spaces), generations=12)  # noqa: B023
            for _ in range(2)
        )
        assert np.array_equal(first.robustness(0), second.robustness(0))


def test_a_surrogate_of_few_points_still_asks():
    search = SurrogateSearch(np.array([[0.5, 0.5]]), np.array([1.0]), centre=np.array([0.5, 0.5]), seed=0)
    for _ in range(5):
        points = search.ask()
        assert ((points >= 0.0) & (points <= 1.0)).all()
        search.tell(points.sum(axis=1)[:, None], np.zeros((len(points), 0)))


def test_the_first_step_of_the_cma_es_can_be_chosen():
    spread = [
        np.std(CmaMethod(np.full((1, 5), 0.5), population=40, seed=1, penalty=False, step=step).ask()[1:])
        for step in (0.02, 0.2)
    ]
    assert spread[1] > 5.0 * spread[0]


def test_mirrors_keep_points_in_the_cube():
    assert reflected(np.array([-0.2, 0.4, 1.3, 2.6])).tolist() == pytest.approx([0.2, 0.4, 0.7, 0.6])


# --- scenarios of flights ---


@pytest.mark.parametrize(
    ("campaign", "number"), [("misuse", 0), ("misuse", 7), ("turns", 0), ("turns", 6), ("turns", 8)]
)
def test_a_drawn_flight_is_a_scenario(campaign, number):
    """What the scenario file makes of a plan is the plan, to the digits written."""
    spec, _ = load_campaign(campaign)
    plan = draw_plan(spec, seed=2, class_number=number, run=3, options=FlightOptions(corridor="flight"))
    text = scenario_text(scenario_tables(plan, name="drawn", title="Drawn", law="full"))
    scenario, problems = parse_scenario(text, file="drawn")
    assert not problems
    setup, wanted = flight_setup(scenario), plan.setup
    assert scenario.duration == plan.duration
    assert np.allclose(setup.programme.airspeed, wanted.programme.airspeed, rtol=1e-5)
    assert np.allclose(setup.programme.turn, wanted.programme.turn, rtol=1e-5)
    assert [(one.channel, one.replaces) for one in setup.pulses] == [
        (one.channel, one.replaces) for one in wanted.pulses
    ]
    assert np.allclose([one.amount for one in setup.pulses], [one.amount for one in wanted.pulses], rtol=1e-5)
    assert [(one.kind, one.actuator, one.stop) for one in setup.faults] == [
        (one.kind, one.actuator, one.stop) for one in wanted.faults
    ]
    assert (setup.reaction is None) == (wanted.reaction is None)
    assert setup.options.seed == wanted.options.seed


def everything():
    spec, _ = load_campaign("turns")
    plan = draw_plan(spec, seed=2, class_number=6, run=3)
    tables = scenario_tables(plan, name="all", title="All", law="full")
    tables["pulses"] = [
        {"channel": "stick", "time_s": 1.0 + k, "duration_s": 0.5, "amount": 0.1 * (k + 1)} for k in range(7)
    ]
    tables["air"] = {
        "wind_at_20_ft_kt": 15.0,
        "lateral": True,
        "gusts": [{"time_s": 3.0, "duration_s": 2.0, "ahead_kt": 7.0}],
    }
    tables["reaction_s"] = 1.234567
    return tables


def test_shrinking_leaves_the_cause_alone():
    """The cause is one of seven movements, above a size: all else goes, the movement is halved and written short."""

    def test(tables):
        _, problems = parse_scenario(scenario_text(tables), file="t")
        assert not problems, problems  # every change leaves a scenario
        return any(pulse["time_s"] == 4.0 and pulse["amount"] > 0.15 for pulse in tables.get("pulses", []))

    shrinker = Shrinker(everything(), test)
    small = shrinker.shrink(decided_s=9.0)
    assert small["pulses"] == [{"channel": "stick", "time_s": 4.0, "duration_s": 0.5, "amount": 0.2}]
    assert "air" not in small
    assert "faults" not in small
    assert "reaction_s" not in small
    assert len(small["programme"]["points"]) == 1
    assert "bank_deg" not in small["programme"]["points"][0]
    assert small["duration_s"] <= 5.0
    assert set(small["flight"]) == {"protection"}
    assert shrinker.flights < MOST_FLIGHTS


def test_shrinking_keeps_two_causes_together():
    def test(tables):
        gust, fault = tables.get("air", {}).get("gusts"), tables.get("faults")
        return bool(gust and fault)

    small = Shrinker(everything(), test).shrink(decided_s=30.0)
    assert "pulses" not in small
    assert len(small["faults"]) == len(small["air"]["gusts"]) == 1


def test_shrinking_ends():
    assert Shrinker(everything(), lambda _: False).shrink(5.0) == everything()
    flown = []
    Shrinker(everything(), lambda tables: flown.append(copy.deepcopy(tables)) is None).shrink(5.0)
    assert len(flown) <= MOST_FLIGHTS


# --- record ---

IDENTITY = {"law": "full", "seed": 0}


def flights(queries):
    return [answer(query.vector.sum(), (3,), flights=int(query.vector[0] > 0.1)) for query in queries]


def test_a_record_flies_nothing_twice(tmp_path):
    queries = [[Query(0, np.array([0.05 + 0.3 * k, 0.5])) for k in range(3)] for _ in range(4)]
    first = Record(tmp_path, IDENTITY, flights, pieces="generations")
    wanted = [first(one) for one in queries]

    def never(asked):
        raise AssertionError(f"{len(asked)} points were flown again")

    again = Record(tmp_path, IDENTITY, never, pieces="generations")
    for one, known in zip(queries, wanted, strict=True):
        for found, kept in zip(again(one), known, strict=True):
            assert found.robustness.tolist() == kept.robustness.tolist()
            assert (found.flights, found.problem) == (kept.flights, kept.problem)
            assert not kept.flights or (found.cells, found.nearest) == (kept.cells, kept.nearest)
    with pytest.raises(InputError, match="does not follow from this search's seed"):
        Record(tmp_path, IDENTITY, flights, pieces="generations")([Query(0, np.array([0.9, 0.9]))] * 3)
    with pytest.raises(InputError, match="another search"):
        Record(tmp_path, {"law": "off", "seed": 0}, flights, pieces="generations")
