"""The files around the code say what is true: links, commands, versions, packaged data."""

from __future__ import annotations

import re
import subprocess
import tomllib
from pathlib import Path

import pytest
import typer

import rtsim
from rtsim.cli.main import build_app

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    targets = [target.split("#")[0] for target in re.findall(r"\]\(([^)\s]+)\)", text)]
    local = [target for target in targets if target and not target.startswith(("http://", "https://", "mailto:"))]
    assert [target for target in local if not (page.parent / target).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_tables_fit_the_page(page):
    """A cell of more than 300 signs is text, not a table; a word of more than 60 makes its column too wide."""
    rows = [line for line in page.read_text(encoding="utf-8").splitlines() if line.startswith("|")]
    cells = [re.sub(r"\]\([^)]*\)", "]", cell) for row in rows for cell in re.split(r"(?<!\\)\|", row)]
    assert [cell for cell in cells if len(cell) > 300 or max(map(len, cell.split()), default=0) > 60] == []


def test_ci_finds_the_test_command_of_the_readme():
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    extraction = re.search(r'command="\$\((sed .*?)\)"', script).group(1)
    found = subprocess.run(["sh", "-c", extraction], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert found.count("\n") == 1
    assert found.startswith("python3 -m venv .venv && ")
    assert "pytest" in found


def commands():
    """Every command with the words that call it."""

    def walk(command, words):
        children = getattr(command, "commands", {})
        if not children:
            yield " ".join(words), command
        for name, child in children.items():
            yield from walk(child, [*words, name])

    return dict(walk(typer.main.get_command(build_app()), ["rtsim"]))


def test_every_command_and_option_is_documented():
    text = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    everywhere = text.split("\n## ")[1]
    missing = []
    for name, command in commands().items():
        words = name.split()
        heading = re.search(rf"^## .*`{' '.join(words[:2])}\b.*$", text, flags=re.MULTILINE)
        if heading is None or words[-1] not in heading.group(0):
            missing.append(name)
            continue
        section = text[heading.start() :].split("\n## ")[0] + everywhere
        options = [option for parameter in command.params for option in parameter.opts if option.startswith("--")]
        missing += [f"{name} {option}" for option in options if option not in re.findall(r"--[\w-]+", section)]
    assert missing == []


def test_versions_agree():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"version: {rtsim.__version__}" in citation
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## \[(.+?)\]", changelog, flags=re.MULTILINE)[0] in {"Unreleased", rtsim.__version__}


def test_every_dependency_has_its_reason():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    page = (ROOT / "docs" / "decisions" / "0002-dependencies.md").read_text(encoding="utf-8")
    names = [re.split(r"[<>=~!\[ ]", requirement)[0] for requirement in project["dependencies"]]
    assert [name for name in names if name not in page] == []


def test_packages_are_typed():
    for package in ("rtsim", "telemetry", "scenarios"):
        assert (ROOT / package / "py.typed").exists()
