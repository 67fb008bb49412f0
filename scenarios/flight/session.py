"""One flight as a source of frames: simulation, scenario events and a pilot plug-in, stepped by whoever paces it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from rtsim.aids.design import switch_of
from rtsim.arrays import FloatArray
from rtsim.choices import PilotMode
from rtsim.command import Command, Pilot
from rtsim.errors import InputError
from rtsim.faults.fault import fault_events
from rtsim.frame import COLUMN, SIGNAL_COUNT
from rtsim.guests import GuestError, visited
from rtsim.loop.data import END
from rtsim.loop.simulation import END_REASONS, Disturbance, Simulation
from rtsim.protection.chain import LawEvent
from rtsim.units import to_deg, to_rpm
from scenarios.files.disturbances import disturbance_event
from scenarios.files.nacelle_laws import NacelleLawFactory, NacelleLawGuard
from scenarios.files.scenario import ScenarioEvent
from scenarios.flight.hands import Hands, pilot_modes
from scenarios.flight.pilots import PilotFactory
from telemetry.log.format import LogEvent

PILOT_WORDS: dict[PilotMode, str] = {
    "mocm": "the MOCM pilot flies",
    "external": "the pilot plug-in flies",
    "hold": "the controls are held",
}
"""What a hand-over to each mode means, for people."""
HAND_WORDS = "your sticks fly"
"""The same for the mode ``external`` where a person holds the sticks."""
GENTLE_END = END_REASONS[END.gentle_landing].split(",", maxsplit=1)[0]
"""How the end reason of a gentle landing begins."""

SIDEWAYS_FROM = 0.05
"""Lateral stick or pedal from which it is said that it does not act, where it does not."""
_LATERAL, _PEDAL = COLUMN.pilot_lateral_stick, COLUMN.pilot_pedal
ROOM_FRAMES = 65_536
"""Rows of an unpaced flight that lie together in memory, at most."""


class FlightSession:
    """Flies a simulation for a number of frames; implements ``rtsim.realtime.source.FrameSource``.

    Everything that changes the flight from outside (a scenario's event, a key, a reset, a pilot that fails) becomes
    an event with the number of the row before which it acts, which is all a replay needs.
    """

    def __init__(
        self,
        simulation: Simulation,
        *,
        frames: int,
        events: Sequence[ScenarioEvent] = (),
        pilot_factory: PilotFactory | None = None,
        pilot_name: str = "mocm",
        hands: Hands | None = None,
        nacelle_law: NacelleLawFactory | None = None,
    ) -> None:
        """Prepare a flight from the simulation's present state, which must be frame 0.

        Args:
            simulation: What flies.
            frames: Length of the flight, counted from the last reset.
            events: What the scenario makes happen, in order of time.
            pilot_factory: Makes the pilot plug-in; None where the built-in pilot flies alone.
            pilot_name: How the pilot is called in messages.
            hands: A person who may fly by MAVLink; None where there is no MAVLink.
            nacelle_law: Makes the law that sets the nacelle rate; None where pilot or built-in law do.
        """
        self.simulation = simulation
        self.rows = 0
        """Rows flown so far, resets or not."""
        self.on_event: Callable[[LogEvent], None] | None = None
        """Told about every event."""
        self._frames = frames
        self._due = [(max(0, math.ceil(event.time / simulation.dt - 1e-9)), event) for event in events]
        self._next_due = 0
        self._failures = [
            (max(0, math.ceil(event.time / simulation.dt - 1e-9)), event)
            for event in fault_events(simulation.setup.faults, simulation.database.profile)
        ]
        self._next_failure = 0
        self._pilot_factory, self._pilot_name = pilot_factory, pilot_name
        self._pilot: Pilot | None = pilot_factory() if pilot_factory is not None else None
        self._hands = hands
        self._nacelle_law = NacelleLawGuard(nacelle_law) if nacelle_law is not None else None
        self._failure = ""
        self.by_hand = hands is not None and pilot_factory is None
        """Whether the mode ``external`` means the sticks of a person, not the plug-in."""
        self._in_block: tuple[int, int] | None = None
        self._symmetric = simulation.tables.plant.lateral == 0  # and that is still to be said
        self._room = np.empty((0, SIGNAL_COUNT))  # what the next blocks are written to

    @property
    def dt(self) -> float:
        """Length of a frame [s]."""
        return self.simulation.dt

    @property
    def finished(self) -> bool:
        """Whether the flight is over: flown to its length, ended by itself, or its pilot failed."""
        return bool(self._failure) or self.simulation.finished or self.simulation.frame_index >= self._frames

    @property
    def completed(self) -> bool:
        """Whether it was flown to its length, or by hand to a gentle landing."""
        if self.simulation.finished:
            return self._hands is not None and self.simulation.end_reason.startswith(GENTLE_END)
        return not self._failure and self.simulation.frame_index >= self._frames

    @property
    def end_reason(self) -> str:
        """Why the flight is over, as a sentence without full stop."""
        if self._failure:
            return self._failure
        if self.simulation.finished:
            return self.simulation.end_reason
        return f"flown to its end at {self._frames * self.dt:.1f} s"

    def step(self) -> FloatArray:
        """Fly one frame.

        Returns:
            Its row, shape (SIGNAL_COUNT,).
        """
        if self._next_due < len(self._due):
            self._start_due_events()
        if self._next_failure < len(self._failures):
            self._tell_failures()
        simulation = self.simulation
        command, hands = None, self._hands
        if hands is not None:
            command = hands.before(self)
        if simulation.mode == "external" and not self.by_hand and self._pilot is not None:
            command = self._ask_pilot(self._pilot)
        scripted = command is not None
        if self._nacelle_law is not None and simulation.mode != "hold":
            command = self._tilt(self._nacelle_law, command)
        row = simulation.step(command, scripted=scripted)
        self.rows += 1
        if self._symmetric and max(abs(row.item(_LATERAL)), abs(row.item(_PEDAL))) > SIDEWAYS_FROM:
            self._say_symmetric()
        if hands is not None:
            hands.after(row, simulation.dt)
        return row

    def run(self, frames: int) -> FloatArray:
        """Fly several frames, in one compiled call where only built-in parts fly.

        Args:
            frames: How many at most.

        Returns:
            The rows, shape (flown, SIGNAL_COUNT).
        """
        frames = min(frames, self._frames - self.simulation.frame_index)
        if self._next_due < len(self._due):
            self._start_due_events()
        if self._next_due < len(self._due):
            frames = min(frames, self._due[self._next_due][0] - self.simulation.frame_index)
        if self._next_failure < len(self._failures):
            self._tell_failures()
        if self._next_failure < len(self._failures):
            frames = min(frames, self._failures[self._next_failure][0] - self.simulation.frame_index)
        by_code = self._hands is not None or self._nacelle_law is not None
        if not by_code and (self._pilot is None or self.simulation.mode != "external"):
            self._in_block = (self.rows, self.simulation.frame_index)
            if len(self._room) < frames:
                left = self._frames - self.simulation.frame_index
                self._room = np.empty((max(frames, min(left, ROOM_FRAMES)), SIGNAL_COUNT))
            rows = self.simulation.run(frames, self._room)
            self._room = self._room[len(rows) :]
            self._in_block = None
            self.rows += len(rows)
            if self._symmetric and np.abs(rows[:, (_LATERAL, _PEDAL)]).max(initial=0.0) > SIDEWAYS_FROM:
                self._say_symmetric()
            return rows
        rows = np.empty((frames, SIGNAL_COUNT))
        flown = 0
        while flown < frames and not self.finished:
            rows[flown] = self.step()
            flown += 1
        return rows[:flown]

    def reset(self) -> None:
        """Put the aircraft, its pilot and the scenario's events back to the start."""
        self._tell("reset", "the flight starts again")
        self.simulation.reset()
        self._next_due = self._next_failure = 0
        if self._pilot_factory is not None:
            self._pilot = self._pilot_factory()
        if self._hands is not None:
            self._hands.reset(self.simulation)
        if self._nacelle_law is not None:
            self._nacelle_law.reset()

    def switch_pilot(self, pilot: str, *, by_hand: bool = False) -> None:
        """Hand the controls over from the coming frame on.

        Args:
            pilot: ``mocm``, ``external`` (the plug-in, else a person), ``hold``, or ``next`` for the next one there is.
                One that this flight does not have is refused by an event and changes nothing.
            by_hand: ``external`` is the person, also where there is a plug-in.
        """
        available = list(pilot_modes(plug_in=self._pilot is not None, hands=self._hands is not None))
        present = self.simulation.mode
        if pilot == "next":
            pilot = available[(available.index(present) + 1) % len(available)]
        for mode in available:
            if mode == pilot:
                by_hand = mode == "external" and self._hands is not None and (by_hand or self._pilot is None)
                self.by_hand = by_hand or self._pilot is None
                self._tell("pilot", HAND_WORDS if by_hand else PILOT_WORDS[mode], {"mode": mode})
                self.simulation.set_pilot(mode)
                if mode == "mocm" and "governor" not in self.simulation.aids:
                    text = "the virtual pilot reckons with a governed rotor, and the governor is off"
                    self._tell("advice", text, level="warning")
                if by_hand and self._hands is not None:
                    self._hands.engage()
                return
        text = f"'{pilot}' is not a pilot of this flight; there are {', '.join(available)}"
        self._tell("refused", text, level="warning")

    def disturb(self, change: Disturbance) -> None:
        """Change the air, or let something fail or mend, from the coming frame on.

        Args:
            change: What happens; what cannot be done (no room for another gust) is told and changes nothing.
        """
        kind, text, data = disturbance_event(change)
        if not self._done(lambda: self.simulation.disturb(change)):
            return
        self._tell(kind, text, data, level="info" if kind == "turbulence" else "warning")

    def switch_aid(self, name: str, *, on: bool | None) -> None:
        """Switch a pilot aid from the coming frame on; one that cannot be switched is told and changes nothing.

        Args:
            name: One of ``rtsim.aids.design.SWITCHES``.
            on: On or off; None switches it over.
        """
        on = name not in self.simulation.aids if on is None else on
        if self._done(lambda: self.simulation.set_aid(switch_of(name), on)):
            self._tell("aid", f"{name.replace('_', ' ')} {'on' if on else 'off'}", {"aid": name, "on": int(on)})

    def set_flaps(self, angle: float) -> None:
        """Send the flaps to a setting from the coming frame on; what cannot be done is told and changes nothing.

        Args:
            angle: Flap deflection [rad].
        """
        if self._done(lambda: self.simulation.set_flaps(angle)):
            self._tell("flaps", f"flaps to {to_deg(angle):.0f} deg", {"angle": angle})

    def step_flaps(self, step: int) -> None:
        """Send the flaps to the next published setting.

        Args:
            step: 1 down (more flap), -1 up.
        """
        present, wanted = self.simulation.flap_setting, self.simulation.next_flap_setting(step)
        if wanted != present:  # at the end of the travel there is nothing to say
            self.set_flaps(wanted)

    def trim_throttle(self, share: float) -> None:
        """Trim the throttle from the coming frame on; what is out of range is told and changes nothing.

        Args:
            share: Engine power to add with the rotor-speed governor off, as a share of full power.
        """
        if self._done(lambda: self.simulation.set_throttle_trim(share)):
            self._tell("throttle", f"throttle trimmed to {100.0 * share:+.0f} % of full power", {"share": share})

    def set_rotor_speed(self, speed: float) -> None:
        """Give the governor another rotor speed to hold; what cannot be done is told and changes nothing.

        Args:
            speed: Rotor speed [rad/s].
        """
        if self._done(lambda: self.simulation.set_rotor_speed(speed)):
            self._tell("rotor_speed", f"rotor speed to {to_rpm(speed):.0f} rpm", {"speed": speed})

    def override_protection(self) -> None:
        """Take the authority from the protection law from the coming frame on, or give it back."""
        on = not self.simulation.protection_overridden
        text = "the pilot overrides the protection" if on else "the protection has its authority back"
        self._tell("override", text, {"on": int(on)}, level="warning" if on else "info")
        self.simulation.set_protection_override(on)

    def law_event(self, event: LawEvent) -> None:
        """Record what a protection law did besides its work; a replay does the same to it.

        Args:
            event: From the simulation's chain of laws.
        """
        data: dict[str, Any] = {"law": event.law, "what": event.kind, "ended": int(event.ended)}
        if self._in_block is not None:
            rows, frame = self._in_block  # counted when the block is over
            data["row"] = rows + self.simulation.frame_index - frame
        self._tell("law", event.text, data, level="warning")

    def tell(self, kind: str, text: str) -> None:
        """Make an event that changes nothing a replay would need.

        Args:
            kind: One word, for programs.
            text: One line, for people.
        """
        self._tell(kind, text)

    def _done(self, change: Callable[[], None]) -> bool:
        """Make a change that somebody outside asked for; where it cannot be made, that is told."""
        try:
            change()
        except InputError as error:
            self._tell("refused", str(error), level="warning")
            return False
        return True

    def _tell_failures(self) -> None:
        """Record the failures of the scenario that begin or end with this frame; they act by themselves."""
        frame = self.simulation.frame_index
        while self._next_failure < len(self._failures) and self._failures[self._next_failure][0] <= frame:
            event = self._failures[self._next_failure][1]
            self._next_failure += 1
            name, _, change = event.name.rpartition(" ")
            text = f"{'failure' if change == 'on' else 'mended'}: {name.replace('-', ' ')}"
            self._tell("scheduled_failure", text, {"name": event.name, "value": event.value}, level="warning")

    def _start_due_events(self) -> None:
        frame = self.simulation.frame_index
        while self._next_due < len(self._due) and self._due[self._next_due][0] <= frame:
            event = self._due[self._next_due][1]
            self._next_due += 1
            self.switch_pilot(event.pilot)

    def _say_symmetric(self) -> None:
        """Say once that this aircraft does not answer to lateral stick and pedals."""
        self._symmetric = False
        text = "this aircraft does not roll or turn: lateral stick and pedals do not act"
        self._tell("advice", text, level="warning")

    def _ask_pilot(self, pilot: Pilot) -> Command | None:
        """The plug-in's command; where it fails, the flight ends with the controls held for one last frame."""
        simulation = self.simulation
        try:
            answer = visited(pilot.step, simulation.sensors(), simulation.reference(), simulation.dt)
            command = visited(Command.given, answer)
        except GuestError as error:
            problem = f"raised {error}"
        else:
            if command.finite:
                return command
            problem = f"gave a command that is not finite: {command}"
        self._failure = f"the pilot {self._pilot_name} {problem}"
        self._tell("pilot_failed", self._failure, level="warning")
        self.switch_pilot("hold")
        return None

    def _tilt(self, law: NacelleLawGuard, command: Command | None) -> Command:
        """The pilot's command with the law's nacelle rate; a law that has failed leaves it as it is."""
        simulation = self.simulation
        command = simulation.pilot_command() if command is None else command
        changed, failure = law.step(simulation.sensors(), command, simulation.dt)
        if failure:
            self._tell("nacelle_law_failed", f"{failure}; the pilot sets the nacelles", level="warning")
        return changed

    def _tell(self, kind: str, text: str, data: dict[str, Any] | None = None, *, level: str = "info") -> None:
        if self.on_event is not None:
            time = self.simulation.frame_index * self.dt
            details = {"row": self.rows, **(data or {})}
            self.on_event(LogEvent(self.simulation.frame_index, time, kind, text, level, details))
