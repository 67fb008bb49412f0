"""A person's hands in a flight: sticks and requests from MAVLink become commands, switches and hand-overs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, get_args

from rtsim.aids.aids_kernels import MAP, scheduled
from rtsim.aids.design import SWITCHES
from rtsim.arrays import FloatArray
from rtsim.choices import PilotMode, SwitchName
from rtsim.command import Command
from rtsim.frame import COLUMN
from rtsim.loop.simulation import Simulation
from rtsim.protection.boundary import load_boundary
from rtsim.realtime.control import FlightControl
from rtsim.realtime.source import SwitchedFlight
from rtsim.sticks.handler import INPUT_LIVE, INPUT_NONE, StickHandler, StickSituation
from rtsim.sticks.settings import StickSettings
from rtsim.sticks.transition import TO_HELICOPTER, transition_schedule
from rtsim.units import KNOT, deg, to_deg
from telemetry.mavlink.exchange import Feedback, Request
from telemetry.mavlink.link import MavlinkLink

_WATCH_FRAMES = 64


class HandedFlight(SwitchedFlight, Protocol):
    """What the hands need of the flight they are in."""

    by_hand: bool
    """Whether the mode ``external`` means the sticks of a person, not a plug-in."""

    def switch_pilot(self, pilot: str, *, by_hand: bool = False) -> None:
        """Hand the controls over.

        Args:
            pilot: A mode's name, or ``next``.
            by_hand: ``external`` is the person, also where there is a plug-in.
        """
        ...

    @property
    def simulation(self) -> Simulation:
        """What flies."""
        ...

    def tell(self, kind: str, text: str) -> None:
        """Make an event that changes nothing.

        Args:
            kind: One word, for programs.
            text: One line, for people.
        """
        ...


class Hands:
    """Connects one flight to its ground stations, once per frame."""

    def __init__(self, link: MavlinkLink, simulation: Simulation, *, control: FlightControl, waits: bool) -> None:
        """Prepare.

        Args:
            link: The MAVLink process.
            simulation: What flies, at its start.
            control: The hand on the flight, for reset and pause.
            waits: Whether the first sticks that arrive take the controls over.
        """
        self._link, self._control = link, control
        self._settings = StickSettings()
        for name, value in link.config.parameters.items():
            self._settings = self._settings.with_parameter(name, value)
        self._schedule = transition_schedule(load_boundary(simulation.setup.options.corridor_name, simulation.database))
        self._waits = waits
        self._deferred: list[Request] = []
        self._notes: list[tuple[str, str]] = []
        link.on_note = lambda text: self._notes.append(("mavlink", text))
        self._frames = 0
        self._waiting = waits
        self._begin(simulation)
        control.poll = self.idle

    def before(self, flight: HandedFlight) -> Command | None:
        """Serve requests and give the command of the coming frame.

        Args:
            flight: The flight; its pilot and aids may be switched.

        Returns:
            The hands' command where they fly, else None.
        """
        while self._notes:
            flight.tell(*self._notes.pop(0))
        requests = self._link.input.requests()
        if requests or self._deferred:
            pending, self._deferred = [*self._deferred, *requests], []
            resets = False
            for request in pending:
                resets = resets or request.kind == "reset"
                if resets and request.kind not in {"reset", "freeze"}:
                    self._deferred.append(request)  # the reset comes before the next frame and would undo it
                else:
                    self._serve(request, flight)
        sticks, age = self._link.input.read(), self._link.input.age()
        fresh = sticks.sequence > 0 and age <= self._settings.loss_time
        simulation = flight.simulation
        if self._waiting and fresh and sticks.held:
            self._waiting = False
            if not _flies(flight):
                flight.switch_pilot("external", by_hand=True)
        command = None
        if _flies(flight):
            situation = StickSituation(self._airspeed, self._angle, self._trim_stick(simulation))
            command = self._handler.step(sticks, age=age, situation=situation, dt=simulation.dt)
            state = self._handler.state
        else:
            state = INPUT_LIVE if fresh else INPUT_NONE
        handler = self._handler
        self._link.report(
            Feedback(
                handler.stick,
                handler.lever,
                handler.lateral_stick,
                handler.pedal,
                float(handler.nacelle_switch),
                self._angle,
                float(state),
                self._link.input.first_use_age,
                self._aid_bits(simulation.aids),
                float(handler.transition),
                waiting=float(handler.waiting if simulation.mode == "external" else 0),
            )
        )
        return command

    def after(self, row: FloatArray, dt: float) -> None:
        """Look at the frame that was flown."""
        # The command angle of the actuator at the start of the coming frame.
        self._angle = deg(row[COLUMN.nacelle_reference_deg] + row[COLUMN.nacelle_command_rate_deg_s] * dt)
        self._airspeed = row[COLUMN.airspeed_kt] * KNOT
        self._acting = (row[COLUMN.stick], row[COLUMN.lever])
        self._frames += 1
        if self._frames % _WATCH_FRAMES == 0:
            self._link.watch()

    def idle(self) -> None:
        """Hear requests while the flight stands still; called by the executive."""
        for request in self._link.input.requests():
            if request.kind == "freeze":
                self._notes.append(self._toggle_pause())
            elif request.kind == "reset":
                self._deferred.clear()  # asked for before it
                self._control.reset()
            else:
                self._deferred.append(request)
        self._handler.go_on()
        self._link.watch()

    def engage(self) -> None:
        """The hands take over in the coming frame."""
        self._waiting = False
        self._handler.engage(Command(float(self._acting[0]), float(self._acting[1]), 0.0))

    def reset(self, simulation: Simulation) -> None:
        """The flight starts again; the hands wait for sticks as at the first start.

        Args:
            simulation: What flies, at its start.
        """
        self._begin(simulation)

    def summary(self) -> dict[str, Any]:
        """What passed, as the ``mavlink`` entry of ``rtsim fly --json``."""
        ages = self._link.input.ages()
        age_ms = None if ages is None else {"p50": ages.p50_ms, "p99": ages.p99_ms, "max": ages.max_ms}
        return {"port": self._link.port, "input_age_ms": age_ms, **self._link.counters()}

    def _begin(self, simulation: Simulation) -> None:
        command = simulation.pilot_command()
        self._acting = (command.stick, command.lever)
        self._handler = StickHandler(
            self._settings,
            start=Command(0.0, command.lever, 0.0),
            schedule=self._schedule,
            tables=simulation.tables.nacelle,
        )
        sensors = simulation.sensors()
        self._angle, self._airspeed = sensors.nacelle_angle, sensors.airspeed
        self._waiting = self._waits
        self._known_aids: tuple[SwitchName, ...] | None = None
        self._bits = 0.0

    def _serve(self, request: Request, flight: HandedFlight) -> None:
        kind = request.kind
        if kind == "freeze":
            flight.tell(*self._toggle_pause())
        elif kind == "reset":
            self._control.reset()
        elif kind == "pilot":
            self._waiting = False
            if request.name != flight.simulation.mode or (request.name == "external" and not flight.by_hand):
                flight.switch_pilot(request.name, by_hand=True)
        elif kind in {"aid", "flaps", "throttle", "rotor_speed"}:
            _switch(request, flight)
        elif kind == "parameter":
            self._settings = self._settings.with_parameter(request.name, request.value)
            self._handler.change(self._settings)
            flight.tell("parameter", f"{request.name} = {request.value:g}")
        elif kind in {"nacelle", "transition"}:
            if not _flies(flight):
                flight.switch_pilot("external", by_hand=True)
            if kind == "nacelle":
                self._handler.go_to(request.value)
                flight.tell(kind, f"a ground station sends the nacelles to {to_deg(request.value):.0f} deg")
            elif self._handler.start_transition(int(request.value)):
                towards = "helicopter" if int(request.value) == TO_HELICOPTER else "airplane"
                flight.tell(kind, f"a ground station asks for the conversion to the {towards}")

    def _toggle_pause(self) -> tuple[str, str]:
        """Freeze the flight, or let it go on; gives the event of it."""
        self._control.toggle_pause()
        return (
            ("thaw", "a ground station lets the flight go on")
            if self._control.paused
            else (
                "freeze",
                "a ground station freezes the flight",
            )
        )

    def _trim_stick(self, simulation: Simulation) -> float:
        """Stick that trims with the hands off: none where the bias schedule supplies it."""
        if "trim_bias" in simulation.aids:
            return 0.0
        return float(scheduled(simulation.tables.aids, MAP.stick, self._airspeed, self._angle))

    def _aid_bits(self, aids: tuple[SwitchName, ...]) -> float:
        if aids != self._known_aids:
            self._known_aids = aids
            self._bits = float(sum(1 << place for place, name in enumerate(SWITCHES) if name in aids))
        return self._bits


def _flies(flight: HandedFlight) -> bool:
    """Whether the hands fly."""
    return flight.simulation.mode == "external" and flight.by_hand


def _switch(request: Request, flight: HandedFlight) -> None:
    """Serve a request for an aid, the flaps, the throttle or the rotor speed."""
    if request.kind == "throttle":
        flight.trim_throttle(request.value)
    elif request.kind == "rotor_speed":
        flight.set_rotor_speed(request.value)
    elif request.kind == "flaps":
        steps = {"up": -1, "down": 1}
        if request.name in steps:
            flight.step_flaps(steps[request.name])
        else:
            flight.set_flaps(request.value)
    elif request.name in SWITCHES:
        on = request.name in flight.simulation.aids
        if request.value == 2.0 or (request.value == 1.0) != on:
            flight.switch_aid(request.name, on=not on)


def pilot_modes(*, plug_in: bool, hands: bool) -> Sequence[PilotMode]:
    """Who can fly a flight.

    Args:
        plug_in: It has a pilot plug-in.
        hands: Somebody may hold the sticks.
    """
    everybody: tuple[PilotMode, ...] = get_args(PilotMode)
    return everybody if plug_in or hands else tuple(mode for mode in everybody if mode != "external")
