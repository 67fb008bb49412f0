"""The programs of ``examples`` run, from anywhere, and find what they say."""

from __future__ import annotations

import json
import re
import runpy
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from rtsim.cli.main import run

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
FINDS = {
    "own_pilot": [r"flown to its end at 15\.0 s: height within 0\.\d m, bank within [12]\.\d deg"],
    "own_nacelle_law": [
        r"programme +worst margin 2\d\.\d kn",
        r"MiddleOfTheRoad +worst margin 3\d\.\d kn.*nacelles end at 0\.0 deg",
    ],
    "own_protection_law": [r"off: failed, 3\d\.\d kn", r"StopTheNacelles: passed, 0\.0 kn"],
    "campaign_from_python": [r"full +0 of 10", r"off +10 of 10", r"none deeper than 5 kn: held"],
    "reading_a_log": [r"conversion_turn: \d{5} rows", r"in the turn: 4\d\.\d s, flapping 4\.\d+ deg"],
    "turn": [r"turned to 1[78]\d deg, bank 2\d\.\d deg", r"drawn in turn\.png"],
    "linear_analysis": [r"longitudinal: 17 states", r"lateral: 18 states", r"drawn in linear_analysis\.png"],
}
"""What each program prints, as regular expressions."""


def test_all_are_tested_and_listed() -> None:
    listed = re.findall(r"\]\(([^)]+)\)", (EXAMPLES / "README.md").read_text(encoding="utf-8"))
    assert {path.stem for path in EXAMPLES.glob("*.py")} == set(FINDS)
    assert {path.name for path in EXAMPLES.iterdir() if path.suffix in {".py", ".toml", ".ipynb"}} <= set(listed)
    assert all((EXAMPLES / link).exists() for link in listed)


@pytest.mark.parametrize("name", FINDS)
def test_it_runs_from_elsewhere(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(EXAMPLES), *sys.path])  # as Python does for a script
    monkeypatch.setattr(sys, "argv", [str(EXAMPLES / f"{name}.py")])
    monkeypatch.delitem(sys.modules, name, raising=False)
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    said = capsys.readouterr().out
    for words in FINDS[name]:
        assert re.search(words, said), said
    for picture in re.findall(r"drawn in (\S+)", said):
        assert (tmp_path / picture).read_bytes().startswith(b"\x89PNG")


def test_a_program_runs_as_a_process_from_the_repository() -> None:
    command = [sys.executable, "examples/own_protection_law.py"]
    done = subprocess.run(command, cwd=EXAMPLES.parent, capture_output=True, text=True, timeout=300, check=True)
    assert "StopTheNacelles: passed" in done.stdout


@pytest.mark.parametrize(
    "words",
    [
        ["fly", "hover", "--pilot", "own_pilot:Hoverer", "--duration", "5"],
        ["fly", "typical_conversion", "--nacelle", "own_nacelle_law:MiddleOfTheRoad", "--duration", "5"],
        ["test", "own_protection_law.toml", "--protection", "own_protection_law:StopTheNacelles"],
    ],
)
def test_it_flies_by_name_in_its_folder(words: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(EXAMPLES)
    monkeypatch.setattr(sys, "path", list(sys.path))
    assert run([*words, *(["--headless", "--speed", "max"] if words[0] == "fly" else [])]) == 0


def test_the_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By Jupyter where it is installed, else its code cells one after the other."""
    notebook = json.loads((EXAMPLES / "first_flight.ipynb").read_text(encoding="utf-8"))
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in cells)
    monkeypatch.chdir(tmp_path)
    if find_spec("nbclient") and find_spec("ipykernel"):
        import nbclient
        import nbformat

        nbclient.NotebookClient(nbformat.reads(json.dumps(notebook), as_version=4), timeout=300).execute()
        return
    names: dict[str, object] = {}
    for number, cell in enumerate(cells):
        exec(compile("".join(cell["source"]), f"first_flight.ipynb: cell {number}", "exec"), names)
    assert "typical_conversion" in repr(names["flight"])
    names["plt"].close("all")  # type: ignore[attr-defined]
