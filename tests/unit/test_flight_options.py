"""One declaration of a flight's options: whatever offers, reads or keeps them follows it."""

from __future__ import annotations

import dataclasses
import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, get_type_hints

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st

from rtsim.cli.main import build_app
from rtsim.errors import InputError
from rtsim.loop import option_tables
from rtsim.loop.options import CONDITION, FlightOptions, Option, declared
from rtsim.loop.setup import FlightSetup
from rtsim.lpv.files.netcdf import SHIPPED
from rtsim.programme import Programme
from scenarios.campaign.draws import draw_plan
from scenarios.campaign.spec import CLASS_OPTIONS, FILE_OPTIONS, parse_campaign
from scenarios.campaign.trial import FlightPlan
from scenarios.files.loader import load_scenario, parse_scenario
from scenarios.files.options import Overrides, with_overrides
from scenarios.files.scenario import Scenario
from scenarios.flight.flight_setup import flight_setup, setup_from_json, setup_to_json

ROOT = Path(__file__).resolve().parents[2]
OPTIONS = list(declared().values())
NAMES = {item.name: item.name for item in OPTIONS}


def another(item: Option) -> Any:
    """A value of an option, in its unit, that is not its default."""
    if item.choices:
        words = [word for word in item.choices if word != item.default][::-1]
        return words[:2] if item.is_list else words[0]
    if item.kind is bool:
        return not item.default
    if item.kind is str:
        return str(SHIPPED) if item.is_file else "mine:Own"
    value = item.shown(item.default) + 0.5 * ((100.0 if item.high is None else item.high) - item.shown(item.default))
    return item.kind(value)


OTHER = {item.key: another(item) for item in OPTIONS}
SCENARIO = 'format = 1\nname = "mine"\ntitle = "Mine"\nduration_s = 5.0\n[start]\ncondition = "hover"\n[flight]\n'
CAMPAIGN = """
format = 1
name = "mine"
title = "Mine"
{file}
[[classes]]
name = "early"
start = {{ airspeed_kt = 60, nacelle_deg = 82 }}
{classes}
"""


def toml(values: dict[str, Any]) -> str:
    """Keys and values as lines of TOML; JSON spells these values the same way."""
    return "".join(f"{key} = {json.dumps(value)}\n" for key, value in values.items())


def parsed(values: dict[str, Any]) -> FlightOptions:
    """The options of a scenario with these keys in ``[flight]``."""
    scenario, problems = parse_scenario(SCENARIO + toml(values), file="/tmp/mine.toml")
    assert not problems, problems
    assert scenario is not None
    return scenario.options


def values_of(item: Option) -> st.SearchStrategy[Any]:
    """Values of an option in its unit."""
    if item.is_list:
        return st.lists(st.sampled_from(item.choices), unique=True)
    if item.choices:
        return st.sampled_from(item.choices)
    if item.kind is bool:
        return st.booleans()
    if item.kind is int:
        return st.integers(int(item.low or 0), int(item.high or 0))
    if item.kind is float:
        return st.floats(item.low, item.high).filter(lambda value: value != 0.0 or str(value) == "0.0")
    if item.is_file:
        return st.sampled_from(["/tmp/mine.nc", "/tmp/yours.mat"])
    return st.sampled_from([str(item.default), "module:Class", "entry_point"])


SETS = st.fixed_dictionaries({}, optional={item.key: values_of(item) for item in OPTIONS})


def test_every_option_has_another_value_here() -> None:
    assert all(item.inside(OTHER[item.key]) != item.default for item in OPTIONS)


def test_nobody_repeats_an_option() -> None:
    """What holds a flight's options holds them whole."""
    for kind in (Scenario, FlightSetup):
        fields = {field.name for field in dataclasses.fields(kind)}
        assert fields & set(NAMES) == set(), kind
        assert get_type_hints(kind)["options"] is FlightOptions
    assert get_type_hints(FlightPlan)["setup"] is FlightSetup
    assert {field.name for field in dataclasses.fields(FlightPlan)} & set(NAMES) == set()


@pytest.mark.parametrize("name", NAMES)
def test_a_key_of_a_scenario_reaches_the_simulation(name: str) -> None:
    item = declared()[name]
    wanted = item.inside(OTHER[item.key])
    text = SCENARIO + toml({item.key: OTHER[item.key]})
    scenario, problems = parse_scenario(text, file="/tmp/mine.toml")
    assert not problems, problems
    assert scenario is not None
    setup = flight_setup(scenario)
    assert getattr(setup.options, name) == wanted
    assert setup.options.shown()[item.key] == OTHER[item.key]
    assert dataclasses.replace(setup.options, **{name: item.default}) == FlightOptions()
    overridden = with_overrides(load_scenario("hover"), Overrides(**{name: wanted}))
    assert getattr(overridden.options, name) == wanted


@given(values=SETS)
def test_options_survive_a_file_and_a_log(values: dict[str, Any]) -> None:
    options = parsed(values)
    assert options == FlightOptions(
        **{item.name: item.inside(values[item.key]) for item in OPTIONS if item.key in values}
    )
    setup = FlightSetup(programme=Programme.hold(airspeed=0.0, nacelle_angle=1.5, altitude=100.0), options=options)
    read = setup_from_json(json.loads(json.dumps(setup_to_json(setup)))).options
    assert read == options
    assert [type(getattr(read, name)) for name in NAMES] == [type(getattr(options, name)) for name in NAMES]
    json.dumps(options.shown(), allow_nan=False)


@pytest.mark.parametrize("item", [item for item in OPTIONS if item.low is not None], ids=lambda item: item.key)
def test_a_range_holds_wherever_a_value_comes_from(item: Option) -> None:
    assert item.high is not None
    beyond = 2 * item.high if item.kind is float else int(item.high) + 1
    _, problems = parse_scenario(SCENARIO + toml({item.key: beyond}), file="mine.toml")
    text = str(problems[0])
    assert f"flight.{item.key}: " in text
    if beyond < 2**63:  # beyond that TOML has no whole numbers
        assert "is out of range" in text
    with pytest.raises(InputError, match=f"{item.flag}: is out of range"):
        with_overrides(load_scenario("hover"), Overrides(**{item.name: beyond * item.factor}))


@pytest.mark.parametrize("item", [item for item in OPTIONS if item.choices], ids=lambda item: item.key)
def test_a_misspelled_choice_is_refused(item: Option) -> None:
    wrong = (item.choices[0] + "x",) if item.is_list else item.choices[0] + "x"
    with pytest.raises(InputError, match=f"{item.flag}: is not one of the choices .*'{item.choices[0]}' is meant"):
        FlightOptions().changed({item.name: wrong})


def test_the_command_line_offers_every_option_with_help_and_default() -> None:
    command = typer.main.get_command(build_app()).commands["fly"]  # type: ignore[attr-defined]
    offered = {parameter.name: parameter for parameter in command.params}
    for item in OPTIONS:
        parameter = offered[item.name]
        assert item.flag in parameter.opts
        assert item.help.removesuffix(".") in parameter.help
        assert item.default_text in parameter.show_default
    for name, parameter in offered.items():
        if name not in {"scenario", "help"}:
            assert parameter.show_default or parameter.default is not None, f"{name} shows no default"
            assert parameter.rich_help_panel, f"{name} stands in no group"


def test_a_campaign_draws_and_sets_options() -> None:
    conditions = [item for item in FILE_OPTIONS if item.name in CONDITION]  # which a database of one's own excludes
    spec, problems = parse_campaign(
        CAMPAIGN.format(file=toml({item.key: OTHER[item.key] for item in conditions}), classes=""), file="mine.toml"
    )
    assert spec is not None, problems
    assert option_tables.given(spec).items() >= {item.name: item.inside(OTHER[item.key]) for item in conditions}.items()
    file_options = [item for item in FILE_OPTIONS if item not in conditions]
    given_once = {item.key: OTHER[item.key] for item in file_options}
    in_class = {item.key: OTHER[item.key] for item in CLASS_OPTIONS}
    text = CAMPAIGN.format(file=toml(given_once), classes=toml(in_class))
    spec, problems = parse_campaign(text, file="/tmp/mine.toml")
    assert spec is not None, problems
    options = draw_plan(spec, seed=0, class_number=0, run=0).setup.options
    for item in (*file_options, *CLASS_OPTIONS):
        assert getattr(options, item.name) == item.inside(OTHER[item.key]), item.key
    numbers = [item for item in CLASS_OPTIONS if item.is_number]
    assert numbers
    for item in numbers:
        drawn = f"{item.key} = {{ uniform = [{item.low}, {item.high}] }}"
        spec, problems = parse_campaign(CAMPAIGN.format(file="", classes=drawn), file="mine.toml")
        assert spec is not None, problems
        values = [
            getattr(draw_plan(spec, seed=0, class_number=0, run=run).setup.options, item.name) for run in range(5)
        ]
        assert len(set(values)) == 5
        beyond = CAMPAIGN.format(file="", classes=f"{item.key} = {2 * item.high}")  # type: ignore[operator]
        assert "is out of range" in str(parse_campaign(beyond, file="mine.toml")[1][0])


def tables() -> Any:
    """The script that writes the tables of the docs."""
    spec = importlib.util.spec_from_file_location("docs_tables", ROOT / "docs" / "tables.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("page", tables().TABLES)
def test_the_docs_have_the_tables_of_the_declaration(page: str) -> None:
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    module = tables()
    assert module.BEGIN in text
    assert module.with_table(page, text) == text, "the declaration has changed: run python -m docs.tables"
    for item in OPTIONS if page in {"scenarios.md", "commands.md"} else ():
        assert f"`{item.key if page == 'scenarios.md' else item.flag}" in module.TABLES[page][0]()
        assert not item.page or (ROOT / "docs" / item.page).is_file()


TOY = """
import dataclasses, json
import rtsim.loop.options as declaration

@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class WithToy(declaration.FlightOptions):
    toy: float = declaration.option(
        0.5, help="A toy.", panel="Air", key="toy_ft", unit="ft", factor=0.3048, low=0, high=9
    )

declaration.FlightOptions = WithToy

import docs_tables
import typer
from rtsim.cli.main import build_app
from rtsim.programme import Programme
from scenarios.campaign.draws import draw_plan
from scenarios.campaign.spec import parse_campaign
from scenarios.files.loader import parse_scenario
from scenarios.files.options import Overrides, with_overrides
from scenarios.flight.flight_setup import flight_setup, setup_from_json, setup_to_json

scenario, problems = parse_scenario(SCENARIO + "toy_ft = 2\\n", file="mine.toml")
setup = flight_setup(scenario)
campaign, _ = parse_campaign(CAMPAIGN.format(file="", classes="toy_ft = { uniform = [3, 4] }"), file="mine.toml")
fly = typer.main.get_command(build_app()).commands["fly"]
print(json.dumps({
    "scenario": scenario.options.toy,
    "range": str(parse_scenario(SCENARIO + "toy_ft = 10\\n", file="mine.toml")[1][0]),
    "override": with_overrides(scenario, Overrides(toy=1.5)).options.toy,
    "log": setup_from_json(json.loads(json.dumps(setup_to_json(setup)))).options.toy,
    "json": scenario.options.shown()["toy_ft"],
    "campaign": draw_plan(campaign, seed=0, class_number=0, run=0).setup.options.toy,
    "flag": [parameter.opts for parameter in fly.params if parameter.name == "toy"],
    "docs": docs_tables.scenario_table().splitlines()[-1],
}))
"""


def test_a_new_option_needs_its_declaration_alone(tmp_path: Path) -> None:
    """A toy declared before anything else is loaded is read, drawn, overridden, offered, kept and described."""
    (tmp_path / "docs_tables.py").write_text((ROOT / "docs" / "tables.py").read_text(encoding="utf-8"))
    program = f"SCENARIO = {SCENARIO!r}\nCAMPAIGN = {CAMPAIGN!r}\n{TOY}"
    (tmp_path / "toy.py").write_text(program, encoding="utf-8")
    paths = {**os.environ, "PYTHONPATH": str(ROOT)}
    ended = subprocess.run(
        [sys.executable, str(tmp_path / "toy.py")], capture_output=True, text=True, cwd=ROOT, env=paths, check=False
    )
    assert ended.returncode == 0, ended.stderr
    found = json.loads(ended.stdout)
    foot = 0.3048
    assert found["scenario"] == found["log"] == 2 * foot
    assert "flight.toy_ft: is out of range (got 10); allowed: 0 to 9" in found["range"]
    assert (found["override"], found["json"]) == (1.5, 2.0)
    assert 3 * foot <= found["campaign"] <= 4 * foot
    assert found["flag"] == [["--toy-ft"]]
    assert found["docs"] == "| `toy_ft` | 0 to 9 ft | 1.64042 | A toy [ft] | class |"


def test_options_are_declared_without_compiled_code() -> None:
    program = "import sys, rtsim.loop.options, rtsim.loop.option_tables; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], cwd=ROOT, check=False).returncode == 0
