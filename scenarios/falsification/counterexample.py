"""The flight that breaks a law, as a scenario: shrunk, flown again, flown on the nonlinear aircraft, told in words."""

from __future__ import annotations

import base64
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rtsim.errors import InputError, RtsimError
from rtsim.properties.formula import Robustness, parse_property
from rtsim.whole_file import write_whole
from scenarios.campaign.chunks import LawVariant, Task, flown_of, fly_law, task_spec, twin_of
from scenarios.campaign.trial import Bench, TrialFlight
from scenarios.falsification.archive import Tried
from scenarios.falsification.scenario_tables import Tables, scenario_tables, scenario_text
from scenarios.falsification.shrinking import Shrinker
from scenarios.falsification.space import class_spaces
from scenarios.falsification.words import told
from scenarios.files.loader import parse_scenario
from scenarios.files.scenario import Scenario
from scenarios.verdicts.tester import Tester, judged_scenario, plan_of


@dataclass(frozen=True, slots=True, eq=False)
class Counterexample:
    """A scenario in which a law breaks a property."""

    formula: str
    """The property."""
    text: str
    """The scenario file."""
    sentence: str
    """What happens."""
    robustness: Robustness
    """How far it is broken."""
    history_sha256: str
    """Hash of the flight's history."""
    nonlinear: Robustness | None
    """The same on the nonlinear aircraft; None where it cannot be flown there."""
    flights: int
    """Flights that shrinking took."""
    as_found: Robustness
    """How far the flight breaks it as it was found."""

    def write(self, path: Path, law: str) -> list[Path]:
        """Write the scenario, and its picture beside it.

        Args:
            path: The scenario file.
            law: The law that it breaks.

        Returns:
            What was written.

        Raises:
            OutputError: It cannot be written.
        """
        from scenarios.verdicts.picture import picture

        write_whole(path, self.text.encode())
        case = Tester(law=law).run(_parsed(self.text))
        drawn = path.with_suffix(".svg")
        write_whole(drawn, base64.b64decode(picture(case).partition(",")[2]))
        return [path, drawn]


class Prover:
    """Flies scenarios with a law and asks a property of them."""

    def __init__(self, law: LawVariant, formula: str, folder: str = "") -> None:
        """Read the property.

        Args:
            law: The law.
            formula: The property.
            folder: Where modules of laws are looked for besides the installed ones.
        """
        self._law, self._property, self._folder = law, parse_property(formula), folder
        self._bench = Bench()

    def fly(self, scenario: Scenario) -> tuple[TrialFlight, Robustness]:
        """Fly a scenario.

        Args:
            scenario: The scenario.

        Raises:
            InputError: It cannot be flown.
        """
        plan = plan_of(judged_scenario(scenario))
        twin = twin_of(self._bench, plan, [self._property])
        flight = fly_law(self._bench, plan, self._law, folder=self._folder)
        return flight, self._property.robustness(flown_of(flight), 1.0 / scenario.options.rate_hz, twin)

    def breaks(self, tables: Tables) -> bool:
        """Whether a scenario breaks the property; False also where it cannot be flown.

        Args:
            tables: Its tables.
        """
        found = self.asked(tables)
        return found is not None and found.broken

    def asked(self, tables: Tables) -> Robustness | None:
        """Robustness of a scenario; None where it cannot be flown, or the law fails by itself.

        Args:
            tables: Its tables.
        """
        try:
            flight, found = self.fly(_parsed(scenario_text(tables)))
        except InputError:
            return None
        return None if flight.law_problems else found

    def off_violates(self, scenario: Scenario) -> list[str]:
        """What the flight violates without a law.

        Args:
            scenario: The scenario.
        """
        return sorted(self._bench.fly(plan_of(judged_scenario(scenario)), "off").metrics.exceeded)


def counterexample(
    task: Task, formula: str, found: Tried, *, name: str, on_flight: Callable[[], None] | None = None
) -> Counterexample | None:
    """Make the scenario of a flight that breaks a property.

    Args:
        task: What flew.
        formula: The property.
        found: The flight.
        name: Name of the scenario.
        on_flight: Told before each flight of shrinking.

    Returns:
        The counterexample; None where a scenario file, whose numbers are in other units, no longer breaks the
        property: the flight was on the edge.
    """
    spec, law = task_spec(task.text, task.file), task.laws[0]
    plan = class_spaces(spec)[found.query.class_number].plan(spec, found.query.vector, task.options)
    item = spec.classes[found.query.class_number]
    prover = Prover(law, formula, task.folder)
    tables = scenario_tables(plan, name=name, title=f"{item.title or item.name}: breaks {law.name}", law=law.name)
    as_found = prover.asked(tables)
    if as_found is None or not as_found.broken:
        return None
    shrinker = Shrinker(tables, prover.breaks, on_flight=on_flight)
    tables = shrinker.shrink(as_found.time)
    scenario = _parsed(scenario_text(tables))
    flight, robustness = prover.fly(scenario)
    tables["title"] = tables["title"][:200]
    tables["description"] = told(tables, law.name, formula, robustness, flight)
    off = prover.off_violates(scenario)
    tables["trial"] = _trial(tables, law.name, formula, off)
    text = scenario_text(tables)
    flight, robustness = prover.fly(_parsed(text))
    history = flight.history_sha256
    return Counterexample(
        formula=formula,
        text=text,
        sentence=tables["description"],
        robustness=robustness,
        history_sha256=history,
        nonlinear=_on_the_nonlinear(prover, tables),
        flights=shrinker.flights,
        as_found=as_found,
    )


def _trial(tables: Tables, law: str, formula: str, off: list[str]) -> dict[str, Any]:
    kind = "nominal" if not off else "failure" if "faults" in tables else "misuse"
    clause = {"name": "the property that was broken holds", "property": formula}
    return {"kind": kind, "law": law} | ({"off_leaves": off} if off else {}) | {"expect": [clause]}


def _on_the_nonlinear(prover: Prover, tables: Tables) -> Robustness | None:
    try:
        return prover.fly(_parsed(scenario_text(tables)).with_options(plant="nonlinear"))[1]
    except RtsimError:
        return None


def _parsed(text: str) -> Scenario:
    scenario, problems = parse_scenario(text, file="counterexample")
    if scenario is None:
        raise problems[0]
    return scenario
