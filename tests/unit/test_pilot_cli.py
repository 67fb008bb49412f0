"""``rtsim pilot design``: what it prints and how it ends."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rtsim.cli.main import run

CASES = Path(__file__).parents[1] / "data" / "mocm_cases.toml"


def last_json(capsys: pytest.CaptureFixture[str]) -> dict[str, object]:
    out = capsys.readouterr().out
    return dict(json.loads(out.strip().splitlines()[-1]))


def test_one_case_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    import tomllib

    assert run(["pilot", "design", str(CASES), "--case", "ks2", "--json"]) == 0
    answer = last_json(capsys)
    expected = tomllib.loads(CASES.read_text())["case"]["ks2"]["expect"]
    assert set(expected) <= set(answer)
    assert answer["w_c"] == pytest.approx(expected["w_c"], rel=1e-6)


def test_whole_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["pilot", "design", str(CASES), "--json"]) == 0
    answer = last_json(capsys)
    assert answer["held"] is True
    assert len(answer["cases"]) == 7  # type: ignore[arg-type]
    assert answer["rejects"]["hopeless_plant"]["code"] == "E_REMNANT_DIVERGES"  # type: ignore[index]


def test_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["pilot", "design", str(CASES)]) == 0
    out = capsys.readouterr().out
    assert "phase margin [deg]" in out
    assert "refused: E_TAU_N_UNREACHABLE" in out
    assert "NOT HELD" not in out


def test_refusal(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["pilot", "design", str(CASES), "--case", "negative_delay", "--json"]) == 2
    captured = capsys.readouterr()
    assert json.loads(captured.out.strip())["code"] == "E_TAU"
    assert captured.err.startswith("rtsim: error: ")
    assert "reject.negative_delay.input.tau" in captured.err


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "is empty"),
        ("# nothing", "holds no design problem"),
        ("case = 3", "is not a table"),
        ("[case.a]", "has no input"),
        ("[case.a.input]\nA = [[1.0]", "is not valid TOML"),
        ("[case.a.input]\nnonsense = 1", "is not a field"),
        ("[tolerance]\ng = 'much'\n[case.a.input]\nA = [[1.0]]", "is not a tolerance"),
    ],
)
def test_broken_files(tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, sentence: str) -> None:
    file = tmp_path / "broken.toml"
    file.write_text(text)
    assert run(["pilot", "design", str(file)]) == 2
    err = capsys.readouterr().err
    assert sentence in err
    assert "broken.toml" in err
    assert "Traceback" not in err


def test_missing_file_and_case(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["pilot", "design", "not/there.toml"]) == 2
    assert "not/there.toml" in capsys.readouterr().err
    assert run(["pilot", "design", str(CASES), "--case", "nobody"]) == 2
    assert "ks2_half" in capsys.readouterr().err


SMALL = """
[case.small.input]
A = [[-2.0, 0], [1, 0]]
B = [[0], [1.0]]
C = [[0, 1.0], [1, 0]]
D = [[0], [1.0]]
E = [[1.0], [0]]
W = [[8.8]]
q_y = [1, 0]
tau = 0.15
tau_n = [0.08]
[case.small.expect]
rms_y = [0.342633851, {rate}]
"""


@pytest.mark.parametrize(("rate", "code"), [("1.76040047", 0), ("1.8", 1)])
def test_an_expectation_that_fails_is_exit_1(tmp_path: Path, rate: str, code: int) -> None:
    file = tmp_path / "small.toml"
    file.write_text(SMALL.format(rate=rate))
    assert run(["pilot", "design", str(file)]) == code


def test_a_case_that_is_refused_is_exit_2_and_a_wrong_code_exit_1(tmp_path: Path) -> None:
    file = tmp_path / "small.toml"
    file.write_text(SMALL.format(rate="1.76040047").replace("tau = 0.15", "tau = -0.15"))
    assert run(["pilot", "design", str(file)]) == 2
    file.write_text(
        "[reject.a]\ncode = 'E_DIM'\n[reject.a.input]\nA = [[nan]]\nB = [[1.0]]\nC = [[1.0]]\nE = [[1.0]]\nq_y = [1]\n"
    )
    assert run(["pilot", "design", str(file)]) == 1


def test_one_problem_at_the_top_level(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "mine.toml"
    body = SMALL.format(rate="1.76040047").split("[case.small.expect]")[0].replace("[case.small.input]", "")
    file.write_text(body)
    assert run(["pilot", "design", str(file), "--case", "mine", "--json"]) == 0
    assert last_json(capsys)["rms_y"] == pytest.approx([0.342633851, 1.76040047], rel=1e-6)
