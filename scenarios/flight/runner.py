"""Flies scenarios: composes simulation, pilot, log and view, lets the executive pace them, and measures the result."""

from __future__ import annotations

import dataclasses
import functools
import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from rtsim.arguments import instance
from rtsim.arrays import FloatArray
from rtsim.errors import InputError, OutputError
from rtsim.frame import history_sha256
from rtsim.jsonable import to_jsonable
from rtsim.loop import beside
from rtsim.loop.simulation import Simulation
from rtsim.measures.metrics import flight_metrics
from rtsim.realtime.control import FlightControl, checked_speed
from rtsim.realtime.executive import Executive
from rtsim.realtime.policy import OverrunPolicy
from rtsim.realtime.report import TimingReport
from rtsim.versions import versions
from scenarios.files.loader import load_scenario
from scenarios.files.nacelle_laws import load_nacelle_law
from scenarios.files.options import Overrides, with_overrides
from scenarios.files.scenario import Scenario
from scenarios.flight.flight_setup import corridor_outline, flight_frames, flight_setup, replay_setup
from scenarios.flight.hands import Hands
from scenarios.flight.limit_watch import LimitWatch
from scenarios.flight.mavlink_options import MavlinkOptions, flown_by_hand, mavlink_config, refuse_unpaced
from scenarios.flight.pilots import load_pilot
from scenarios.flight.preflight import preflight_problems
from scenarios.flight.result import FlightRecord, judge
from scenarios.flight.session import FlightSession
from scenarios.flight.sinks import FlightSinks
from telemetry.log.format import FlightMetadata, LogEvent
from telemetry.log.place import check_log
from telemetry.view.recording import check_recording

if TYPE_CHECKING:
    from telemetry.flightgear.config import WindowConfig
    from telemetry.flightgear.link import FlightGearLink
    from telemetry.log.recorder import Recorder
    from telemetry.mavlink.link import MavlinkLink
    from telemetry.view.options import ViewOptions
    from telemetry.view.view import RerunView

beside.also("rtsim.measures.metrics:compile_measures")
TOLD_TO_STATIONS = frozenset(
    {
        "pilot",
        "aid",
        "flaps",
        "throttle",
        "rotor_speed",
        "refused",
        "advice",
        "end",
        "freeze",
        "thaw",
        "fuel",
        "wheels",
        "interlock",
    }
)
"""Events that ground stations are told of as text."""
VIEW_PATIENCE_S = 1.5
"""How long the first frame waits for a view that is starting [s]; the flight begins without it after that."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightOutputs:
    """What a flight leaves behind or shows besides its record."""

    log: Path | None = None
    """Flight log to write, a directory (``PATH.parquet``)."""
    overwrite: bool = False
    """Replace an earlier log at that path."""
    view: ViewOptions | None = None
    """Rerun view and recording; None shows nothing."""
    mavlink: MavlinkOptions | None = None
    """Ground stations; None talks no MAVLink, unless the pilot is behind it."""
    flightgear: WindowConfig | None = None
    """FlightGear as a window; None shows nothing there. Needs a paced flight."""
    on_message: Callable[[str], None] | None = None
    """Told what the view has to say, one sentence at a time."""
    on_rows: Callable[[FloatArray], None] | None = None
    """Told the last row flown; must be quick."""
    on_event: Callable[[LogEvent], None] | None = None
    """Told every event; must be quick."""
    on_start: Callable[[], None] | None = None
    """Called when everything is warm, just before the first frame."""


def fly(
    scenario: str | Path | Scenario = "typical_conversion",
    *,
    speed: float | Literal["max"] = 1.0,
    overrides: Overrides | None = None,
    control: FlightControl | None = None,
    overrun_policy: str | None = None,
    outputs: FlightOutputs | None = None,
) -> FlightRecord:
    """Fly a scenario to its end.

    Args:
        scenario: A library name, a path, or a scenario already loaded.
        speed: Multiple of real time, or ``max``.
        overrides: What to change of the scenario.
        control: The hand on the flight (pause, step, warp, reset, pilot, stop), usable from another thread.
        overrun_policy: ``catch-up``, ``drop`` or ``stop:N``; None drops a backlog where hands can reach the flight by
            MAVLink, and else catches up.
        outputs: Log, view and callbacks.

    Returns:
        The flight; ``failure`` tells whether a log or recording broke on the way.

    Raises:
        InputError: If something that was asked for does not exist or cannot be flown.
        OutputError: If a log or recording cannot be started.
    """
    if outputs is not None:
        instance(outputs, FlightOutputs, "outputs", "give FlightOutputs(log=...)")
    outputs = outputs if outputs is not None else FlightOutputs()
    _refuse_outputs(outputs)
    scenario = _chosen(scenario, overrides)
    if speed != "max":
        checked_speed(speed)
    policy = OverrunPolicy.parse(overrun_policy or "catch-up")
    pilot_factory = load_pilot(scenario.options.pilot)
    nacelle_law = load_nacelle_law(scenario.options.nacelle)
    live = speed != "max"
    control = control if control is not None else FlightControl()
    link: MavlinkLink | None = None
    window: FlightGearLink | None = None
    log: Recorder | None = None
    # The view needs a second to start, in its own process, while this one loads the aircraft.
    view = _start_view(scenario, outputs)
    try:
        link = _start_mavlink(scenario, outputs, live=live)
        window = _start_window(outputs, live=live)
        simulation = Simulation(flight_setup(scenario))
        waits = flown_by_hand(scenario.options.pilot)
        hands = Hands(link, simulation, control=control, waits=waits) if link is not None else None
        session = FlightSession(
            simulation,
            frames=flight_frames(scenario),
            events=scenario.events,
            pilot_factory=pilot_factory,
            pilot_name=scenario.options.pilot,
            hands=hands,
            nacelle_law=nacelle_law,
        )
        log = _start_log(scenario, simulation, outputs, live=live)
        sinks = FlightSinks(
            log=log,
            view=view,
            paced=live,
            mirrors=[mirror for mirror in (link, window) if mirror is not None],
            watch_corridor=scenario.options.protection != "off",
            limits=_limit_watch(scenario, simulation.dt),
            on_rows=outputs.on_rows,
            on_event=_event_listener(outputs, link),
        )
        session.on_event = sinks.event
        simulation.warm_up()
        if simulation.laws is not None:
            simulation.laws.live, simulation.laws.on_event = live, session.law_event
        if view is not None and live:
            view.wait_ready(VIEW_PATIENCE_S)
        if link is not None:
            link.wait_ready()
            _tell_where(link, outputs)
        executive = Executive(
            session,
            sinks,
            control=control,
            speed=math.inf if speed == "max" else speed,
            policy=OverrunPolicy(drops=True) if hands is not None and overrun_policy is None else policy,
        )
        if outputs.on_start is not None:
            outputs.on_start()
        timing = executive.fly()
        if link is not None:
            link.rest()
        record = _measure(scenario, session, sinks, timing, simulation.database_hash)
        if hands is not None:
            record = dataclasses.replace(record, mavlink=hands.summary())
    except BaseException:
        _close_links(link, window)
        _close(log, view, None, outputs.on_message)
        raise
    link_failure = _close_links(link, window)
    return dataclasses.replace(record, failure=_close(log, view, record, outputs.on_message) or link_failure)


def _refuse_outputs(outputs: FlightOutputs) -> None:
    """Refuse what could not be written, before anything is started."""
    if outputs.log is not None:
        check_log(outputs.log, overwrite=outputs.overwrite)
    if outputs.view is not None and outputs.view.record is not None:
        record, log = Path(os.path.realpath(outputs.view.record)), outputs.log
        if log is not None and record.is_relative_to(Path(os.path.realpath(log))):
            raise InputError("lies in the log", key="--record", value=str(outputs.view.record), mend="put it beside it")
        check_recording(record)


def _chosen(scenario: str | Path | Scenario, overrides: Overrides | None) -> Scenario:
    """The scenario with what was changed of it; all that it names is there."""
    if not isinstance(scenario, Scenario):
        scenario = load_scenario(scenario)
    if overrides is not None:
        instance(overrides, Overrides, "overrides", "give Overrides(duration=...)")
        scenario = with_overrides(scenario, overrides)
    for problem in preflight_problems(scenario):
        raise problem
    return scenario


def _start_view(scenario: Scenario, outputs: FlightOutputs) -> RerunView | None:
    if outputs.view is None:
        return None
    from telemetry.view.view import RerunView

    options = outputs.view
    if options.record is not None:  # a link stays, and what it names is written
        options = dataclasses.replace(options, record=Path(os.path.realpath(options.record)))
    return RerunView(
        options,
        corridor=corridor_outline(scenario.options.corridor_name, scenario.options.aircraft),
        title=scenario.name,
        rate_hz=scenario.options.rate_hz,
        on_message=outputs.on_message,
    )


def _start_mavlink(scenario: Scenario, outputs: FlightOutputs, *, live: bool) -> MavlinkLink | None:
    """Put the aircraft on the air, in a process that gets ready while this one loads it."""
    if outputs.mavlink is None and not flown_by_hand(scenario.options.pilot):
        return None
    refuse_unpaced(scenario, paced=live)
    from telemetry.mavlink.link import MavlinkLink

    config, warning = mavlink_config(outputs.mavlink or MavlinkOptions(), scenario)
    if warning is not None and outputs.on_message is not None:
        outputs.on_message(warning)
    return MavlinkLink(config)


def _tell_where(link: MavlinkLink, outputs: FlightOutputs) -> None:
    if outputs.on_message is not None:
        targets = ", ".join(str(target) for target in link.config.targets)
        outputs.on_message(f"MAVLink: sends to {targets}, receives on {link.config.bind_host}:{link.port}.")


def _event_listener(outputs: FlightOutputs, link: MavlinkLink | None) -> Callable[[LogEvent], None] | None:
    """Who hears of events: the caller, and the ground stations of what they cannot see in the rows."""
    heard = outputs.on_event
    if link is None:
        return heard

    def tell(event: LogEvent) -> None:
        if event.kind in TOLD_TO_STATIONS:
            link.say(event.text, severity=4 if event.level == "warning" else 6)
        if heard is not None:
            heard(event)

    return tell


def _close_links(link: MavlinkLink | None, window: FlightGearLink | None) -> OutputError | None:
    """Close what was sent to whatever happened; gives why MAVLink broke, where it did."""
    if window is not None:
        window.close()
    if link is None:
        return None
    link.close()
    return link.failure


def _start_window(outputs: FlightOutputs, *, live: bool) -> FlightGearLink | None:
    """Start the process that sends to FlightGear."""
    config = outputs.flightgear
    if config is None:
        return None
    from scenarios.flight.window_options import refuse_unpaced_window
    from telemetry.flightgear.link import FlightGearLink

    refuse_unpaced_window(paced=live)
    if outputs.on_message is not None:
        outputs.on_message(f"FlightGear: sends to {config.target}.")
    return FlightGearLink(config, on_message=outputs.on_message)


def _start_log(scenario: Scenario, simulation: Simulation, outputs: FlightOutputs, *, live: bool) -> Recorder | None:
    if outputs.log is None:
        return None
    from telemetry.log.recorder import Recorder

    metadata = FlightMetadata(
        scenario_name=scenario.name,
        scenario_toml=scenario.source,
        database_hash=simulation.database_hash,
        seed=scenario.options.seed,
        rate_hz=float(scenario.options.rate_hz),
        versions=versions(),
        setup=replay_setup(scenario),
        corridor=corridor_outline(scenario.options.corridor_name, scenario.options.aircraft),
    )
    return Recorder(outputs.log, metadata, live=live, overwrite=outputs.overwrite)


def _measure(
    scenario: Scenario, session: FlightSession, sinks: FlightSinks, timing: TimingReport, database_hash: str
) -> FlightRecord:
    rows = sinks.history.rows()
    metrics = flight_metrics(rows, scenario.programme, session.dt) if len(rows) else None
    completed = session.completed and timing.ending == "finished"
    watched = sinks.watched()
    last = int(rows[-1, 0]) + 1 if len(rows) else 0
    sinks.event(LogEvent(last, last * session.dt, "end", timing.end_reason, "info" if completed else "warning"))
    return FlightRecord(
        scenario=scenario,
        rows=rows,
        metrics=metrics,
        timing=timing,
        events=tuple(sinks.events),
        completed=completed,
        end_reason=timing.end_reason,
        history_sha256=history_sha256([rows]),
        # A flight that was stopped by hand has not failed what it was never flown to.
        verdicts=()
        if timing.ending == "stopped"
        else judge(scenario, metrics, rows, completed=completed, end_reason=timing.end_reason),
        database_hash=database_hash,
        watched=watched,
    )


def _limit_watch(scenario: Scenario, dt: float) -> Callable[[Callable[[LogEvent], None]], LimitWatch] | None:
    """What watches the flight's limits; nothing with the protection off."""
    if scenario.options.protection == "off":
        return None
    return functools.partial(LimitWatch, scenario.options.corridor_name, dt=dt, aircraft=scenario.options.aircraft)


def _close(
    log: Recorder | None,
    view: RerunView | None,
    record: FlightRecord | None,
    on_message: Callable[[str], None] | None,
) -> OutputError | None:
    """Close log and view whatever happened; the first that failed is reported."""
    failure: OutputError | None = None
    if log is not None:
        try:
            log.close(_log_summary(record) if record is not None else None)
        except OutputError as error:
            failure = error
        if on_message is not None:
            for note in log.notes:  # what became of its writer after the last frame
                on_message(f"{note[:1].upper()}{note[1:]}.")
    if view is not None:
        view.close()
        failure = failure or view.failure
    return failure


def _log_summary(record: FlightRecord) -> dict[str, Any]:
    """The end of a log: the record's summary with its wall clock."""
    return {**to_jsonable(record.summary()), "ended_unix_s": time.time()}
