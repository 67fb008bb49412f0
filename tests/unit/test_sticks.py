"""The stick handler: exact following, no jump when input comes or goes, the nacelle switch in both forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtsim.command import Command, StickInput
from rtsim.corridor.boundaries import load_corridor
from rtsim.errors import InputError
from rtsim.sticks.handler import INPUT_LIVE, INPUT_LOST, INPUT_NONE, StickHandler, StickSituation
from rtsim.sticks.settings import StickSettings, shaped
from rtsim.sticks.transition import TO_AIRPLANE, TO_HELICOPTER, transition_schedule
from rtsim.units import deg, kt, to_deg

DT = 0.004
HELICOPTER = StickSituation(airspeed=0.0, nacelle_command=deg(90.0))
LIVE = StickInput(sequence=1, received_ns=1, stream=1, stick_valid=True, lever_valid=True, lever=0.6)
"""A hand whose lever is where the aircraft's is, and whose stick is centred: it has both at once."""


def handler(settings=None, **options):
    return StickHandler(settings or StickSettings(), start=Command(0.1, 0.6, 0.0), **options)


def fly(hands, sticks, *, frames, age=0.0, situation=HELICOPTER, command_angle=None):
    """Commands and command angles of some frames, the actuator's angle integrated as the simulation does."""
    angle = situation.nacelle_command if command_angle is None else command_angle
    commands, angles = [], []
    for _ in range(frames):
        here = StickSituation(situation.airspeed, angle, situation.trim_stick)
        command = hands.step(sticks, age=age, situation=here, dt=DT)
        angle = min(max(angle + command.nacelle_rate * DT, 0.0), deg(90.0))
        commands.append(command)
        angles.append(angle)
    return commands, angles


def test_nothing_moves_before_the_first_input():
    hands = handler()
    commands, angles = fly(hands, StickInput(), frames=100, age=math.inf)
    assert {command.lever for command in commands} == {0.6}
    assert commands[-1].stick == 0.0
    assert angles[-1] == deg(90.0)
    assert hands.state == INPUT_NONE


def test_a_live_stick_is_applied_in_the_frame_that_reads_it():
    hands = handler()
    fly(hands, LIVE, frames=100)
    for value in (0.3, -1.0, 0.77):
        command = hands.step(LIVE._replace(stick=value, lever=0.2), age=0.001, situation=HELICOPTER, dt=DT)
        assert command.stick == value
        assert command.lever == 0.2


@pytest.mark.parametrize("lever", [0.0, 0.5, 0.9, 1.0])
def test_a_lever_nobody_moved_moves_nothing(lever):
    hands = handler()
    commands, _ = fly(hands, LIVE._replace(lever=lever, stick=0.4), frames=500)
    assert {command.lever for command in commands} == {0.6}
    assert {command.stick for command in commands} == {0.0}
    assert hands.waiting == 3


def test_a_lever_is_taken_by_moving_through_it():
    hands = handler()
    hand = np.linspace(0.5, 0.8, 61).tolist()
    levers = [fly(hands, LIVE._replace(lever=lever), frames=1)[0][0].lever for lever in hand]
    assert set(levers[:20]) == {0.6}
    assert np.max(np.abs(np.diff(levers))) <= 0.01
    assert fly(hands, LIVE._replace(lever=0.3), frames=60)[0][-1].lever == 0.3
    assert hands.waiting == 0


def test_a_step_through_the_lever_fades_in():
    hands = handler()
    fly(hands, LIVE._replace(lever=0.5), frames=5)
    commands, _ = fly(hands, LIVE._replace(lever=0.9), frames=60)
    levers = np.array([0.6, *(command.lever for command in commands)])
    assert np.all(np.diff(levers) >= 0.0)
    assert np.max(np.abs(np.diff(levers))) <= 0.01
    assert levers[-1] == 0.9
    assert levers[25] < 0.9  # still fading at 0.1 s


def test_a_lever_moved_away_takes_the_held_one_along():
    """By as much as the hand moved, whatever it shakes, and it has the lever once it comes back through it."""
    hands = handler()
    for lever in (0.5, 0.505, 0.498, 0.5, 0.4, 0.45, 0.4):
        last = fly(hands, LIVE._replace(lever=lever), frames=5)[0][-1].lever
    assert last == pytest.approx(0.5)
    fly(hands, LIVE._replace(lever=0.51), frames=60)
    assert fly(hands, LIVE._replace(lever=0.2), frames=1)[0][0].lever == 0.2


@pytest.mark.parametrize("change", [{"stream": 2}, {"overridden": 3}, {"age": 1.0}, {"engage": Command(0.0, 0.5, 0.0)}])
def test_another_hand_waits_until_it_moves(change):
    """Another owner or message, input that is back after a loss, another pilot before: the lever stays."""
    hands = handler()
    fly(hands, LIVE._replace(lever=0.6), frames=5)
    fly(hands, LIVE._replace(lever=0.5, stick=0.2), frames=100)
    if "age" in change:
        fly(hands, LIVE, frames=200, age=1.0)
    elif "engage" in change:
        hands.engage(change["engage"])
    other = LIVE._replace(lever=0.9, stick=-0.6, **{key: value for key, value in change.items() if key in LIVE._fields})
    commands, _ = fly(hands, other, frames=300)
    assert {command.lever for command in commands} == {0.5}
    assert commands[-1].stick == 0.0
    last = fly(hands, other._replace(lever=0.4, stick=0.1), frames=100)[0][-1]
    assert (last.stick, last.lever) == (0.1, 0.4)


def test_what_was_moved_while_the_flight_stood_still_fades_in():
    hands = handler()
    fly(hands, LIVE, frames=5)
    hands.go_on()
    commands, _ = fly(hands, LIVE._replace(stick=0.5, lever=0.2), frames=60)
    levers = np.array([0.6, *(command.lever for command in commands)])
    assert np.max(np.abs(np.diff(levers))) <= 0.0101
    assert (commands[-1].stick, levers[-1]) == (0.5, 0.2)


def test_a_stick_that_appears_among_inputs_that_go_on_acts():
    """Somebody gave an override channel a value; a stick nobody had was centred."""
    hands = handler()
    fly(hands, LIVE._replace(stick_valid=False), frames=10)
    assert fly(hands, LIVE._replace(stick=0.3), frames=100)[0][-1].stick == 0.3


@pytest.mark.parametrize("whole_loss_too", [False, True])
def test_a_stick_lost_alone_comes_back_softly(whole_loss_too):
    """It stays at its trim until the hand passes that place, also where a lever came back before it."""
    hands = handler()
    fly(hands, LIVE, frames=5)
    fly(hands, LIVE._replace(stick=0.2), frames=50)
    if whole_loss_too:
        fly(hands, LIVE, frames=50, age=1.0)
    stream = 2 if whole_loss_too else 1
    fly(hands, LIVE._replace(stick_valid=False, stream=stream), frames=200)
    back = LIVE._replace(stick=0.4, stream=stream)
    assert {command.stick for command in fly(hands, back, frames=150)[0]} == {0.0}
    assert hands.waiting & 1
    commands, _ = fly(hands, back._replace(stick=-0.1), frames=100)
    assert np.max(np.abs(np.diff([command.stick for command in commands]))) <= 0.0201
    assert commands[-1].stick == -0.1


def test_lost_input_centres_the_stick_and_holds_lever_and_nacelle():
    hands = handler()
    fly(hands, LIVE, frames=1)
    moving = LIVE._replace(stick=0.6, lever=0.4, nacelle_switch=-1)
    fly(hands, moving, frames=200, situation=StickSituation(0.0, deg(85.0)))
    last = hands.step(moving, age=0.5, situation=HELICOPTER, dt=DT)
    assert hands.state == INPUT_LIVE
    assert last.nacelle_rate < 0.0
    commands, angles = fly(hands, moving, frames=100, age=0.51, situation=StickSituation(0.0, deg(83.0), -0.05))
    sticks = np.array([0.6, *(command.stick for command in commands)])
    assert hands.state == INPUT_LOST
    assert sticks[-1] == -0.05
    assert np.max(np.abs(np.diff(sticks))) <= 0.65 / 75 * 1.01  # 0.3 s for the whole way
    assert sticks[70] != -0.05
    assert {command.lever for command in commands} == {0.4}
    assert set(angles) == {deg(83.0)}


def test_regained_input_has_no_step_and_arrives():
    hands = handler()
    fly(hands, LIVE, frames=1)
    fly(hands, LIVE._replace(stick=0.6, lever=0.4), frames=200)
    fly(hands, LIVE, frames=200, age=1.0)
    back = LIVE._replace(sequence=2, stream=2)
    fly(hands, back._replace(stick=0.1, lever=0.3), frames=1)
    commands, _ = fly(hands, back._replace(stick=-1.0, lever=1.0), frames=110)
    sticks = np.array([0.0, *(command.stick for command in commands)])
    levers = np.array([0.4, *(command.lever for command in commands)])
    assert np.max(np.abs(np.diff(sticks))) <= 0.0201
    assert np.max(np.abs(np.diff(levers))) <= 0.0101
    assert sticks[51] == -1.0  # 1 half travel in 0.2 s
    assert levers[-1] == 1.0


def test_a_released_channel_is_lost_alone():
    hands = handler()
    fly(hands, LIVE, frames=1)
    fly(hands, LIVE._replace(stick=0.6), frames=200)
    commands, _ = fly(hands, LIVE._replace(stick=0.6, stick_valid=False, lever=0.3), frames=100)
    assert commands[-1].stick == 0.0
    assert commands[-1].lever == 0.3
    assert hands.state == INPUT_LIVE


def test_beep_moves_the_nacelles_while_it_is_held():
    hands = handler()
    _, angles = fly(hands, LIVE._replace(nacelle_switch=-1), frames=500)
    # 2.5 deg at the slow rate of 2.73 deg/s aft of 87.5 deg, then 7.5 deg/s.
    assert to_deg(angles[-1]) == pytest.approx(87.5 - 7.5 * (2.0 - 2.5 / 2.73), abs=0.05)
    _, after = fly(hands, LIVE, frames=10, command_angle=angles[-1])
    assert after[-1] == angles[-1]


def test_both_pressed_is_let_go_and_the_rate_parameter_holds():
    hands = handler(StickSettings(nacelle_rate=deg(3.0)))
    _, angles = fly(hands, LIVE._replace(nacelle_switch=-1), frames=250, command_angle=deg(80.0))
    assert to_deg(angles[-1]) == pytest.approx(77.0, abs=1e-6)


def test_detent_switch_runs_to_the_next_detent_and_stops():
    hands = handler(StickSettings(detents=True))
    press = LIVE._replace(nacelle_switch=-1)
    _, angles = fly(hands, press, frames=800)
    assert to_deg(angles[-1]) == pytest.approx(75.0, abs=1e-9)
    fly(hands, LIVE, frames=5, command_angle=angles[-1])
    _fly_press, one = fly(hands, press, frames=2, command_angle=angles[-1])
    _, angles = fly(hands, LIVE, frames=1200, command_angle=one[-1])
    assert to_deg(angles[-1]) == pytest.approx(50.0, abs=1e-9)
    _, one = fly(hands, LIVE._replace(nacelle_switch=1), frames=2, command_angle=angles[-1])
    _, angles = fly(hands, LIVE, frames=1200, command_angle=one[-1])
    assert to_deg(angles[-1]) == pytest.approx(75.0, abs=1e-9)


def test_a_run_to_a_detent_ends_when_the_input_is_lost():
    hands = handler(StickSettings(detents=True))
    _, angles = fly(hands, LIVE._replace(nacelle_switch=-1), frames=3, command_angle=deg(70.0))
    _, angles = fly(hands, LIVE, frames=250, age=2.0, command_angle=angles[-1])
    assert to_deg(angles[-1]) > 69.8


def test_an_absolute_angle_is_reached_exactly_and_the_switch_overrules_it():
    hands = handler()
    hands.go_to(deg(60.0))
    _, angles = fly(hands, LIVE, frames=1500)
    assert to_deg(angles[-1]) == pytest.approx(60.0, abs=1e-9)
    hands.go_to(deg(30.0))
    _, angles = fly(hands, LIVE._replace(nacelle_switch=1), frames=10, command_angle=angles[-1])
    _, after = fly(hands, LIVE, frames=100, command_angle=angles[-1])
    assert after[-1] == angles[-1] > deg(60.0)


def test_an_axis_commands_when_it_moves_and_not_while_it_rests():
    hands = handler()
    rest = LIVE._replace(nacelle_angle=deg(45.0))
    assert set(fly(hands, rest, frames=100)[1]) == {deg(90.0)}  # there from the first: nobody moved it
    axis = LIVE._replace(nacelle_angle=deg(80.0))
    _, angles = fly(hands, axis, frames=1000)
    assert to_deg(angles[-1]) == pytest.approx(80.0, abs=1e-9)
    _, angles = fly(hands, axis._replace(nacelle_switch=-1), frames=100, command_angle=angles[-1])
    _, after = fly(hands, axis, frames=100, command_angle=angles[-1])
    assert after[-1] == angles[-1] < deg(80.0)
    _, angles = fly(hands, axis._replace(nacelle_angle=deg(82.0)), frames=1000, command_angle=after[-1])
    assert to_deg(angles[-1]) == pytest.approx(82.0, abs=1e-9)


AWAY = LIVE._replace(nacelle_angle=math.nan)


@pytest.mark.parametrize(
    ("axis", "gap"),
    [
        ({}, AWAY),  # lost alone
        ({"overridden": 4}, AWAY),
        ({"overridden": 4}, LIVE._replace(nacelle_angle=deg(40.0))),  # an axis at rest beneath an override
        ({"overridden": 4}, AWAY._replace(stream=2)),  # another message came first after a whole loss
    ],
)
def test_an_axis_that_comes_back_where_it_was_has_not_moved(axis, gap):
    hands = handler()
    fly(hands, gap._replace(stream=1), frames=5)
    rest = LIVE._replace(nacelle_angle=deg(80.0), **axis)
    _, angles = fly(hands, rest, frames=1000)
    assert to_deg(angles[-1]) == pytest.approx(80.0)
    _, angles = fly(hands, rest._replace(nacelle_switch=1), frames=100, command_angle=angles[-1])
    assert set(fly(hands, gap, frames=50, command_angle=angles[-1])[1]) == {angles[-1]}
    back = rest._replace(stream=gap.stream)
    assert set(fly(hands, back, frames=50, command_angle=angles[-1])[1]) == {angles[-1]}
    _, angles = fly(hands, back._replace(nacelle_angle=deg(81.0)), frames=1000, command_angle=angles[-1])
    assert to_deg(angles[-1]) == pytest.approx(81.0)
    other = rest._replace(owner=7, stream=3)  # it has not had the axis before
    fly(hands, other._replace(nacelle_angle=math.nan), frames=5, command_angle=angles[-1])
    assert fly(hands, other, frames=5, command_angle=angles[-1])[1][-1] < angles[-1]


def test_trim_buttons_move_the_centre():
    hands = handler()
    fly(hands, LIVE, frames=100)
    commands, _ = fly(hands, LIVE._replace(trim=1), frames=250)
    assert commands[-1].stick == pytest.approx(0.1, abs=1e-3)
    commands, _ = fly(hands, LIVE._replace(stick=0.2), frames=1)
    assert commands[-1].stick == pytest.approx(0.3, abs=1e-3)


BOTH = LIVE._replace(lateral_valid=True, yaw_valid=True)


def test_lateral_stick_and_pedals_are_applied_in_the_frame_that_reads_them():
    hands = handler(StickSettings(dead_band=0.1, expo=0.5))
    fly(hands, BOTH, frames=60)
    for lateral, pedal in ((0.3, -1.0), (-0.77, 0.05), (0.0, 0.5)):
        command = fly(hands, BOTH._replace(lateral=lateral, yaw=pedal), frames=1)[0][0]
        assert command.lateral_stick == shaped(hands.settings, lateral)
        assert command.pedal == shaped(hands.settings, pedal)
        assert (hands.lateral_stick, hands.pedal) == (command.lateral_stick, command.pedal)
    assert command.stick == 0.0


@pytest.mark.parametrize(("field", "channel", "bit"), [("lateral", "lateral_stick", 4), ("yaw", "pedal", 8)])
def test_lateral_controls_wait_for_their_hand_and_go_home_without_it(field, channel, bit):
    hands = handler()
    away = BOTH._replace(**{field: 0.4})
    commands, _ = fly(hands, away, frames=50)
    assert {getattr(command, channel) for command in commands} == {0.0}
    assert hands.waiting == bit
    fly(hands, BOTH, frames=60)
    assert hands.waiting == 0
    commands, _ = fly(hands, away, frames=60)
    assert getattr(commands[-1], channel) == 0.4
    lost, _ = fly(hands, away._replace(**{f"{field}_valid": False}), frames=100)
    values = np.array([0.4, *(getattr(command, channel) for command in lost)])
    assert np.abs(np.diff(values)).max() <= 0.02
    assert values[-1] == 0.0
    fly(hands, BOTH._replace(**{field: 0.2}), frames=50)
    assert hands.waiting == bit  # back, but not at its centre
    fly(hands, BOTH._replace(**{field: -0.1}), frames=100)
    commands, _ = fly(hands, BOTH._replace(**{field: 0.5}, overridden=24), frames=100)
    assert getattr(commands[-1], channel) == 0.0  # another message's hand
    hands.engage(Command(0.0, 0.6, 0.0, 0.3, 0.3))
    assert getattr(fly(hands, BOTH, frames=1)[0][0], channel) == 0.0


def test_a_channel_alone_keeps_the_hands_alive():
    hands = handler()
    fly(hands, StickInput(sequence=1, stream=1, yaw_valid=True), frames=2)
    assert hands.state == INPUT_LIVE
    fly(hands, StickInput(sequence=1, stream=1, yaw_valid=True), frames=2, age=1.0)
    assert hands.state == INPUT_LOST


def test_lateral_trim_moves_its_own_centre():
    hands = handler()
    fly(hands, BOTH, frames=60)
    commands, _ = fly(hands, BOTH._replace(lateral_trim=-1), frames=250)
    assert commands[-1].lateral_stick == pytest.approx(-0.1, abs=1e-3)
    assert (commands[-1].stick, commands[-1].pedal, hands.trim) == (0.0, 0.0, 0.0)
    fly(hands, BOTH._replace(lateral_trim=-1, lateral_valid=False), frames=250)
    assert hands.lateral_trim == pytest.approx(-0.1, abs=1e-3)
    fly(hands, BOTH._replace(lateral_trim=-1), frames=2000)
    assert hands.lateral_trim == -0.5


@pytest.mark.parametrize("name", ["design", "flight"])
def test_the_transition_stays_inside_the_corridor_and_never_turns_back(name):
    corridor = load_corridor(name)
    schedule = transition_schedule(corridor)
    for direction, speeds, start, end in (
        (TO_AIRPLANE, np.linspace(0.0, 165.0, 20_000), 90.0, 0.0),
        (TO_HELICOPTER, np.linspace(160.0, 0.0, 20_000), 0.0, 90.0),
    ):
        hands = handler(schedule=schedule)
        assert hands.start_transition(direction)
        angle, angles = deg(start), []
        for speed in kt(speeds):
            command = hands.step(LIVE, age=0.0, situation=StickSituation(float(speed), angle), dt=DT)
            angle = min(max(angle + command.nacelle_rate * DT, 0.0), deg(90.0))
            angles.append(angle)
            margins = corridor.margins(float(speed), angle)
            # At 165 kn on the downstop the corridor is wide; above it the line keeps away from both sides.
            assert min(margins.low, margins.high) > kt(5.0), (speed, to_deg(angle))
        steps = np.diff(angles)
        assert np.all(steps <= 1e-12) if direction == TO_AIRPLANE else np.all(steps >= -1e-12)
        assert to_deg(angle) == pytest.approx(end, abs=1e-6)
        assert hands.transition == 0


def test_without_a_schedule_there_is_no_transition():
    assert not handler().start_transition(TO_AIRPLANE)
    assert not handler(schedule=transition_schedule(load_corridor("design"))).start_transition(1)


def test_taking_over_keeps_the_lever_without_sticks():
    idle = handler()
    idle.engage(Command(0.2, 0.7, 0.0))
    assert fly(idle, StickInput(), frames=1, age=math.inf)[0][0].lever == 0.7


def test_taking_over_again_does_not_go_on_with_what_was_asked_before():
    """A conversion, an angle or a run to a detent ends when another pilot flies."""
    converting = handler(schedule=transition_schedule(load_corridor("design")))
    converting.start_transition(TO_AIRPLANE)
    going = handler()
    going.go_to(deg(60.0))
    running = handler(StickSettings(detents=True))
    below = StickSituation(airspeed=kt(80.0), nacelle_command=deg(70.0))
    fly(running, LIVE._replace(nacelle_switch=-1), frames=10, situation=below)
    for hands, situation in ((converting, HELICOPTER), (going, HELICOPTER), (running, below)):
        assert fly(hands, LIVE, frames=5, situation=situation)[0][-1].nacelle_rate < 0.0
        hands.engage(Command(0.1, 0.6, 0.0))
        assert all(command.nacelle_rate == 0.0 for command in fly(hands, LIVE, frames=50, situation=situation)[0])


@given(st.floats(0.0, 0.3), st.floats(0.0, 1.0), st.floats(0.1, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_shape_is_odd_monotonic_and_reaches_full_travel(dead_band, expo, scale, first, second):
    settings = StickSettings(dead_band=dead_band, expo=expo, scale=scale)
    assert shaped(settings, -first) == -shaped(settings, first)
    assert shaped(settings, 1.0) == pytest.approx(scale)
    low, high = sorted((first, second))
    assert shaped(settings, low) <= shaped(settings, high)
    assert abs(shaped(settings, first)) <= scale


@given(
    st.lists(
        st.tuples(
            *(st.floats(-1, 1), st.floats(0, 1), st.booleans(), st.booleans()),
            *(st.floats(0, 1), st.integers(1, 2), st.integers(0, 3)),
        ),
        min_size=1,
        max_size=40,
    )
)
def test_no_step_beyond_the_hands_own(inputs):
    """Whatever comes and goes, a control moves by at most its fade rate plus what its hand itself moved."""
    hands = handler()
    fly(hands, StickInput(), frames=100, age=math.inf)
    before, hand_before = (0.0, 0.6), (None, None)
    for stick, lever, stick_valid, lever_valid, age, stream, over in inputs:
        sticks = LIVE._replace(
            stick=stick, lever=lever, stick_valid=stick_valid, lever_valid=lever_valid, stream=stream, overridden=over
        )
        hand = (
            (stream, over & 1, stick) if stick_valid and age <= 0.5 else None,
            (stream, over & 2, lever) if lever_valid and age <= 0.5 else None,
        )
        command = hands.step(sticks, age=age, situation=HELICOPTER, dt=DT)
        now = (command.stick, command.lever)
        for place, fastest in ((0, 0.02), (1, 0.01)):
            mine, last = hand[place], hand_before[place]
            own = abs(mine[2] - last[2]) if mine and last and mine[:2] == last[:2] else 0.0
            assert abs(now[place] - before[place]) <= own + fastest + 1e-9
        before, hand_before = now, hand


def test_settings_refuse_nonsense_and_follow_parameters():
    with pytest.raises(InputError, match="loss_time"):
        StickSettings(loss_time=0.1)
    with pytest.raises(InputError, match="expo"):
        StickSettings(expo=math.nan)
    changed = StickSettings().with_parameter("XV_NAC_RATE", 4.0).with_parameter("XV_NAC_MODE", 1.0)
    assert changed.nacelle_rate == deg(4.0)
    assert changed.detents
    assert StickSettings().with_parameter("XV_UNKNOWN", 1.0) == StickSettings()
    for name, value in StickSettings(expo=0.3).parameters().items():
        changed = changed.with_parameter(name, value)
    assert changed == StickSettings(expo=0.3)
