"""What every command's ``--help`` shows, and what the shell completes."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from typing import Any

import pytest
import typer

from rtsim.cli import main as cli
from rtsim.cli.help_text import Example, HelpText, help_text
from rtsim.optimization.spec import SearchSpec

ROOT: Any = typer.main.get_command(cli.build_app())


def commands(group: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    yield path, group
    for name, command in getattr(group, "commands", {}).items():
        yield from commands(command, (*path, name))


ALL = dict(commands(ROOT))
PLAIN = {path: command for path, command in ALL.items() if not hasattr(command, "commands")}


def shown(*path: str) -> str:
    context = None
    for place in range(len(path) + 1):
        context = type(ROOT).context_class(
            ALL[path[:place]], parent=context, info_name=(path[:place] or ("rtsim",))[-1]
        )
    assert context is not None
    return str(context.get_help())


@pytest.fixture(autouse=True)
def eighty_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")


def test_examples_stand_in_the_docstring() -> None:
    text = "Fly.\n\nA lot: of it.\n\nBegin with:\n    rtsim fly  # now\n    rtsim trim --bank-deg 3\n"
    examples = (Example("rtsim fly", "now"), Example("rtsim trim --bank-deg 3", ""))
    assert help_text(text) == HelpText("Fly.\n\nA lot: of it.", "Begin with:", examples)
    assert help_text("Fly.\n\nExamples:\n    of flying").examples == ()


@pytest.mark.parametrize("path", ALL, ids=" ".join)
def test_help_fits_80_columns_and_ends_with_examples(path: tuple[str, ...]) -> None:
    told = shown(*path)
    assert max(map(len, told.splitlines())) <= 80
    assert re.search(r"\n(Examples|Begin with):\n  rtsim ", told)
    assert "…" not in told


@pytest.mark.parametrize("path", PLAIN, ids=" ".join)
def test_every_option_says_what_holds_without_it(path: tuple[str, ...]) -> None:
    command = PLAIN[path]
    context = type(ROOT).context_class(command)
    for parameter in command.params:
        if parameter.param_type_name == "option" and not parameter.required and not parameter.is_flag:
            name, text = parameter.get_help_record(context)
            assert "[default: " in text, name


def lines() -> list[str]:
    return [example.command for command in ALL.values() for example in help_text(command.help or "").examples]


@pytest.mark.parametrize("line", [line for line in lines() if "COMMAND" not in line])
def test_examples_are_understood(line: str) -> None:
    words = shlex.split(line)[1:]
    path: tuple[str, ...] = ()
    while (*path, *words[:1]) in ALL and words:
        path, words = (*path, words[0]), words[1:]
    assert path in PLAIN
    PLAIN[path].make_context(path[-1], words)  # a word that is not understood raises


def test_a_wrong_example_would_be_noticed() -> None:
    with pytest.raises(Exception, match="No such option"):
        PLAIN["trim",].make_context("trim", ["--air-speed", "3"])


def test_the_help_of_a_search_tells_its_defaults() -> None:
    spec = SearchSpec()
    told = " ".join(shown("optimize").split())
    for option, default in (
        ("objective", spec.objectives[0]),
        ("generations", spec.search.generations),
        ("population", spec.search.population),
        ("seed", spec.search.seed),
        ("method", spec.search.method),
        ("handling", spec.search.handling),
        ("points", spec.points),
        ("nacelle-rate-deg-s", f"{spec.nacelle_rate_deg_s:g}"),
        ("robust", spec.robust.flights),
    ):
        section = told.partition(f" --{option} <")[2][:200]
        assert f"[default: the specification's, else {default}]" in section


def test_the_options_of_a_flight_stand_in_groups() -> None:
    headings = re.findall(r"^(\w.*):$", shown("fly"), re.MULTILINE)
    assert headings == [
        "Arguments",
        "Who flies what",
        "Start",
        "Air",
        "Loop",
        "Outputs",
        "MAVLink",
        "Help",
        "Examples",
    ]


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("rtsim fly conversion_t", ["conversion_turn"]),
        ("rtsim fl", ["fly", "flightgear"]),
        ("rtsim campaign mis", ["misuse"]),
        ("rtsim fly --protection gov", ["governor"]),
        ("rtsim fly --plant lpv-", ["lpv-plain"]),
        ("rtsim test hover_", ["hover_turn"]),
    ],
)
def test_the_shell_completes(
    typed: str, offered: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("_RTSIM_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", typed)
    monkeypatch.setenv("COMP_CWORD", str(len(typed.split()) - 1))
    assert cli.run([]) == 0
    assert sorted(capsys.readouterr().out.split()) == sorted(offered)


@pytest.mark.parametrize(
    ("word", "sentence"),
    [
        ("optimise", "No such command 'optimise'. Did you mean 'optimize'? Try 'rtsim --help'."),
        ("hover", "No such command 'hover'. It is a scenario: rtsim fly hover. Try 'rtsim --help'."),
    ],
)
def test_a_mistaken_command_is_answered_with_what_may_be_meant(
    word: str, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.run([word]) == 2
    assert capsys.readouterr().err == f"rtsim: error: {sentence}\n"
