"""What the commands print: JSON that any reader takes, and files that are whole or not there."""

from __future__ import annotations

import io
import json
import sys
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np
import pytest

from rtsim.cli.output import console, emit_json, progress, results, tell_bar, working
from rtsim.errors import OutputError
from rtsim.jsonable import to_jsonable
from rtsim.whole_file import whole_file


class Colour(Enum):
    RED = "red"


@dataclass(frozen=True)
class Point:
    x: float
    name: str


def test_numpy_nan_and_dataclasses_become_plain_json(capsys):
    emit_json(
        {
            "nan": float("nan"),
            "infinite": np.inf,
            "scalar": np.float64(1.5),
            "integer": np.int64(3),
            "truth": np.bool_(True),
            "matrix": np.array([[1.0, np.nan], [3.0, 4.0]]),
            "point": Point(2.0, "a"),
            "colour": Colour.RED,
            "path": Path("a/b"),
            "tuple": (1, None, "µ"),
            "eigenvalue": 1.0 + 2.0j,
        }
    )
    out, err = capsys.readouterr()
    assert err == ""
    assert out.count("\n") == 1
    assert json.loads(out) == {
        "nan": None,
        "infinite": None,
        "scalar": 1.5,
        "integer": 3,
        "truth": True,
        "matrix": [[1.0, None], [3.0, 4.0]],
        "point": {"x": 2.0, "name": "a"},
        "colour": "red",
        "path": "a/b",
        "tuple": [1, None, "µ"],
        "eigenvalue": {"re": 1.0, "im": 2.0},
    }


def test_what_has_no_json_form_is_named():
    with pytest.raises(TypeError, match="object"):
        to_jsonable(object())


def test_remarks_go_to_stderr_and_results_to_stdout(capsys):
    console.print("a remark")
    results.print("a result")
    with progress("Working", total=2.0) as advance:
        advance(1.0)
        advance(1.0)
    out, err = capsys.readouterr()
    assert out == "a result\n"
    assert "a remark" in err
    assert "Working" in err


def half_write(target, error):
    with whole_file(target) as temporary:
        temporary.write_text("half")
        raise error


def test_a_file_is_whole_or_not_there(tmp_path):
    target = tmp_path / "out.csv"
    target.write_text("old")
    with pytest.raises(KeyboardInterrupt):
        half_write(target, KeyboardInterrupt())
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]
    with whole_file(target) as temporary:
        assert temporary.suffix == ".csv"
        temporary.write_text("new")
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


def test_a_failed_write_names_the_target_and_leaves_nothing(tmp_path):
    with pytest.raises(OutputError, match=r"out\.csv: cannot be written: No space left"):
        half_write(tmp_path / "out.csv", OSError(28, "No space left on device"))
    assert list(tmp_path.iterdir()) == []


def test_a_unit_in_brackets_is_printed_and_not_taken_for_a_style(capsys):
    from rich.table import Table

    table = Table()
    table.add_column("airspeed [kn]")
    table.add_row("[red] 60")
    results.print(table)
    results.print("margin [kn]")
    told = capsys.readouterr().out
    assert "airspeed [kn]" in told
    assert "[red] 60" in told
    assert "margin [kn]" in told


class Terminal(io.StringIO):
    """A terminal that keeps what it is sent."""

    def isatty(self) -> bool:
        return True


def test_a_bar_shows_what_is_done_now_and_a_spinner_leaves_nothing_behind(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(sys, "stderr", Terminal())
    assert not tell_bar("compiling 1/2"), "no bar is up"
    with progress("Testing", total=2) as advance:
        assert tell_bar("compiling 1/2")
        advance(1, "Testing turn")
        assert tell_bar("compiling 2/2")
        advance(1)
    told = sys.stderr.getvalue()
    assert "compiling 2/2" not in told.splitlines()[-1]
    assert "Testing turn" in told
    assert not tell_bar("too late")
    monkeypatch.setattr(sys, "stderr", Terminal())
    with working("Solving") as done:
        done()
    assert "Solving" in sys.stderr.getvalue()
    assert sys.stderr.getvalue().endswith("\x1b[2K"), "its line is taken away"


def test_a_spinner_says_nothing_in_a_pipe(capsys):
    with working("Solving") as done:
        done()
    assert capsys.readouterr() == ("", "")
