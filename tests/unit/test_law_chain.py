"""Laws written in Python in a chain: order, holding, and everything that may go wrong in somebody else's code."""

from __future__ import annotations

import itertools
import math
import signal
import sys
import threading
import time
import types

import pytest

from rtsim.command import Command, Intervention, Margins, Sensors
from rtsim.errors import InputError
from rtsim.protection import chain as module
from rtsim.protection import guard
from rtsim.protection.chain import LawChain
from rtsim.protection.guard import CallLimit, guarded_call
from rtsim.protection.laws import load_laws
from rtsim.protection.limits import LIMIT_KINDS
from rtsim.units import INCH_POUND, deg, kt

DT = 0.004
MARGINS = Margins(10.0, 10.0, 0.5, 0.5)
PILOT = Command(0.2, 0.5, -0.1)
LAWS = """
import sys, time
from rtsim.command import Command, Intervention

class Slower:
    def step(self, sensors, command, margins, dt):
        limited = Command(command.stick, command.lever, 0.5 * command.nacelle_rate)
        return limited, [
            Intervention("nacelle_rate", "nacelle_rate", "limit", command.nacelle_rate, limited.nacelle_rate, 0.0, 1.0)
        ]

class Softer:
    def step(self, sensors, command, margins, dt):
        return Command(min(command.stick, 0.1), command.lever, command.nacelle_rate), [
            Intervention("own limit", "stick", "clip", command.stick, 0.1, 0.0, 1.0)
        ]

class Adds:
    def step(self, sensors, command, margins, dt):
        return Command(command.stick, command.lever, command.nacelle_rate + 0.01), []

class Counts:
    def __init__(self):
        self.calls = 0
    def step(self, sensors, command, margins, dt):
        self.calls += 1
        return Command(command.stick + 0.001 * self.calls, command.lever, command.nacelle_rate), []

class Raises:
    def step(self, sensors, command, margins, dt):
        if sensors.time > 0.05:
            raise ZeroDivisionError("division by margin")
        return command, []

class Exits:
    def step(self, sensors, command, margins, dt):
        sys.exit(3)

class TooMuch:
    def step(self, sensors, command, margins, dt):
        return Command(50.0, -3.0, command.nacelle_rate), []

class NotANumber:
    def step(self, sensors, command, margins, dt):
        return Command(float("nan"), command.lever, command.nacelle_rate), []

class Forgets:
    def step(self, sensors, command, margins, dt):
        return command

class Mixes:
    def step(self, sensors, command, margins, dt):
        return command, ["limited"]

class Sleeps:
    def step(self, sensors, command, margins, dt):
        if sensors.time > 0.05:
            time.sleep(30.0)
        return command, []

class Clings:
    def step(self, sensors, command, margins, dt):
        deadline = time.monotonic() + 30.0
        while time.monotonic() < deadline:
            try:
                time.sleep(30.0)
            except Exception:
                pass
        return command, []

class Lags:
    def step(self, sensors, command, margins, dt):
        time.sleep(0.05)
        return Command(0.0, command.lever, command.nacelle_rate), []

CALLS = 0

class Remembers:
    def step(self, sensors, command, margins, dt):
        global CALLS
        CALLS += 1
        return Command(command.stick + (0.01 if CALLS > 7 else 0.0), command.lever, command.nacelle_rate), []

class Locks:
    def __init__(self):
        import threading
        self.lock = threading.Lock()
    def step(self, sensors, command, margins, dt):
        return command, []
"""


@pytest.fixture(autouse=True)
def chained_laws(tmp_path, monkeypatch):
    (tmp_path / "chained_laws.py").write_text(LAWS)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "chained_laws", raising=False)
    yield
    sys.modules.pop("chained_laws", None)


def sensors(time=0.0):
    return Sensors(
        time=time, airspeed=kt(105.0), airspeed_rate=0.0, nacelle_angle=deg(50.0), nacelle_rate=0.0, pitch=0.0,
        pitch_rate=0.0, flight_path_angle=0.0, altitude=100.0, climb_rate=0.0, load_factor=1.0,
        mast_torque=60000.0 * INCH_POUND, flapping=deg(2.0), on_downstop=False, nacelle_ok=True,
    )  # fmt: skip


def chain(*names, **options):
    return LawChain(load_laws([f"chained_laws:{name}" for name in names]), dt=DT, **options)


def acting(laws, command):
    """The command as the compiled frame lets it act: held where the laws hold it."""
    return Command(*(own if math.isnan(held) else held for own, held in zip(command.values, laws.held, strict=False)))


def fly(laws, frames=50, command=PILOT, before=None):
    applied = []
    for frame in range(frames):
        if before is not None:
            before(laws, frame)
        if laws.due(frame):
            laws.decide(frame, sensors(frame * DT), command, MARGINS)
        applied.append(acting(laws, command))
    return applied


def test_laws_act_in_their_order_and_the_last_has_the_last_word():
    assert fly(chain("Slower", "Adds"))[-1].nacelle_rate == pytest.approx(-0.04)
    assert fly(chain("Adds", "Slower"))[-1].nacelle_rate == pytest.approx(-0.045)


def test_record_says_which_law_changed_what():
    laws = chain("Slower", "Softer")
    fly(laws, 1)
    assert [(item.law, item.intervention.channel) for item in laws.interventions] == [
        ("chained_laws:Slower", "nacelle_rate"),
        ("chained_laws:Softer", "stick"),
    ]
    own, none, rate, *lateral = laws.reasons
    assert (own, none, rate) == (module.OTHER_REASON, 0.0, 1.0 + LIMIT_KINDS.index("nacelle_rate"))
    assert lateral == [0.0, 0.0]


def test_laws_are_asked_fifty_times_a_second_and_held_between():
    """A channel the laws leave alone follows the pilot in every frame; a limited one keeps its value."""
    laws = chain("Softer")
    assert [frame for frame in range(12) if laws.due(frame)] == [0, 5, 10]
    laws.decide(0, sensors(), PILOT, MARGINS)
    moved = Command(0.9, 0.7, 0.05)
    assert acting(laws, moved) == Command(0.1, 0.7, 0.05)
    laws.decide(5, sensors(), Command(0.05, 0.5, 0.0), MARGINS)
    assert acting(laws, moved) == moved


@pytest.mark.parametrize(
    ("name", "kind", "frame", "said"),
    [
        ("Raises", "raised", 15, "raised ZeroDivisionError: division by margin"),
        ("Exits", "raised", 0, "raised SystemExit: 3"),
        ("NotANumber", "not_finite", 0, "not finite"),
        ("Forgets", "wrong_answer", 0, "where \\(Command, list of Intervention\\) is asked for"),
        ("Mixes", "wrong_answer", 0, "list of interventions that holds something else"),
    ],
)
def test_a_law_that_fails_is_named_and_the_flight_goes_on(name, kind, frame, said):
    told = []
    laws = chain("Slower", name, on_event=told.append)
    applied = fly(laws)
    assert [(event.law, event.kind, event.frame, event.ended) for event in told] == [
        (f"chained_laws:{name}", kind, frame, True)
    ]
    assert told == laws.events
    with pytest.raises(AssertionError, match=said):
        raise AssertionError(told[0].text)
    # The law before it goes on working, the pilot's other channels pass.
    assert applied[-1] == Command(0.2, 0.5, -0.05)


@pytest.mark.parametrize("name", ["Sleeps", "Clings"])
def test_a_call_without_end_is_ended(name, monkeypatch):
    monkeypatch.setattr(module, "BATCH_LIMIT", 0.1)
    monkeypatch.setattr(guard, "HANGS", 0.3)
    laws = chain(name)
    began = time.monotonic()
    applied = fly(laws)
    assert time.monotonic() - began < 5.0
    assert [(event.kind, event.ended) for event in laws.events] == [("interrupted", True)]
    assert "used more than 0.1 s of CPU time, or hung, in one call" in laws.events[0].text
    assert applied[-1] == PILOT


def test_the_time_budget_of_a_batch_is_one_second():
    assert module.BATCH_LIMIT == 1.0


def test_a_slow_law_is_never_skipped_in_a_batch():
    laws = chain("Lags")
    assert all(command.stick == 0.0 for command in fly(laws, 16))
    assert laws.events == []


def test_live_the_calls_a_slow_law_missed_are_skipped_and_recorded(monkeypatch):
    """50 ms in a period of 20 ms: the next two calls are skipped; the pilot flies meanwhile."""
    # On a busy machine a sleep of 50 ms takes longer: the clock that the guard reads is ours.
    readings = itertools.count()
    clock = types.SimpleNamespace(
        monotonic=time.monotonic, thread_time=time.thread_time, perf_counter=lambda: 0.05 * next(readings)
    )
    monkeypatch.setattr(guard, "time", clock)
    laws = chain("Lags", live=True)
    applied = fly(laws, 16)
    assert [(event.kind, event.frame, event.ended) for event in laws.events] == [
        ("skipped", 5, False),
        ("skipped", 10, False),
    ]
    assert [command.stick for command in applied] == [0.0] * 5 + [0.2] * 10 + [0.0]


def test_a_replay_skips_and_ends_what_was_skipped_and_ended():
    live = chain("Lags", live=True)
    expected = fly(live, 16)
    skipped = [event.frame for event in live.events if event.kind == "skipped"]
    assert (
        fly(chain("Lags"), 16, before=lambda laws, frame: frame in skipped and laws.skip("chained_laws:Lags"))
        == expected
    )
    ended = fly(chain("Slower"), 15, before=lambda laws, frame: frame == 10 and laws.end("chained_laws:Slower"))
    assert [command.nacelle_rate for command in ended] == [-0.05] * 10 + [-0.1] * 5


def test_what_no_control_can_do_is_clipped_and_the_law_named_once():
    laws = chain("TooMuch")
    assert all(command == Command(1.0, 0.0, PILOT.nacelle_rate) for command in fly(laws, 16))
    assert [(event.kind, event.frame, event.ended) for event in laws.events] == [("out_of_range", 0, False)]
    assert "asks for stick 50 and lever -3" in laws.events[0].text


def test_a_law_that_keeps_global_state_is_named():
    laws = chain("Remembers", "Counts", remember=True)
    fly(laws)
    found = laws.unrepeatable()
    assert [(event.law, event.kind) for event in found] == [("chained_laws:Remembers", "global_state")]
    assert "outside its instance" in found[0].text
    assert found[0] in laws.events


def test_every_flight_begins_with_fresh_laws():
    laws = chain("Counts")
    first = fly(laws)
    laws.reset()
    assert fly(laws) == first


def test_snapshot_and_restore_carry_the_laws_state():
    laws = chain("Counts", "Softer", remember=True)
    fly(laws, 23)
    snapshot = laws.snapshot()
    first = fly(laws, 30)
    laws.restore(snapshot)
    assert fly(laws, 30) == first
    assert laws.unrepeatable() == []


def test_a_law_that_cannot_be_copied_is_named():
    with pytest.raises(InputError, match="chained_laws:Locks"):
        chain("Locks").snapshot()


def test_somebody_elses_alarm_survives():
    rung = []
    previous = signal.signal(signal.SIGALRM, lambda *_: rung.append(True))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        with CallLimit(5.0, live=False):
            time.sleep(0.01)
        assert 0.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 0.2
        time.sleep(0.3)
        assert rung == [True]
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)


def test_outside_the_main_thread_a_late_answer_is_judged_when_it_comes():
    class Late:
        def step(self, sensors, command, margins, dt):
            del sensors, margins, dt
            time.sleep(0.1)
            return command, []

    answers = []
    thread = threading.Thread(
        target=lambda: answers.append(guarded_call(Late(), sensors(), PILOT, MARGINS, dt=0.02, limit=0.05, live=True))
    )
    thread.start()
    thread.join(10.0)
    assert answers[0].failure == "interrupted"
    assert answers[0].command is None


def test_a_good_answer_comes_through_the_guard_unchanged():
    item = Intervention("own", "stick", "clip", 0.2, 0.1, 0.0, 1.0)

    class Good:
        def step(self, sensors, command, margins, dt):
            del sensors, margins, dt
            return Command(0.1, command.lever, command.nacelle_rate), [item]

    answer = guarded_call(Good(), sensors(), PILOT, MARGINS, dt=0.02, limit=1.0, live=False)
    assert answer.command == Command(0.1, 0.5, -0.1)
    assert answer.interventions == (item,)
    assert answer.failure is None
