"""The real-time loop: flies frames on absolute deadlines, and knows neither files nor sockets.

The deadline of frame k of a section is ``anchor + k * period``; a late frame never moves the later ones, and no frame
is skipped. A new section, with a new anchor, begins where the schedule changes on purpose: after a pause, at a change
of speed, when pacing is switched on, and where the policy drops a backlog. Time inside the flight is ``frame * dt``
whatever the wall clock does, so a flight that was paused, warped or late has the same history as one that was not.
"""

from __future__ import annotations

import gc
import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.frame import TIMING_SIGNALS
from rtsim.realtime.clock import wait_until
from rtsim.realtime.control import ControlRequest, FlightControl, checked_speed, neighbouring_warp
from rtsim.realtime.policy import BACKLOG_S, OverrunPolicy
from rtsim.realtime.report import Ending, Spread, TimingLog, TimingReport, microseconds
from rtsim.realtime.source import FrameSource

_NAMES = [signal.name for signal in TIMING_SIGNALS]
_LATENESS, _WORK, _WORK_CPU, _OVERRUNS = (
    _NAMES.index(name) for name in ("lateness_us", "work_us", "work_cpu_us", "overruns")
)
BLOCK_S = 1.0
"""Simulated time flown in one piece while the flight is not paced [s]."""
PAUSE_POLL_S = 0.005
"""How often a paused loop looks for requests [s]."""
SWITCH_INTERVAL_S = 0.0005
"""How long another Python thread may keep the interpreter while the loop waits for it [s]; the default is 5 ms."""
LEAD_NS = 2_000_000
"""Time between the start of the loop and its first deadline [ns]."""


class FrameSink(Protocol):
    """Where rows go. Nothing here may wait for a viewer; only :meth:`block` may wait for a file."""

    def view(self, row: FloatArray, timing: FloatArray) -> None:
        """Show a row, inside the measured work.

        Args:
            row: The frame, shape (SIGNAL_COUNT,); copy what is kept.
        """
        ...

    def record(self, row: FloatArray, timing: FloatArray) -> None:
        """Keep a row, after the measured work.

        Args:
            row: The frame, shape (SIGNAL_COUNT,); copy what is kept.
            timing: Its timing columns, shape (TIMING_SIGNALS,); copy what is kept.
        """
        ...

    def block(self, rows: FloatArray) -> None:
        """Show and keep rows of a flight that is not paced; may wait, so that nothing is lost."""
        ...


class Executive:
    """Flies a source to its end, paced or as fast as it goes, under a :class:`FlightControl`."""

    def __init__(
        self,
        source: FrameSource,
        sink: FrameSink,
        *,
        control: FlightControl | None = None,
        speed: float = 1.0,
        policy: OverrunPolicy | None = None,
    ) -> None:
        """Prepare the loop; nothing is flown yet.

        Args:
            source: What is flown; its kernels must be warm.
            sink: Where the rows go.
            control: The hand on the flight; None for a flight that nobody touches.
            speed: Multiple of real time; infinity flies as fast as possible.
            policy: What to do about overruns; None catches up.
        """
        self.source, self.sink = source, sink
        self.control = control if control is not None else FlightControl()
        self.policy = policy if policy is not None else OverrunPolicy()
        self.log = TimingLog()
        self.frames = 0
        self._speed = checked_speed(speed)
        self._steps_left = -1  # frames until the next pause; negative: none is due
        self._timing = np.zeros(len(TIMING_SIGNALS))
        self._anchor_ns = 0
        self._period_ns = 0.0
        self._section_frames = 0
        self._slip_frames = 0.0
        self._paused_ns = 0
        self._ending: Ending = "finished"
        self._stop_reason = ""

    def fly(self) -> TimingReport:
        """Fly until the source is finished, the control stops it or the overrun policy does.

        Returns:
            What was measured.
        """
        with loop_conditions(collect=self._speed != math.inf):
            start = time.perf_counter_ns() + (0 if self._speed == math.inf else LEAD_NS)
            self._begin_section(start)
            self.control.speed = self._speed
            while self._serve_requests() and not self.source.finished:
                if self._speed == math.inf:
                    self._fly_block()
                else:
                    self._fly_frame()
            self._end_section()
            end = time.perf_counter_ns()
        return self._report(end - start)

    def _fly_frame(self) -> None:
        """One paced frame: wait, fly, show, measure, keep."""
        deadline = self._deadline(self._section_frames)
        start = wait_until(deadline)
        late_s = self.control.behind_s = (start - deadline) * 1e-9
        if late_s > BACKLOG_S and self.policy.drops:
            self._slip_frames += (start - deadline) / self._period_ns
            self._begin_section(start)
        cpu = time.thread_time_ns()
        row = self.source.step()
        self.sink.view(row, self._timing)
        work_cpu = time.thread_time_ns() - cpu
        work = time.perf_counter_ns() - start
        log, timing = self.log, self._timing
        log.lateness_ns.append(start - deadline)
        log.work_ns.append(work)
        log.work_cpu_ns.append(work_cpu)
        timing[_LATENESS] = (start - deadline) * 1e-3
        timing[_WORK] = work * 1e-3
        timing[_WORK_CPU] = work_cpu * 1e-3
        timing[_OVERRUNS] = len(log.overrun_frames)
        self.sink.record(row, timing)
        self._section_frames += 1
        if time.perf_counter_ns() > self._deadline(self._section_frames):
            log.overrun_frames.append(self.frames)
            limit = self.policy.stop_after
            if limit is not None and len(log.overrun_frames) >= limit:
                self._ending = "overruns"
                self._stop_reason = f"stopped by the overrun policy {self.policy} at frame {self.frames}"
        self._count_frames(1)

    def _fly_block(self) -> None:
        """A piece of an unpaced flight."""
        wanted = max(1, round(BLOCK_S / self.source.dt))
        if self._steps_left > 0:
            wanted = min(wanted, self._steps_left)
        rows = self.source.run(wanted)
        self.sink.block(rows)
        self._count_frames(len(rows))

    def _count_frames(self, flown: int) -> None:
        self.frames += flown
        if self._steps_left > 0:
            self._steps_left -= flown
            if self._steps_left <= 0:
                self._steps_left = -1
                self.control.requests.appendleft(ControlRequest("pause"))

    def _serve_requests(self) -> bool:
        """Do what was asked since the last frame; stand still while paused.

        Returns:
            Whether to go on flying.
        """
        requests = self.control.requests
        if not requests and not self.control.paused:
            return self._ending == "finished"
        pause_start = 0
        while self._ending == "finished":
            while requests and self._ending == "finished":
                self._serve(requests.popleft())
                if not self.control.paused and pause_start:
                    break
            if not self.control.paused:
                break
            if not pause_start:
                self._end_section(wait=False)
                pause_start = time.perf_counter_ns()
            time.sleep(PAUSE_POLL_S)
            if self.control.poll is not None:
                self.control.poll()
        if pause_start:
            now = time.perf_counter_ns()
            self._paused_ns += now - pause_start
            self._begin_section(now)
        return self._ending == "finished"

    def _serve(self, request: ControlRequest) -> None:
        action, control = request.action, self.control
        if action == "toggle-pause":
            action = "resume" if control.paused else "pause"
        if action == "pause":
            control.paused, self._steps_left = True, -1
        elif action == "resume":
            control.paused, self._steps_left = False, -1
        elif action == "step":
            control.paused, self._steps_left = False, int(request.number)
        elif action == "speed":
            self._change_speed(request.number)
        elif action in {"faster", "slower"}:
            self._change_speed(neighbouring_warp(self._speed, upwards=action == "faster"))
        elif action == "reset":
            self.source.reset()
            self._reschedule()
        elif action == "stop":
            self._ending, self._stop_reason = "stopped", request.text
        else:
            self._pass_on(request)

    def _pass_on(self, request: ControlRequest) -> None:
        """Ask the source for what only it can do."""
        action, source = request.action, self.source
        if action == "pilot":
            source.switch_pilot(request.text)
        elif action == "override":
            source.override_protection()
        elif action == "aid":
            source.switch_aid(request.text, on=request.on)
        elif action == "flaps":
            source.set_flaps(request.number)
        elif action == "step-flaps":
            source.step_flaps(int(request.number))
        elif action == "throttle":
            source.trim_throttle(request.number)
        elif action == "rotor-speed":
            source.set_rotor_speed(request.number)
        elif action == "disturb" and request.change is not None:
            source.disturb(request.change)

    def _change_speed(self, speed: float) -> None:
        """Go on at another speed; a short backlog stays, a long one is that of a speed this machine did not reach."""
        next_deadline = self._deadline(self._section_frames)
        behind_s = (time.perf_counter_ns() - next_deadline) * 1e-9
        if math.inf in {self._speed, speed} or self.control.paused or behind_s > BACKLOG_S:
            self._end_section(wait=False)
            next_deadline = time.perf_counter_ns()
        self._speed = self.control.speed = speed
        self._begin_section(next_deadline)

    def _reschedule(self) -> None:
        """Start the schedule afresh after work that belongs to no frame."""
        self._end_section(wait=False)
        self._begin_section(time.perf_counter_ns())

    def _begin_section(self, anchor_ns: int) -> None:
        self._anchor_ns, self._section_frames = anchor_ns, 0
        self._period_ns = self.source.dt * 1e9 / self._speed

    def _end_section(self, *, wait: bool = True) -> None:
        """Book how far the section ended behind its schedule; at the end of a flight, live its last frame out."""
        if self._speed == math.inf or self._section_frames == 0:
            return
        planned = self._deadline(self._section_frames)
        now = wait_until(planned) if wait else time.perf_counter_ns()
        self._slip_frames += max(0, now - planned) / self._period_ns
        self._section_frames = 0

    def _deadline(self, frame: int) -> int:
        return self._anchor_ns + round(frame * self._period_ns)

    def _report(self, wall_ns: int) -> TimingReport:
        log, dt = self.log, self.source.dt
        paced = len(log.lateness_ns) > 0
        return TimingReport(
            frames=self.frames,
            duration_s=self.frames * dt,
            wall_s=max(wall_ns, 0) * 1e-9,
            paused_s=self._paused_ns * 1e-9,
            overruns=len(log.overrun_frames),
            overrun_frames=tuple(log.overrun_frames),
            lateness_us=Spread.of(microseconds(log.lateness_ns)),
            work_us=Spread.of(microseconds(log.work_ns)),
            work_cpu_us=Spread.of(microseconds(log.work_cpu_ns)),
            drift_frames=self._slip_frames if paced else None,
            ending=self._ending,
            end_reason=self._stop_reason or self.source.end_reason,
        )


@contextmanager
def loop_conditions(*, collect: bool = True) -> Iterator[None]:
    """Keep the interpreter out of the loop's way.

    Garbage is collected once before; what is alive then is frozen and the collector is switched off, since a full
    collection of a program of this size takes longer than a frame. The loop itself makes no reference cycles, so
    nothing piles up. Other threads must give the interpreter back after 0.5 ms. All of it is undone at the end.

    Args:
        collect: Collect before. A flight that is not paced need not: it would wait for it half as long as it flies.
    """
    was_enabled, interval = gc.isenabled(), sys.getswitchinterval()
    if collect:
        gc.collect()
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    try:
        yield
    finally:
        sys.setswitchinterval(interval)
        gc.unfreeze()
        if was_enabled:
            gc.enable()
