"""``rtsim corridor``: keys, values, pictures and refusals."""

from __future__ import annotations

import json

import pytest

from rtsim.cli.main import run


def answer(capsys, *arguments):
    assert run(["corridor", *arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out.splitlines()[-1])


def test_boundaries_carry_points_and_sources(capsys):
    result = answer(capsys)
    low = result["boundaries"]["low"]
    assert dict(zip(low["nacelle_deg"], low["speed_kt"], strict=True))[59.3] == 58.0
    assert "TM X-62407" in low["source"]
    assert result["boundaries"]["downstop"] == {"nacelle_deg": 0.5, "high_kt": 260.0}
    centre = result["boundaries"]["centre"]
    assert dict(zip(centre["nacelle_deg"], centre["speed_kt"], strict=True))[0.0] == 135.5
    assert "inside" not in result


def test_margins_of_a_point(capsys):
    result = answer(capsys, "--airspeed-kt", "105", "--nacelle-deg", "50")
    wanted = {"low_kt": 66.7, "high_kt": 165.0, "margin_low_kt": 38.3, "margin_high_kt": 60.0, "inside": True}
    assert {key: result[key] for key in wanted} == wanted
    assert result["nacelle_forward_deg"] == 50.0  # 105 kn is above the stall speed at every angle
    assert result["nacelle_aft_deg"] == 45.0


def test_a_point_on_a_boundary_is_inside(capsys):
    result = answer(capsys, "--airspeed-kt", "5", "--nacelle-deg", "74")
    assert (str(result["margin_low_kt"]), result["inside"]) == ("0.0", True)
    assert str(answer(capsys, "--airspeed-kt", "60", "--nacelle-deg", "75")["low_kt"]) == "0.0"


def test_flight_corridor_is_narrower(capsys):
    point = ("--airspeed-kt", "60", "--nacelle-deg", "70.5")
    assert answer(capsys, *point)["inside"] is True
    flight = answer(capsys, *point, "--corridor", "flight")
    assert flight["inside"] is False
    assert flight["margin_low_kt"] == -12.0
    assert flight["nacelle_forward_deg"] < 0.0


def test_tables_for_people(capsys):
    assert run(["corridor"]) == 0
    assert "59" in capsys.readouterr().out
    assert run(["corridor", "--airspeed-kt", "40", "--nacelle-deg", "50"]) == 0
    assert "OUTSIDE" in capsys.readouterr().out


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_picture(tmp_path, suffix):
    target = tmp_path / f"corridor{suffix}"
    assert run(["corridor", "--plot", str(target), "--airspeed-kt", "60", "--nacelle-deg", "75"]) == 0
    assert target.stat().st_size > 5000
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--corridor", "wide"], 2, "design, flight"),
        (["--airspeed-kt", "60"], 2, "add --nacelle-deg"),
        (["--nacelle-deg", "60"], 2, "add --airspeed-kt"),
        (["--airspeed-kt", "60", "--nacelle-deg", "100"], 2, "0 to 95 deg"),
        (["--airspeed-kt", "nan", "--nacelle-deg", "60"], 2, "-100 to 400 kn"),
        (["--plot", "corridor.bmp"], 2, ".png, .svg, .pdf"),
        (["--plot", "/no/such/directory/corridor.png"], 4, "/no/such/directory/corridor.png: cannot be written"),
    ],
)
def test_refusals_say_what_is_allowed(capsys, arguments, code, words):
    assert run(["corridor", *arguments]) == code
    err = capsys.readouterr().err
    assert words in err
    assert err.count("\n") == 1


def test_a_chart_is_compared_with_what_the_aircraft_can_trim(capsys):
    """The design chart's low side lies beyond the plant's stall, so laws keep the flight line; that does not."""
    design = answer(capsys, "--consistency")["consistency"]
    assert {"low", "high"} == {item["side"] for item in design}
    assert max(item["depth_kt"] for item in design if item["side"] == "low") > 10.0
    flight = answer(capsys, "--corridor", "flight", "--consistency")["consistency"]
    assert {item["side"] for item in flight} == {"high"}
    assert "mast torque" in flight[0]["sentence"]
    assert run(["corridor", "--corridor", "flight", "--consistency"]) == 0
    assert "The chart's high-speed side lies up to" in capsys.readouterr().out


def test_the_corridor_of_the_aircraft_itself(capsys):
    result = answer(capsys, "--corridor", "model", "--consistency", "--airspeed-kt", "105", "--nacelle-deg", "50")
    assert result["corridor_name"] == "model"
    assert result["consistency"] == []
    assert 70.0 < result["low_kt"] < 92.5  # slower than the power-on stall line of TM 81244
    assert run(["corridor", "--corridor", "model", "--consistency"]) == 0
    assert "reach all of this corridor" in " ".join(capsys.readouterr().out.split())
