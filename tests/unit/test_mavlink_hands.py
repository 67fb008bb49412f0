"""How a flight and its hands fit together: settings, names, take-over, aids, requests; without a MAVLink process."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pytest

from rtsim.aids.design import AIDS, SWITCHES
from rtsim.choices import AidName
from rtsim.command import StickInput
from rtsim.errors import InputError
from rtsim.frame import COLUMN
from rtsim.loop.simulation import Simulation
from rtsim.realtime.control import FlightControl
from rtsim.realtime.executive import Executive
from rtsim.units import to_deg
from scenarios.files.loader import load_scenario
from scenarios.files.options import Overrides, with_overrides
from scenarios.flight.flight_setup import flight_setup
from scenarios.flight.hands import Hands
from scenarios.flight.mavlink_options import MavlinkOptions, mavlink_config
from scenarios.flight.session import FlightSession
from scenarios.flight.sinks import FlightSinks
from telemetry.mavlink.exchange import Request
from telemetry.mavlink.parameters import AID_PARAMETERS

FLYING = StickInput(sequence=1, received_ns=1, stick_valid=True, lever_valid=True, lever=0.3)


class FakeInput:
    """Sticks and requests a test sets by hand."""

    first_use_age = 0.002

    def __init__(self):
        self.sticks, self.seconds, self.asked = StickInput(), math.inf, []

    def read(self):
        return self.sticks

    def age(self):
        return self.seconds

    def requests(self):
        taken, self.asked = self.asked, []
        return taken

    def ages(self):
        return None


class FakeLink:
    """The link as the hands use it."""

    def __init__(self, config):
        self.config, self.input, self.reports, self.port = config, FakeInput(), [], 1

    def report(self, feedback):
        self.reports.append(feedback)

    def watch(self):
        pass

    def counters(self):
        return {}


@pytest.fixture(name="flight")
def _flight():
    scenario = with_overrides(load_scenario("manual_flight"), Overrides(pilot="mavlink"))
    simulation = Simulation(flight_setup(scenario))
    config, warning = mavlink_config(MavlinkOptions(), scenario)
    assert warning is None
    link, control = FakeLink(config), FlightControl()
    hands = Hands(link, simulation, control=control, waits=True)
    session = FlightSession(simulation, frames=100_000, hands=hands, pilot_name="mavlink")
    events = []
    session.on_event = events.append
    return SimpleNamespace(session=session, link=link, control=control, events=events, simulation=simulation)


def fly(flight, frames):
    return np.array([flight.session.step() for _ in range(frames)])


def live(flight, **changes):
    flight.link.input.sticks = FLYING._replace(**changes)
    flight.link.input.seconds = 0.001


def test_scenarios_and_parameters_name_the_aids_there_are():
    assert set(get_args(AidName)) == set(AIDS)
    assert set(SWITCHES) <= set(AID_PARAMETERS)


def test_the_virtual_pilot_holds_until_sticks_arrive_and_no_control_steps(flight):
    before = fly(flight, 50)
    assert set(before[:, COLUMN.pilot_mode]) == {0.0}
    live(flight, stick=0.4)
    after = fly(flight, 250)
    assert set(after[:, COLUMN.pilot_mode]) == {1.0}
    # Nobody moved anything: the lever stays where the virtual pilot had it, and the stick waits for its centre.
    assert np.ptp(after[:, COLUMN.pilot_lever]) == 0.0
    assert np.max(np.abs(after[:, COLUMN.altitude_m] - before[-1, COLUMN.altitude_m])) < 1.0
    assert flight.link.reports[-1].waiting == 3.0
    live(flight)
    fly(flight, 1)
    live(flight, stick=0.4, lever=0.75)
    moved = fly(flight, 80)
    assert (moved[-1, COLUMN.pilot_stick], moved[-1, COLUMN.pilot_lever]) == (0.4, 0.75)
    assert flight.link.reports[-1].waiting == 0.0
    both = np.vstack((before, after, moved))
    assert np.max(np.abs(np.diff(both[:, COLUMN.lever]))) <= 0.01
    both = np.vstack((before, after))
    assert np.max(np.abs(np.diff(both[:, COLUMN.stick]))) <= 0.02  # 1 % of the travel from -1 to 1
    assert np.max(np.abs(np.diff(both[:, COLUMN.lever]))) <= 0.01
    assert [(event.kind, event.data["mode"], event.data["row"]) for event in flight.events] == [
        ("pilot", "external", 50)
    ]


def test_a_pilot_chosen_on_purpose_is_not_taken_over_by_sticks(flight):
    live(flight)
    fly(flight, 5)
    flight.link.input.asked = [Request("pilot", "mocm")]
    rows = fly(flight, 20)
    assert set(rows[:, COLUMN.pilot_mode]) == {0.0}
    flight.link.input.asked = [Request("pilot", "next")]
    assert fly(flight, 1)[0, COLUMN.pilot_mode] == 1.0
    flight.session.switch_pilot("hold")
    assert fly(flight, 1)[0, COLUMN.pilot_mode] == 2.0


def test_aids_are_switched_and_recorded(flight):
    live(flight)
    fly(flight, 2)
    flight.link.input.asked = [
        Request("aid", "rate_damping", 2.0),
        Request("aid", "altitude_hold", 1.0),
        Request("aid", "altitude_hold", 1.0),
        Request("aid", "no_such_aid", 1.0),
    ]
    fly(flight, 1)
    assert set(flight.simulation.aids) == {
        "attitude_retention",
        "trim_bias",
        "altitude_hold",
        "automatic_flaps",
        "governor",
    }
    assert [event.data["aid"] for event in flight.events if event.kind == "aid"] == ["rate_damping", "altitude_hold"]
    assert flight.link.reports[-1].aids == sum(1 << list(SWITCHES).index(name) for name in flight.simulation.aids)


def test_flaps_and_governor_by_request(flight):
    """By angle and by button steps; a setting switches the automatic off; every change is an event for the replay."""
    live(flight, lever=flight.simulation.pilot_command().lever)
    fly(flight, 2)
    flight.link.input.asked = [Request("flaps", "up"), Request("aid", "governor", 2.0), Request("throttle", "", 0.02)]
    rows = fly(flight, 1500)
    assert rows[-1, COLUMN.flap_deg] == pytest.approx(20.0)
    assert set(flight.simulation.aids) == {"rate_damping", "attitude_retention", "trim_bias"}
    assert rows[-1, COLUMN.rotor_speed_rpm] != pytest.approx(589.0, abs=0.5)
    flight.link.input.asked = [Request("flaps", "down"), Request("flaps", "down"), Request("flaps", "down")]
    assert fly(flight, 4000)[-1, COLUMN.flap_deg] == pytest.approx(75.0)
    flight.link.input.asked = [Request("flaps", "", math.radians(33.0)), Request("aid", "governor", 1.0)]
    rows = fly(flight, 5000)
    assert rows[-1, COLUMN.flap_deg] == pytest.approx(33.0)
    assert rows[-1, COLUMN.rotor_speed_rpm] == pytest.approx(589.0, abs=0.01)
    flight.link.input.asked = [Request("aid", "automatic_flaps", 2.0), Request("flaps", "", 2.0)]
    fly(flight, 1)
    assert "automatic_flaps" in flight.simulation.aids
    kinds = [event.kind for event in flight.events]
    assert kinds.count("flaps") == 4  # 20, 40, 75, 33; the third step down is beyond the end
    assert kinds.count("throttle") == 1
    assert kinds.count("refused") == 1


def test_handing_over_without_the_governor_is_advised_against(flight):
    flight.session.switch_pilot("external")
    flight.session.switch_pilot("mocm")
    assert "advice" not in {event.kind for event in flight.events}
    flight.simulation.set_aid("governor", False)
    flight.session.switch_pilot("mocm")
    assert flight.events[-1].kind == "advice"
    assert flight.events[-1].level == "warning"


def test_a_reset_while_paused_forgets_what_was_asked_before(flight):
    for request in (Request("flaps", "up"), Request("reset"), Request("aid", "governor", 0.0)):
        flight.link.input.asked = [request]
        flight.control.poll()
    rows = fly(flight, 50)
    assert rows[-1, COLUMN.flap_deg] == 40.0
    assert "governor" not in flight.simulation.aids


def test_the_nacelles_go_where_a_request_says(flight):
    live(flight)
    fly(flight, 2)
    flight.link.input.asked = [Request("nacelle", "", math.radians(80.0))]
    rows = fly(flight, 700)
    assert rows[-1, COLUMN.nacelle_reference_deg] == pytest.approx(80.0, abs=1e-9)
    assert to_deg(flight.link.reports[-1].nacelle_command) == pytest.approx(80.0, abs=1e-9)


def test_a_conversion_by_command_takes_the_controls_and_keeps_the_lever(flight):
    before = fly(flight, 10)
    flight.link.input.asked = [Request("transition", "", 4.0)]
    rows = fly(flight, 500)
    assert set(rows[:, COLUMN.pilot_mode]) == {1.0}
    assert rows[-1, COLUMN.nacelle_deg] < 85.0
    assert np.max(np.abs(rows[:, COLUMN.lever] - before[-1, COLUMN.lever])) < 0.01
    assert flight.link.reports[-1].transition == 4.0


def test_lost_input_is_reported_and_the_lever_stays(flight):
    live(flight, lever=0.9)
    fly(flight, 2)
    live(flight, stick=0.2, lever=0.5)
    fly(flight, 600)
    flight.link.input.seconds = 1.0
    rows = fly(flight, 100)
    assert flight.link.reports[-1].input_state == 2.0
    assert rows[-1, COLUMN.pilot_stick] == 0.0
    assert set(rows[:, COLUMN.pilot_lever]) == {0.5}


def test_lateral_stick_and_pedals_fly(flight):
    """They act in the row, come back in the report, and make no step when the virtual pilot takes over and back."""
    live(flight, lateral_valid=True, yaw_valid=True)
    fly(flight, 60)
    live(flight, lateral_valid=True, yaw_valid=True, lateral=0.4, yaw=-0.3)
    rows = fly(flight, 30)
    lateral = [COLUMN.lateral_stick, COLUMN.pedal]
    assert rows[-1, lateral].tolist() == [0.4, -0.3]
    assert rows[-1, [COLUMN.pilot_lateral_stick, COLUMN.pilot_pedal]].tolist() == [0.4, -0.3]
    assert (flight.link.reports[-1].lateral, flight.link.reports[-1].yaw) == (0.4, -0.3)
    flight.session.switch_pilot("mocm")
    taken = fly(flight, 100)
    flight.session.switch_pilot("external", by_hand=True)
    back = fly(flight, 100)
    steps = np.diff(np.vstack((rows[-1:], taken, back))[:, lateral], axis=0)
    assert np.abs(steps).max() <= 0.017  # the virtual pilot's feet: 4 travels a second
    assert int(flight.link.reports[-1].waiting) & 12 == 12  # hand and feet are elsewhere
    # So both are centred, and what acted last fades in the aids' fade time of 1 s.
    np.testing.assert_allclose(back[1:, lateral], (1.0 - 0.004) * back[:-1, lateral], rtol=1e-9)


def test_a_hand_on_the_pedals_alone_takes_the_controls(flight):
    flight.link.input.sticks = StickInput(sequence=1, received_ns=1, yaw_valid=True)
    flight.link.input.seconds = 0.001
    assert set(fly(flight, 5)[:, COLUMN.pilot_mode]) == {1.0}


def test_parameters_change_the_hands_and_are_noted(flight):
    live(flight, nacelle_switch=-1)
    flight.link.input.asked = [Request("parameter", "XV_NAC_RATE", 1.0)]
    rows = fly(flight, 10)
    assert rows[-1, COLUMN.nacelle_command_rate_deg_s] == pytest.approx(-1.0)
    assert [event.text for event in flight.events if event.kind == "parameter"] == ["XV_NAC_RATE = 1"]


def test_reset_and_freeze_go_to_the_executive_also_while_it_stands(flight):
    flight.link.input.asked = [Request("reset"), Request("freeze")]
    fly(flight, 1)
    assert [request.action for request in flight.control.requests] == ["reset", "toggle-pause"]
    flight.control.requests.clear()
    flight.link.input.asked = [Request("pilot", "hold"), Request("freeze")]
    flight.control.poll()
    assert [request.action for request in flight.control.requests] == ["toggle-pause"]
    assert fly(flight, 1)[0, COLUMN.pilot_mode] == 2.0


def test_what_ground_stations_do_to_the_flight_is_an_event(flight):
    """A freeze and its end, nacelles and conversions by command, and what the MAVLink process has to tell."""
    live(flight)
    fly(flight, 1)
    flight.link.on_note("Ignored 127.0.0.1:1: system 1 is no station's id")
    flight.link.input.asked = [Request("nacelle", "", math.radians(80.0)), Request("transition", "", 3.0)]
    fly(flight, 1)
    flight.link.input.asked = [Request("freeze")]
    fly(flight, 1)
    flight.control.paused = True
    flight.link.input.asked = [Request("freeze")]
    flight.control.poll()
    fly(flight, 1)
    kinds = [event.kind for event in flight.events]
    assert kinds == ["pilot", "mavlink", "nacelle", "transition", "freeze", "thaw"]


def test_what_is_asked_for_after_a_reset_acts_after_it(flight):
    flight.link.input.asked = [
        Request("reset"),
        Request("flaps", "", math.radians(20.0)),
        Request("throttle", "", 0.02),
    ]
    fly(flight, 1)
    assert [request.action for request in flight.control.requests] == ["reset"]
    assert "automatic_flaps" in flight.simulation.aids
    flight.session.reset()
    assert fly(flight, 51)[-1, COLUMN.flap_deg] == pytest.approx(39.0)
    assert [event.kind for event in flight.events] == ["reset", "flaps", "throttle"]


def test_after_a_reset_the_hands_wait_again(flight):
    live(flight)
    fly(flight, 20)
    flight.link.input.seconds = math.inf
    flight.session.reset()
    assert set(fly(flight, 20)[:, COLUMN.pilot_mode]) == {0.0}
    flight.link.input.seconds = 0.0
    assert fly(flight, 1)[0, COLUMN.pilot_mode] == 1.0


def test_a_gentle_touchdown_completes_a_hand_flight():
    scenario = with_overrides(load_scenario("manual_flight"), Overrides(pilot="mavlink", altitude=0.3))
    simulation = Simulation(flight_setup(scenario))
    link = FakeLink(mavlink_config(MavlinkOptions(), scenario)[0])
    session = FlightSession(
        simulation, frames=10_000, hands=Hands(link, simulation, control=FlightControl(), waits=True)
    )
    trim = session.step()[COLUMN.lever]
    link.input.sticks, link.input.seconds = FLYING._replace(lever=trim + 0.02), 0.0
    session.step()
    link.input.sticks = FLYING._replace(lever=trim - 0.02)
    while not session.finished:
        session.step()
    assert "touched down gently" in session.end_reason
    assert session.completed


def test_wrong_settings_are_refused(tmp_path):
    scenario = load_scenario("manual_flight")
    with pytest.raises(InputError, match="--mavlink-network"):
        mavlink_config(MavlinkOptions(targets=("192.0.2.7:14550",)), scenario)
    with pytest.raises(InputError, match="stick map"):
        mavlink_config(MavlinkOptions(stick_map="nothing"), scenario)
    *_, warning = mavlink_config(MavlinkOptions(targets=("192.0.2.7:14550",), allow_network=True), scenario)
    assert "anyone" in warning


@pytest.mark.parametrize(("start", "nacelle"), [("hover", 90.0), ("conversion", 75.0), ("cruise", 0.0)])
def test_the_hand_flight_starts_where_it_is_asked_to(start, nacelle):
    scenario = with_overrides(load_scenario("manual_flight"), Overrides(pilot="mavlink", start=start))
    assert to_deg(scenario.start.nacelle_angle) == pytest.approx(nacelle)
    assert scenario.programme.duration == 0.0


def test_a_frozen_flight_is_thawed_by_the_same_button(flight):
    """The executive asks for requests while it stands still."""
    flight.session._frames = 60
    fly_from = flight.session.step
    looked = []

    def step():
        if flight.simulation.frame_index == 20:
            flight.link.input.asked = [Request("freeze")]
        return fly_from()

    def asked_while_frozen():
        looked.append(flight.control.paused)
        if len(looked) == 5:
            flight.link.input.asked = [Request("freeze")]
        hear()

    flight.session.step = step
    hear, flight.control.poll = flight.control.poll, asked_while_frozen
    report = Executive(flight.session, FlightSinks(), control=flight.control).fly()
    assert report.frames == 60
    assert len(looked) >= 5
    assert report.paused_s >= 0.02
    assert not flight.control.paused
