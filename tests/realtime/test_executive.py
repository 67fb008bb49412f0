"""The loop's logic: no frame skipped or doubled, overruns counted, requests served; wall time only where it must be."""

from __future__ import annotations

import gc
import math
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from rtsim.errors import InputError
from rtsim.frame import TIMING_SIGNALS
from rtsim.realtime.control import WARP_STEPS, FlightControl, neighbouring_warp
from rtsim.realtime.executive import Executive, loop_conditions
from rtsim.realtime.policy import OverrunPolicy


def wait_for(condition: Callable[[], bool]) -> None:
    """Wait until something is so, at most ten seconds."""
    end = time.monotonic() + 10.0
    while not condition() and time.monotonic() < end:
        time.sleep(0.002)


TIMING = {signal.name: number for number, signal in enumerate(TIMING_SIGNALS)}


@pytest.mark.parametrize("speed", [1.0, 20.0, math.inf])
def test_every_frame_is_flown_once_at_any_speed(make_source: Any, sink: Any, speed: float) -> None:
    report = Executive(make_source(300), sink, speed=speed).fly()
    assert sink.frames == list(range(300))
    assert (report.frames, report.ending, report.end_reason) == (300, "finished", "all frames flown")
    assert report.duration_s == pytest.approx(1.2)
    assert len(sink.viewed) == (0 if speed == math.inf else 300)


def test_an_unpaced_flight_measures_no_pacing(make_source: Any, sink: Any) -> None:
    report = Executive(make_source(600), sink, speed=math.inf).fly()
    assert (report.lateness_us, report.work_us, report.work_cpu_us, report.drift_frames) == (None,) * 4
    assert report.overruns == 0
    assert sink.blocks == [250, 250, 100]
    assert report.real_time_factor > 1.0


def test_a_paced_flight_takes_its_time(make_source: Any, sink: Any) -> None:
    report = Executive(make_source(100), sink).fly()
    assert report.wall_s >= 0.4 - 1e-4
    assert report.lateness_us is not None
    assert len(sink.timings) == 100
    assert all(timing[TIMING["lateness_us"]] >= 0.0 for timing in sink.timings)
    assert all(timing[TIMING["work_us"]] > 0.0 for timing in sink.timings)


def test_a_stall_is_an_overrun_and_is_caught_up(make_source: Any, sink: Any) -> None:
    source = make_source(120, at={20: lambda: time.sleep(0.05)})
    report = Executive(source, sink).fly()
    assert sink.frames == list(range(120))
    assert 20 in report.overrun_frames
    assert report.overruns >= 12  # a stall of 12.5 frames is late for twelve deadlines
    assert report.drift_frames is not None
    counts = [int(timing[TIMING["overruns"]]) for timing in sink.timings]
    assert counts == sorted(counts)
    assert counts[20] < counts[21]


def test_a_dropped_backlog_costs_no_frame_and_is_not_flown_faster(make_source: Any, sink: Any) -> None:
    control = FlightControl()
    behind: list[float] = []
    acts = {20: lambda: time.sleep(0.5), 22: lambda: behind.append(control.behind_s)}
    report = Executive(make_source(60, at=acts), sink, control=control, policy=OverrunPolicy.parse("drop")).fly()
    assert sink.frames == list(range(60))
    assert behind[0] < 0.25  # caught up, frame 22 would begin 0.49 s late
    assert report.drift_frames is not None
    assert report.drift_frames > 100.0  # what was dropped is booked


def test_another_speed_does_not_fly_a_long_backlog_off(make_source: Any, sink: Any) -> None:
    control = FlightControl()
    behind: list[float] = []
    acts = {20: lambda: (time.sleep(0.5), control.slower()), 23: lambda: behind.append(control.behind_s)}
    Executive(make_source(60, at=acts), sink, control=control, speed=5.0).fly()
    assert sink.frames == list(range(60))
    assert behind[0] < 0.25


def test_the_stop_policy_ends_the_flight_at_the_nth_overrun(make_source: Any, sink: Any) -> None:
    source = make_source(1000, work_s=0.006)
    report = Executive(source, sink, policy=OverrunPolicy.parse("stop:5")).fly()
    assert report.ending == "overruns"
    assert report.overruns == 5
    assert report.frames < 20
    assert "stop:5" in report.end_reason
    assert sink.frames == list(range(report.frames))


def test_pause_costs_no_drift_and_no_frame(make_source: Any, sink: Any) -> None:
    control = FlightControl()

    def pause_for_a_second() -> None:
        control.pause()
        threading.Timer(1.0, control.resume).start()

    report = Executive(make_source(60, at={30: pause_for_a_second}), sink, control=control).fly()
    assert sink.frames == list(range(60))
    assert report.paused_s > 0.9
    assert report.drift_frames is not None
    assert report.drift_frames < 100.0  # counted as lateness, the pause would be 250 frames
    assert report.real_time_factor > 0.5  # counted as flying, it would leave 0.2


def test_single_steps_while_paused(make_source: Any, sink: Any) -> None:
    control = FlightControl()
    flown: list[int] = []

    def look_and(act: Callable[[], object]) -> None:
        wait_for(lambda: control.paused and not control.requests)
        time.sleep(0.05)
        flown.append(len(sink.rows))
        act()

    def script() -> None:
        look_and(control.step)
        wait_for(lambda: len(sink.rows) == 1)
        look_and(lambda: control.step(10))
        wait_for(lambda: len(sink.rows) == 11)
        look_and(lambda: control.stop("done looking"))

    control.pause()
    thread = threading.Thread(target=script)
    thread.start()
    report = Executive(make_source(1000), sink, control=control).fly()
    thread.join()
    assert flown == [0, 1, 11]
    assert (report.ending, report.end_reason, report.frames) == ("stopped", "done looking", 11)


def test_steps_also_pause_an_unpaced_flight(make_source: Any, sink: Any) -> None:
    control = FlightControl()
    control.step(40)
    source = make_source(1000, at={39: threading.Timer(0.2, control.stop).start})
    report = Executive(source, sink, control=control, speed=math.inf).fly()
    assert report.frames == 40
    assert report.paused_s > 0.1


def test_warp_changes_while_flying(make_source: Any, sink: Any) -> None:
    control = FlightControl()
    source = make_source(500, at={50: lambda: control.set_speed(10.0), 300: lambda: control.set_speed(math.inf)})
    report = Executive(source, sink, control=control).fly()
    assert sink.frames == list(range(500))
    assert 0.29 < report.wall_s < 1.9  # 50 frames of 4 ms, 250 of 0.4 ms, 200 at once; 2 s without warp
    assert control.speed == math.inf


def test_from_unpaced_back_to_real_time(make_source: Any, sink: Any) -> None:
    control = FlightControl()
    source = make_source(350, at={249: lambda: control.set_speed(1.0)})
    report = Executive(source, sink, control=control, speed=math.inf).fly()
    assert sink.frames == list(range(350))
    assert report.wall_s >= 0.39
    assert len(sink.timings) == 100


def test_reset_and_pilot_reach_the_source_without_runaway(make_source: Any, sink: Any) -> None:
    control = FlightControl()
    source = make_source(40, at={30: lambda: (control.reset(), control.set_pilot("hold"))})
    report = Executive(source, sink, control=control).fly()
    assert sink.frames == [*range(31), *range(40)]
    assert (source.resets, source.pilots) == (1, ["hold"])
    assert report.frames == 71
    assert report.wall_s >= 71 * 0.004 - 0.006  # the frames after the reset are paced like the others


def test_stop_ends_a_paused_flight(make_source: Any, sink: Any) -> None:
    control = FlightControl()
    control.pause()
    control.stop("enough")
    report = Executive(make_source(10), sink, control=control).fly()
    assert (report.frames, report.ending, report.end_reason) == (0, "stopped", "enough")
    assert report.lateness_us is None


def test_the_collector_is_off_inside_and_restored_after(make_source: Any, sink: Any) -> None:
    seen: list[bool] = []
    interval = sys.getswitchinterval()
    Executive(make_source(3, at={1: lambda: seen.append(gc.isenabled())}), sink).fly()
    assert seen == [False]
    assert gc.isenabled()
    assert sys.getswitchinterval() == pytest.approx(interval)
    with pytest.raises(RuntimeError, match="boom"), loop_conditions():
        raise RuntimeError("boom")
    assert gc.isenabled()


@pytest.mark.parametrize("text", ["", "stop", "stop:0", "stop:-1", "stop:x", "catchup", "stop:9999999999"])
def test_other_policies_are_refused(text: str) -> None:
    with pytest.raises(InputError, match="catch-up, drop, or stop:N"):
        OverrunPolicy.parse(text)


def test_policies_read_back() -> None:
    for text in ("catch-up", "drop", "stop:1", "stop:250"):
        assert str(OverrunPolicy.parse(text)) == text


@pytest.mark.parametrize("speed", [0.0, -1.0, 1001.0, math.nan])
def test_impossible_speeds_are_refused(speed: float) -> None:
    with pytest.raises(InputError, match=r"0\.001 to 1000 times real time"):
        FlightControl().set_speed(speed)
    with pytest.raises(InputError, match="at least 1"):
        FlightControl().step(0)


def test_warp_steps_walk_up_and_down() -> None:
    assert neighbouring_warp(1.0, upwards=True) == 2.0
    assert neighbouring_warp(1.0, upwards=False) == 0.5
    assert neighbouring_warp(3.0, upwards=True) == 5.0
    assert neighbouring_warp(math.inf, upwards=False) == WARP_STEPS[-1]
    assert neighbouring_warp(WARP_STEPS[-1], upwards=True) == WARP_STEPS[-1]
    assert neighbouring_warp(WARP_STEPS[0], upwards=False) == WARP_STEPS[0]
