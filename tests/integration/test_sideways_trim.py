"""``rtsim trim --database FILE`` in turns, sideslip and sideward flight: the LPV aircraft answers, and says its ends.

Tolerances against the nonlinear model, chosen before the comparison: pitch and bank 0.35 deg, twice the largest RMS
difference of bank or pitch between flights of the two (docs/six-degrees.md, section 5: 0.18 deg); hands 3 % of half
their travel, lever 0.02; power and torque 3 %.
"""

from __future__ import annotations

import dataclasses
import json
import re

import pytest

from rtsim.cli.main import run
from rtsim.lpv.files.netcdf import SHIPPED
from rtsim.lpv.files.storage import load_database, save_database

WITHIN = {
    "pitch_deg": 0.35,
    "bank_deg": 0.35,
    "sideslip_deg": 0.35,
    "stick_in": 0.03 * 4.8,
    "lateral_stick_in": 0.03 * 4.8,
    "pedal_in": 0.03 * 2.5,
    "lever_fraction": 0.02,
    "load_factor": 0.01,
}
WITHIN_SHARE = ("power_shp", "mast_torque_right_inlb", "mast_torque_left_inlb")
LATERAL = {
    "bank_deg", "sideslip_deg", "lateral_stick_in", "pedal_in", "aileron_deg", "rudder_deg",
    "differential_collective_deg", "differential_cyclic_deg",
}  # fmt: skip


def asked(capsys, *arguments, code=0):
    assert run(["trim", *map(str, arguments), "--json"]) == code
    captured = capsys.readouterr()
    return json.loads(captured.out.splitlines()[-1]) if captured.out else None, captured.err


def at(airspeed_kt, nacelle_deg, option, value):
    return "--airspeed-kt", airspeed_kt, "--nacelle-deg", nacelle_deg, option, value


@pytest.mark.parametrize(
    "where",
    [
        at(85, 72, "--bank-deg", 25),
        at(150, 0, "--sideslip-deg", 4),
        at(0, 90, "--lateral-kt", 18),
        at(-8, 90, "--lateral-kt", 12),
        at(122, 33, "--bank-deg", -30),
    ],
    ids=lambda where: "_".join(map(str, where[1::2])),
)
def test_lpv_and_nonlinear_trims_agree(capsys, where):
    lpv, _ = asked(capsys, *where, "--database", SHIPPED)
    nonlinear, _ = asked(capsys, *where)
    assert (lpv["source"], nonlinear["source"]) == ("database", "nonlinear")
    assert lpv["converged"]
    assert lpv.keys() == nonlinear.keys()
    for key, tolerance in WITHIN.items():
        assert lpv[key] == pytest.approx(nonlinear[key], abs=tolerance), key
    for key in WITHIN_SHARE:
        assert lpv[key] == pytest.approx(nonlinear[key], rel=0.03), key


def test_the_other_side_is_the_mirror_image(capsys):
    right, left = (asked(capsys, *at(80, 75, "--bank-deg", bank), "--database", SHIPPED)[0] for bank in (20, -20))
    for key in LATERAL:
        assert right[key] == pytest.approx(-left[key], abs=1e-6), key
    assert right["mast_torque_right_inlb"] == pytest.approx(left["mast_torque_left_inlb"], rel=1e-8)
    for key in ("pitch_deg", "stick_in", "lever_fraction", "power_shp", "load_factor"):
        assert right[key] == pytest.approx(left[key], rel=1e-7), key
    assert right["pedal_in"] > 0.05


@pytest.mark.parametrize(
    ("where", "words"),
    [
        (at(80, 75, "--bank-deg", 60), "it ends at 44.*load factor"),
        (at(0, 90, "--lateral-kt", 45), "it ends at 25.*sideslip"),
        (at(170, 0, "--sideslip-deg", 12), "it ends at 8.*sideslip"),
    ],
    ids=["bank", "sideward", "sideslip"],
)
def test_the_end_of_the_validity_is_told(capsys, where, words):
    result, said = asked(capsys, *where, "--database", SHIPPED, code=2)
    assert result["converged"] is False
    assert result["bank_deg"] is None
    assert re.search(words, said), said


def test_a_database_of_one_half_is_refused(capsys, tmp_path):
    file = tmp_path / "half.nc"
    database = load_database()
    save_database(dataclasses.replace(database, lateral=None, pilot={}), file)
    result, said = asked(capsys, *at(80, 75, "--bank-deg", 20), "--database", file, code=2)
    assert result is None
    assert "plane of symmetry only" in said
    solved, _ = asked(capsys, *at(80, 75, "--bank-deg", 20), "--database", file, "--nonlinear")
    assert solved["source"] == "nonlinear"
    assert solved["bank_deg"] == pytest.approx(20.0)
