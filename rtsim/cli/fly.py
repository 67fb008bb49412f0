"""``rtsim fly``: flies a scenario, live or as fast as the machine allows, and says how it went."""

from __future__ import annotations

import math
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from rtsim.choices import HAND_PILOT
from rtsim.cli import stopping
from rtsim.cli.compile_text import NOTICE
from rtsim.cli.completion import scenario_names
from rtsim.cli.flight_text import describe, say, summarize
from rtsim.cli.options import takes_options
from rtsim.cli.output import emit_json, working
from rtsim.errors import EXIT_EXPECTATION_FAILED, InputError, OverrunStop

if TYPE_CHECKING:
    from rtsim.realtime.control import FlightControl
    from scenarios.files.scenario import Scenario
    from scenarios.flight.result import FlightRecord
    from telemetry.view.options import ViewOptions


Layout = Literal["pilot", "cockpit", "engineer"]
StartName = Literal["hover", "conversion", "cruise"]
Severity = Literal["none", "light", "moderate", "severe"]


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("fly")(fly_command)


@takes_options()
def fly_command(
    scenario: Annotated[
        str | None,
        typer.Argument(
            help="Name of a scenario (typical_conversion, reconversion, hover, manual_flight, ...), or a .toml file.",
            show_default="typical_conversion",
            autocompletion=scenario_names,
        ),
    ] = None,
    *,
    options: dict[str, Any],
    start: Annotated[
        StartName | None,
        typer.Option(
            help="Where to start: 0 kn at 90 deg, 80 kn at 75 deg, or 170 kn at 0 deg.",
            show_default="the programme's first point",
            rich_help_panel="Start",
        ),
    ] = None,
    airspeed_kt: Annotated[
        float | None,
        typer.Option(help="Airspeed at the start [kn].", show_default="the programme's", rich_help_panel="Start"),
    ] = None,
    nacelle_deg: Annotated[
        float | None,
        typer.Option(
            help="Nacelle angle at the start [deg], 90 helicopter.",
            show_default="the programme's",
            rich_help_panel="Start",
        ),
    ] = None,
    altitude_m: Annotated[
        float | None,
        typer.Option(help="Altitude at the start [m].", show_default="the programme's, 100", rich_help_panel="Start"),
    ] = None,
    turbulence: Annotated[
        Severity | None,
        typer.Option(
            help="Dryden turbulence (MIL-F-8785C).", show_default="the scenario's, else none", rich_help_panel="Air"
        ),
    ] = None,
    lateral_turbulence: Annotated[
        bool | None,
        typer.Option(
            "--lateral-turbulence/--no-lateral-turbulence",
            help="Let turbulence blow from the side, in roll and in yaw too.",
            show_default="the scenario's, else off",
            rich_help_panel="Air",
        ),
    ] = None,
    speed: Annotated[
        str, typer.Option(help="Multiple of real time, or max: headless, as fast as it goes.", rich_help_panel="Loop")
    ] = "1",
    duration: Annotated[
        float | None,
        typer.Option(
            help="End after so many seconds [s].",
            show_default="the scenario's; 60 where a start is held",
            rich_help_panel="Loop",
        ),
    ] = None,
    overrun_policy: Annotated[
        str | None,
        typer.Option(
            help="What to do when late: catch-up, drop the backlog, or stop:N to end at the Nth overrun.",
            show_default="catch-up; drop where hands can reach the flight by MAVLink",
            rich_help_panel="Loop",
        ),
    ] = None,
    headless: Annotated[
        bool,
        typer.Option(
            "--headless",
            help="Open no viewer.",
            show_default="a viewer, where there is a display",
            rich_help_panel="Outputs",
        ),
    ] = False,
    record: Annotated[
        Path | None,
        typer.Option(help="Write the Rerun view into FILE.rrd.", show_default="none", rich_help_panel="Outputs"),
    ] = None,
    layout: Annotated[
        Layout,
        typer.Option(
            help="Layout of the viewer: instruments, from behind or from the seat; or plots of every signal.",
            rich_help_panel="Outputs",
        ),
    ] = "pilot",
    log: Annotated[
        Path | None,
        typer.Option(
            help="Write the flight log PATH.parquet (a directory).", show_default="none", rich_help_panel="Outputs"
        ),
    ] = None,
    overwrite: Annotated[
        bool,
        typer.Option(
            "--overwrite",
            help="Replace an earlier log at that path.",
            show_default="it is refused",
            rich_help_panel="Outputs",
        ),
    ] = False,
    json: Annotated[
        bool,
        typer.Option(
            "--json",
            help="Print one JSON object on stdout.",
            show_default="a summary for people",
            rich_help_panel="Outputs",
        ),
    ] = False,
    flightgear: Annotated[
        str | None,
        typer.Option(
            metavar="[HOST:PORT]",
            help="Show the flight in FlightGear; 127.0.0.1:5510 where no address follows.",
            show_default="it is not shown there",
            rich_help_panel="Outputs",
        ),
    ] = None,
    origin: Annotated[
        str | None,
        typer.Option(
            metavar="LAT,LON[,M]",
            help="Where the flight begins on the globe [deg], and the ground's height there [m].",
            show_default="MAVLink: Crows Landing; FlightGear: Keflavik's runway",
            rich_help_panel="Outputs",
        ),
    ] = None,
    mavlink: Annotated[
        list[str] | None,
        typer.Option(
            help="Send MAVLink to HOST:PORT, repeatable.",
            show_default="none; 127.0.0.1:14550 with --pilot mavlink",
            rich_help_panel="MAVLink",
        ),
    ] = None,
    mavlink_bind: Annotated[
        str | None,
        typer.Option(
            help="Receive MAVLink on HOST:PORT.", show_default="a free port of this machine", rich_help_panel="MAVLink"
        ),
    ] = None,
    mavlink_network: Annotated[
        bool,
        typer.Option(
            "--mavlink-network",
            help="Let MAVLink leave this machine. It has no authentication.",
            show_default="it stays here",
            rich_help_panel="MAVLink",
        ),
    ] = False,
    mavlink_key: Annotated[
        Path | None,
        typer.Option(help="Sign MAVLink with the key in FILE.", show_default="unsigned", rich_help_panel="MAVLink"),
    ] = None,
    mavlink_parameters: Annotated[
        Path | None,
        typer.Option(
            help="Where MAVLink parameters are stored.",
            show_default="~/.config/rtsim/mavlink_parameters.toml",
            rich_help_panel="MAVLink",
        ),
    ] = None,
    stick_map: Annotated[
        str | None,
        typer.Option(
            help="Vehicle stick map: a name or a .toml file.",
            show_default="the standard map",
            rich_help_panel="MAVLink",
        ),
    ] = None,
    autopilot: Annotated[
        Literal["px4", "generic"],
        typer.Option(help="How ground stations read the flight modes.", rich_help_panel="MAVLink"),
    ] = "px4",
) -> None:
    """Fly a scenario: the XV-15, the MOCM pilot, the conversion corridor, in real time unless --speed says otherwise.

    While it flies: space pauses, . flies one frame, + and - change the speed, 0 resets, p switches the pilot, o
    overrides the protection, t and h switch rate damping and attitude retention, u and g automatic flaps and the
    rotor-speed governor, v and b move the flaps down and up, q quits.

    Examples:
        rtsim fly  # hover to airplane mode, 66 s, in real time
        rtsim fly conversion_turn --speed max --log turn.parquet  # as fast as it goes, kept in a log
        rtsim fly manual_flight --pilot mavlink --ground  # you fly; in another terminal: rtsim joystick
        rtsim fly ep21_steep_turn --protection full  # too much bank asked for, and the law acts
        rtsim fly --start cruise --duration 30 --turbulence moderate  # a held start in turbulence
        rtsim fly --headless --record flight.rrd --speed max --json  # a recorded view and every number
    """
    from rtsim.realtime.policy import OverrunPolicy
    from rtsim.units import deg, kt
    from scenarios.files.options import Overrides, chosen_scenario
    from scenarios.flight.preflight import preflight_problems
    from telemetry.exchange.globe import HomePosition

    if overrun_policy is not None:
        OverrunPolicy.parse(overrun_policy)
    overrides = Overrides(
        **options,
        turbulence=turbulence,
        lateral_turbulence=lateral_turbulence,
        duration=duration,
        start=start,
        airspeed=None if airspeed_kt is None else kt(airspeed_kt),
        nacelle_angle=None if nacelle_deg is None else deg(nacelle_deg),
        altitude=altitude_m,
    )
    pace = parse_speed(speed)
    chosen = chosen_scenario(scenario, overrides)
    for problem in preflight_problems(chosen):
        raise problem
    home = HomePosition.parse(origin) if origin is not None else None
    window = None
    if flightgear is not None:
        from scenarios.flight.window_options import window_config

        window = window_config(flightgear, home=home, paced=not math.isinf(pace))
    link = None
    if mavlink or mavlink_bind or chosen.options.pilot == HAND_PILOT:
        from scenarios.flight.mavlink_options import MavlinkOptions, mavlink_config, refuse_unpaced

        link = MavlinkOptions(
            targets=tuple(mavlink or ()),
            bind=mavlink_bind,
            allow_network=mavlink_network,
            signing_key=mavlink_key,
            parameter_file=mavlink_parameters,
            stick_map=stick_map,
            autopilot=autopilot,
            home=home or HomePosition(),
        )
        refuse_unpaced(chosen, paced=not math.isinf(pace))
        mavlink_config(link, chosen)  # mistakes are told before anything starts
    if home is not None and link is None and window is None:
        raise InputError("places nothing", key="--origin", value=origin, mend="add --flightgear or --mavlink")
    view = _view_options(headless=headless, record=record, layout=layout)
    flight, first_frame_s, code = _fly(
        chosen,
        speed=pace,
        view=view,
        outputs={"log": log, "overwrite": overwrite, "mavlink": link, "flightgear": window},
        policy=overrun_policy,
    )
    if json:
        places = {"log": log, "record": record}
        given = {key: str(path) for key, path in places.items() if path is not None and path.exists()}
        emit_json({**flight.summary(), "first_frame_s": first_frame_s, **given})
    _end(flight, code)


def _end(flight: FlightRecord, code: int) -> None:
    """End the command as the flight ended."""
    if code:
        if flight.failure is not None:
            say(f"Also: {flight.failure}")
        raise typer.Exit(code)
    if flight.timing.ending == "overruns":
        raise OverrunStop(f"{flight.end_reason}; fly slower, at a lower rate, or with --overrun-policy catch-up.")
    if flight.failure is not None:
        raise flight.failure
    if not flight.held:
        raise typer.Exit(EXIT_EXPECTATION_FAILED)


def parse_speed(text: str) -> float:
    """Read ``--speed``.

    Args:
        text: ``max`` or a number.

    Returns:
        Multiple of real time; infinity for ``max``.

    Raises:
        InputError: If it is neither.
    """
    from rtsim.realtime.control import SPEED_RANGE, checked_speed

    if text == "max":
        return math.inf
    try:
        speed = float(text)
    except ValueError:
        speed = math.nan
    if math.isinf(speed) or math.isnan(speed):
        low, high = SPEED_RANGE
        raise InputError(
            "is not a speed",
            key="--speed",
            value=text,
            allowed=f"{low:g} to {high:g} times real time, or max",
            mend="write for example --speed 2",
        )
    return checked_speed(speed)


def process_age_s() -> float | None:
    """Time since this process was started [s], to 0.01 s; None where the system does not tell."""
    try:
        started_ticks = int(Path("/proc/self/stat").read_text(encoding="ascii").rpartition(")")[2].split()[19])
        uptime_s = float(Path("/proc/uptime").read_text(encoding="ascii").split()[0])
    except (OSError, ValueError, IndexError):
        return None
    return uptime_s - started_ticks / os.sysconf("SC_CLK_TCK")


def _view_options(*, headless: bool, record: Path | None, layout: Layout) -> ViewOptions | None:
    """What to show; None for nothing. Without a display the viewer is left out, which is said."""
    from telemetry.view.options import ViewOptions, display_available

    if record is not None and record.suffix != ".rrd":
        raise InputError("must end in .rrd", key="--record", value=str(record), mend="name it FILE.rrd")
    viewer = not headless
    if viewer and not display_available():
        viewer = False
        say("No display here: flying headless, without a viewer (--record FILE.rrd keeps the view).")
    if not viewer and record is None:
        return None
    return ViewOptions(viewer=viewer, record=record, layout=layout)


def _fly(
    scenario: Scenario,
    *,
    speed: float,
    view: ViewOptions | None,
    outputs: dict[str, Any],
    policy: str | None,
) -> tuple[FlightRecord, float | None, int]:
    """Fly and summarize; gives the record, when it began, and the exit code where a signal ended it (else 0)."""
    from rtsim.cli.flight_screen import FlightScreen
    from rtsim.realtime.control import FlightControl
    from rtsim.realtime.keys import KEY_HELP, KeyReader

    control = FlightControl()
    places = [
        f"{what}: {place}"
        for what, place in (("log", outputs["log"]), ("recording", view.record if view else None))
        if place is not None
    ]
    describe(scenario, speed=speed, outputs=places)
    by_hand = outputs["mavlink"] is not None
    screen = FlightScreen(scenario, control, paced=not math.isinf(speed), by_hand=by_hand)
    from scenarios.flight.runner import FlightOutputs, fly

    with _stopping_signals(control) as signals, KeyReader(control, on_help=lambda: screen.say(KEY_HELP)) as keys:
        if keys.active and not math.isinf(speed):
            say("Keys: space pauses, q quits, ? lists the others.")

        def on_start() -> None:
            ready()
            NOTICE.flies()
            signals.arm()
            screen.first_frame_s = process_age_s()

        preparing = working("Preparing the flight" if not math.isinf(speed) else "")
        wanted = FlightOutputs(
            **outputs,
            view=view,
            on_message=screen.say,
            on_rows=screen.on_rows,
            on_event=screen.on_event,
            on_start=on_start,
        )
        with screen.running(), preparing as ready:
            flight = fly(
                scenario,
                speed="max" if math.isinf(speed) else speed,
                control=control,
                overrun_policy=policy,
                outputs=wanted,
            )
    summarize(flight, first_frame_s=screen.first_frame_s)
    return flight, screen.first_frame_s, stopping.exit_code(signals.received) if signals.received else 0


class StoppingSignals:
    """Signals that end a command end a running flight cleanly; one ``CLOSING_S`` later ends the program at once."""

    def __init__(self, control: FlightControl) -> None:
        """Prepare; nothing is caught before :meth:`arm`.

        Args:
            control: The flight to stop.
        """
        self.received: signal.Signals | None = None
        """The signal that ended the flight."""
        self._control = control
        self._previous: dict[signal.Signals, Any] = {}

    def arm(self) -> None:
        """Catch the signals from now on; before, they end the program as usual."""
        stopping.raise_if_lost()
        for number in stopping.SIGNALS:
            if signal.getsignal(number) == signal.SIG_IGN:
                continue  # nohup
            self._previous[number] = signal.signal(number, self._handle)

    def disarm(self) -> None:
        """Give the signals back."""
        while self._previous:
            number, handler = self._previous.popitem()
            signal.signal(number, handler)

    def _handle(self, number: int, _frame: FrameType | None) -> None:
        if number == signal.SIGHUP:
            stopping.leave_terminal()
        if self.received is not None:
            if not stopping.disturbs():
                self.disarm()
                os.kill(os.getpid(), self.received)
            return
        stopping.begin_closing(number)
        self.received = signal.Signals(number)
        name = "Ctrl-C" if number == signal.SIGINT else self.received.name
        self._control.stop(f"stopped by {name}")


@contextmanager
def _stopping_signals(control: FlightControl) -> Iterator[StoppingSignals]:
    signals = StoppingSignals(control)
    try:
        yield signals
    finally:
        signals.disarm()
