"""What an index of packages would show and give."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def project() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_the_long_description_has_no_link_that_leads_nowhere(project: dict[str, Any]) -> None:
    hook = project["tool"]["hatch"]["metadata"]["hooks"]["fancy-pypi-readme"]
    text = "".join((ROOT / fragment["path"]).read_text(encoding="utf-8") for fragment in hook["fragments"])
    relative = re.compile(r"\]\((?!https?:|#)[^)]*\)|(?:src|href)=\"(?!https?:|#)")
    assert relative.search(text), "README has links within the repository"
    for substitution in hook["substitutions"]:
        text = re.sub(substitution["pattern"], substitution["replacement"], text)
    assert not relative.search(text)
    assert "docs/tutorial.md" in text or "The tutorial" in text, "their words stay"
    assert "```sh\npython3 -m venv" in text


def test_the_version_is_said_once_and_cited(project: dict[str, Any]) -> None:
    import rtsim

    assert "version" in project["project"]["dynamic"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(rf"^version: {re.escape(rtsim.__version__)}$", citation, re.MULTILINE)
    assert f"license: {project['project']['license']}" in citation


@pytest.mark.parametrize("package", ["rtsim", "telemetry", "scenarios"])
def test_every_package_of_the_wheel_is_typed(project: dict[str, Any], package: str) -> None:
    assert package in project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    assert (ROOT / package / "py.typed").is_file()
