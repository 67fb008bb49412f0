"""Every block of every page does what the page says; what cannot be done here is listed, with the reason.

A page is walked from top to bottom in an empty folder: files it names are written, Python and commands are run, and
what it shows of the screen is compared. A flight in real time is flown headless and fast.
"""

from __future__ import annotations

import re
import runpy
import shlex
import sys
import tomllib
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import typer

from rtsim.cli import check
from rtsim.cli.main import build_app, run
from rtsim.cli.options import with_values
from rtsim.cluster.access import TlsFile

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "examples").rglob("README.md"))]

ELSEWHERE = {
    r"python3? -m venv .*": "installs",
    r"python3\.X -m venv .*": "installs",
    r"(\S+/)?pip install .*": "installs",
    r"/tmp/(build|try)/.*": "makes and tries the wheel",
    r"\.venv/bin/(?!rtsim).*": "is what CI does",
    r"\.ci/run": "is what CI does",
    r"\.venv/bin/rtsim model build": "minutes",
    r"python -m tests\.regression\.histories .*": "minutes",
    r"python docs/figures/.*": "minutes",
    r"rtsim joystick.*": "needs sticks and a vehicle; test_joystick_command",
    r"rtsim fly manual_flight --pilot mavlink.*": "needs a ground station; test_hands_over_mavlink",
    r"sh \S+/start-flightgear\.sh": "needs FlightGear",
    r"rtsim flightgear --out .*": "writes to the home directory; test_flightgear_flight",
    r"rtsim fly .*--flightgear.*": "sends to a port that is not ours; test_flightgear_flight",
    r"dask .*": "is not ours",
    r"openssl .*": "is not ours",
    r"rtsim campaign .* --dask .*": "needs a cluster; test_cluster",
    r"rtsim campaign mine-campaign\.toml .*": "minutes; test_campaign_run",
    r"rtsim test tests/ .*": "a folder of the reader's",
    r"rtsim break .*": "minutes; test_break_command",
    r"rtsim optimize .*": "minutes; test_optimization_command",
    r"rtsim fly best_like_typical\.toml": "what a search leaves",
    r"rtsim reproduce .*": "minutes; test_reproduce_command",
    r"rtsim validate .*": "minutes; test_validation",
    r"rtsim timing": "measures the machine; tests/realtime",
    r"rtsim plot \w+\.parquet": "15 seconds; the tutorial draws",
    r"rtsim view .*": "20 seconds; test_view_command",
    r"rtsim fly --record flight\.rrd": "10 seconds; the tutorial records",
    r"rtsim fly --weight-lb .*": "builds a database for a minute; test_conditions",
    r".*\bOUT\b.*": "half a minute; test_second_aircraft",
}
"""Commands that the command's own parser reads and nobody runs here (patterns of whole lines), and why."""


class Block(NamedTuple):
    """A block between fences.

    Attributes:
        kind: The word after the fence.
        text: What stands inside, without the indentation of the fence.
        before: The words between the block before and this one.
    """

    kind: str
    text: str
    before: str


def blocks(page: Path) -> Iterator[Block]:
    """The blocks of a page, from top to bottom."""
    text, end = page.read_text(encoding="utf-8"), 0
    for found in re.finditer(r"^( *)```(\S*)\n(.*?)^\1```$", text, re.DOTALL | re.MULTILINE):
        yield Block(found[2], re.sub(rf"^{found[1]}", "", found[3], flags=re.MULTILINE), text[end : found.start()])
        end = found.end()


def prose(page: Path) -> str:
    """A page without its blocks."""
    return re.sub(r"^( *)```.*?^\1```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)


def command_lines(block: Block) -> list[str]:
    """The commands of a block, with what their comments say of exit codes."""
    if block.kind == "sh":
        return [line for line in block.text.splitlines() if line.strip()]
    return re.findall(r"^- run: (.*)$", block.text, re.MULTILINE) if block.kind == "yaml" else []


def bare(line: str) -> str:
    """A command without its comment."""
    return re.sub(r"\s+# .*", "", line)


def elsewhere(line: str) -> list[str]:
    """The patterns by which a command is not run here."""
    return [pattern for pattern in ELSEWHERE if re.fullmatch(pattern, bare(line))]


TREE: Any = typer.main.get_command(build_app())


def called(words: list[str]) -> tuple[Any, list[str], list[str]]:
    """The command that some words call, its name, and the words left."""
    command, name = TREE, []
    while words and words[0] in getattr(command, "commands", {}):
        command, name, words = command.commands[words[0]], [*name, words[0]], words[1:]
    return command, name, words


def read(line: str) -> None:
    """Let the parser read every call of rtsim in a line."""
    for part in bare(line).split(" && "):
        program, *words = shlex.split(part)
        if Path(program).name == "rtsim" and words != ["--version"]:
            command, name, rest = called(with_values(words))
            command.make_context(" ".join(name), list(rest))  # a word that is not understood raises
            names_are_known(name, rest)


def names_are_known(name: list[str], rest: list[str]) -> None:
    """What has no suffix and comes first after these commands is in the library."""
    if name in (["fly"], ["test"], ["campaign"], ["break"]) and rest and re.fullmatch(r"[a-z]\w+", rest[0]):
        assert check.file_problems(rest[0]) == []


def obey(line: str) -> None:
    """Run one command of a page; a comment says its exit code where it is not 0."""
    if elsewhere(line):
        read(line)
        return
    program, *words = shlex.split(bare(line))
    if program == "python":
        runpy.run_path(words[0], run_name="__main__")
    elif program == "rtsim":
        live = words[0] == "fly" and "--headless" not in words
        code = re.search(r"  # exit code (\d)", line)
        assert run([*words, *(["--headless", "--speed", "max"] if live else [])]) == int(code[1] if code else 0), line
    else:
        assert line == "mkdir my-flights && cd my-flights"


def whole(text: str) -> str:
    """A piece of a file with what it takes to be one: of a campaign, a profile, a scenario."""
    data = tomllib.loads(text)
    if any("upper_max" in item for item in data.get("expect", [])) and "classes" not in data:
        head = 'format = 1\nname = "x"\ntitle = "x"\nlaw = "full"\nruns = 3\n'
        return f'{head}{text}[[classes]]\nname = "a"\nstart = {{ airspeed_kt = 60, nacelle_deg = 75 }}\n'
    if "borrows" in data:
        profile = (ROOT / "examples/second_tiltrotor/two_thirds.profile.toml").read_text(encoding="utf-8")
        corridor = re.findall(r"^\[corridor.*?(?=^\[protection)", profile, re.MULTILINE | re.DOTALL)[0]
        return text.replace("[corridor]\n# ...", corridor)
    if check.kind_of(data, "x.toml") != "scenario" or "name" in data:
        return text
    length = "" if "programme" in data else "duration_s = 60\n"
    start = "" if "programme" in data else '[start]\ncondition = "cruise"\n'
    return f'format = 1\nname = "x"\ntitle = "x"\n{length}{text}{start}'


def squeezed(text: str) -> str:
    return " ".join(text.split())


def walk(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Do what a page says from top to bottom, in the present folder."""
    out, names = "", {}
    for block in blocks(page):
        named = re.search(r".*`([a-z_]+\.(?:toml|py))`", block.before.rstrip().rpartition("\n\n")[2], re.DOTALL)
        lines = command_lines(block)
        if block.kind == "text":
            shown = [line for line in block.text.splitlines() if line != "..."]
            assert [line for line in shown if squeezed(line) not in squeezed(out)] == [], out
        elif block.kind == "toml":
            file = Path(named[1] if named else "piece.profile.toml" if "borrows = " in block.text else "piece.toml")
            file.write_text(block.text if named else whole(block.text), encoding="utf-8")
            if file.name == "tls.toml":
                TlsFile.model_validate(tomllib.loads(block.text))  # what it names does not exist
            else:
                assert check.file_problems(str(file)) == []
        elif block.kind == "python" and named:
            Path(named[1]).write_text(block.text, encoding="utf-8")
        elif block.kind == "python":
            if "import pandas" not in block.text or find_spec("pandas"):
                exec(compile(block.text, page.name, "exec"), names)
        elif lines:
            capsys.readouterr()
            for line in lines:
                obey(line)
            captured = capsys.readouterr()
            out = captured.out + captured.err
        else:
            assert block.kind == "" or block.kind.startswith("{"), f"nobody runs this {block.kind}"
            assert not re.search(r"^\s*rtsim ", block.text, re.MULTILINE)


def marked(page: Path) -> Any:
    name = str(page.relative_to(ROOT))
    return pytest.param(page, id=name, marks=pytest.mark.slow if page.name == "tutorial.md" else ())


@pytest.mark.parametrize("page", [marked(page) for page in PAGES if any(block.kind for block in blocks(page))])
def test_a_page_is_true(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    for module in ("bank_keeper", "mylaws", "gentle"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    walk(page, capsys)
    if page.name == "tutorial.md":
        assert "<img alt='corridor path" in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_among_words_exist(page: Path) -> None:
    assert not re.search(r"^ {4,}(rtsim|python|pip) ", prose(page), re.MULTILINE), "a command belongs into a fence"
    for text in re.findall(r"`rtsim ([^`]*)`", prose(page)):
        words = [word for word in re.split(r"[\s|\[\]]+", text) if word]
        command, name, rest = called(words)
        assert name or re.match(r"--|[A-Z]", words[0]), text
        known = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
        asked = {word for word in rest if word.startswith("--")}
        assert asked <= known | {"--help", "--install-completion", "--show-completion"}, text
        names_are_known(name, rest)


def test_nothing_is_excused_that_stands_on_no_page() -> None:
    lines = [line for page in PAGES for block in blocks(page) for line in command_lines(block)]
    assert {pattern for line in lines for pattern in elsewhere(line)} == set(ELSEWHERE)
