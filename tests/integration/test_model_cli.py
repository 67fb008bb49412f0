"""``rtsim model``, ``trim`` and ``linearize``: keys, values, files and refusals."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from rtsim.cli.main import run
from rtsim.lpv.database import GRIDDED
from rtsim.lpv.files.storage import load_database, save_database

TRIM_KEYS = {
    "airspeed_kt", "nacelle_deg", "flap_deg", "rotor_rpm", "pitch_deg", "stick_in", "elevator_deg", "cyclic_deg",
    "collective_75_deg", "lever_fraction", "thrust_per_rotor_lb", "power_shp", "engine_power_shp", "mast_torque_inlb",
    "flapping_deg", "converged", "inside_corridor",
}  # fmt: skip


def answer(capsys, *arguments, code=0):
    assert run([*arguments, "--json"]) == code
    return json.loads(capsys.readouterr().out.splitlines()[-1])


def at(airspeed, nacelle):
    return ("--airspeed-kt", str(airspeed), "--nacelle-deg", str(nacelle))


def test_trim_has_the_promised_keys(capsys):
    result = answer(capsys, "trim", *at(100, 75))
    assert set(result) >= TRIM_KEYS
    assert result["converged"] is True
    assert result["inside_corridor"] is True
    assert result["flap_deg"] == pytest.approx(40.0)
    assert result["rotor_rpm"] == pytest.approx(589.0)
    assert result["engine_power_shp"] == pytest.approx(result["power_shp"] / 0.93)
    # shaft power = both masts' torque x speed
    torque = 2.0 * result["mast_torque_inlb"] / 12.0
    assert result["power_shp"] == pytest.approx(torque * 589.0 * 2.0 * np.pi / 60.0 / 550.0, rel=1e-3)


def test_trim_of_database_and_nonlinear_model_agree(capsys):
    from_database = answer(capsys, "trim", *at(40, 85))
    solved = answer(capsys, "trim", *at(40, 85), "--nonlinear")
    assert (from_database["source"], solved["source"]) == ("database", "nonlinear")
    for key in TRIM_KEYS - {"converged", "inside_corridor"}:
        assert from_database[key] == pytest.approx(solved[key], rel=1e-4, abs=1e-4), key


@pytest.mark.parametrize(
    ("option", "value", "key", "sign"),
    [
        ("--weight-lb", "14000", "thrust_per_rotor_lb", 1),
        ("--altitude-m", "2000", "collective_75_deg", 1),
        ("--rotor-rpm", "560", "collective_75_deg", 1),
        ("--flap-deg", "0", "flap_deg", -1),
        ("--acceleration-kt-s", "2", "pitch_deg", -1),
    ],
)
def test_any_option_of_condition_solves_the_nonlinear_model(capsys, option, value, key, sign):
    base = answer(capsys, "trim", *at(60, 85))
    other = answer(capsys, "trim", *at(60, 85), option, value)
    assert other["source"] == "nonlinear"
    assert other["converged"] is True
    assert sign * (other[key] - base[key]) > 0.1


def test_no_trim_is_exit_two_with_a_sentence(capsys):
    assert run(["trim", *at(30, 10), "--json"]) == 2
    out, err = capsys.readouterr()
    result = json.loads(out.splitlines()[-1])
    assert result["converged"] is False
    assert result["pitch_deg"] is None
    assert "no level-flight trim at 30 kn at nacelle 10 deg" in err
    assert run(["linearize", *at(30, 10)]) == 2


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("trim", *at("nan", 10)), ["--airspeed-kt", "-100 to 400 kn"]),
        (("trim", *at(50, 120)), ["--nacelle-deg", "0 to 95 deg"]),
        (("trim", *at(300, 10)), ["airspeed: outside the database", "300 kn", "-20 to 260 kn"]),
        (("trim", *at(50, 80), "--weight-lb", "100"), ["--weight-lb", "5000 to 20000 lb"]),
        (("trim", *at(50, 80), "--database", "absent.nc"), ["absent.nc", "does not exist"]),
        (("linearize", *at(50, 80), "--closed-loop", "--nonlinear"), ["--closed-loop", "leave out"]),
        (("linearize", *at(50, 80), "--closed-loop", "--outer-loop", "lqg"), ["--outer-loop", "integrators, pi"]),
        (("linearize", *at(50, 80), "--outer-loop", "lqg"), ["--outer-loop", "integrators, pi", "choose one"]),
        (("model", "export", "out.txt"), ["out.txt", ".nc or .mat"]),
        (("model", "import", "absent.mat"), ["absent.mat", "does not exist"]),
        (("model", "info", "absent.nc"), ["absent.nc", "does not exist"]),
    ],
)
def test_bad_input_is_one_clear_sentence(capsys, arguments, words):
    assert run(list(arguments)) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.strip().splitlines()) == 1
    for word in words:
        assert word in err


def test_linearize_has_names_units_and_eigenvalues(capsys):
    result = answer(capsys, "linearize", *at(0, 90))
    A = np.array(result["A"])
    assert A.shape == (17, 17) == (len(result["states"]), len(result["units"]["states"]))
    assert np.array(result["B"]).shape == (17, len(result["inputs"]))
    assert np.array(result["C"]).shape == (len(result["outputs"]), 17)
    assert np.array(result["D"]).shape == (len(result["outputs"]), len(result["inputs"]))
    roots = [complex(root["re"], root["im"]) for root in result["eigenvalues"]]
    np.testing.assert_allclose(np.sort_complex(roots), np.sort_complex(np.linalg.eigvals(A)), atol=1e-6)
    for root, value in zip(result["eigenvalues"], roots, strict=True):
        assert root["wn_rad_s"] == pytest.approx(abs(value))
        assert root["zeta"] == pytest.approx(-value.real / abs(value) if value else 0.0)


def test_linearize_of_database_and_nonlinear_model_agree(capsys):
    mine = np.array(answer(capsys, "linearize", *at(60, 80))["A"])
    solved = np.array(answer(capsys, "linearize", *at(60, 80), "--nonlinear")["A"])
    np.testing.assert_allclose(mine, solved, rtol=1e-4, atol=1e-5 * np.abs(solved).max())


@pytest.mark.parametrize("airspeed", [170, 180])
def test_linearize_agrees_at_the_corners_of_the_flap_schedule(capsys, airspeed):
    """A difference across the corner would give half a slope that is flown nowhere."""
    mine = np.array(answer(capsys, "linearize", *at(airspeed, 0))["A"])
    solved = np.array(answer(capsys, "linearize", *at(airspeed, 0), "--nonlinear")["A"])
    np.testing.assert_allclose(mine, solved, rtol=1e-4, atol=1e-6 * np.abs(solved).max())


def test_a_trim_beyond_the_aircraft_says_so(capsys):
    assert run(["trim", *at(350, 15), "--nonlinear", "--json"]) == 0
    out, err = capsys.readouterr()
    result = json.loads(out.splitlines()[-1])
    assert result["converged"] is True
    assert result["lever_fraction"] > 1.0
    assert [text.split(" (")[0].rpartition(" ")[0] for text in result["beyond_limits"][:1]] == ["lever"]
    assert "beyond the aircraft: lever" in err
    assert answer(capsys, "trim", *at(100, 75))["beyond_limits"] == []


@pytest.mark.parametrize("outer_loop", ["integrators", "pi"])
def test_closed_loop_is_sampled_as_flown(capsys, outer_loop):
    result = answer(capsys, "linearize", *at(100, 75), "--closed-loop", "--outer-loop", outer_loop)
    assert result["dt_s"] == 0.004
    assert result["stable"] is True
    assert max(root["re"] for root in result["eigenvalues"]) == result["growth_rad_s"] < 0.0
    assert np.array(result["A"]).shape == (len(result["states"]),) * 2
    assert result["states"][:5] == ["u", "w", "q", "pitch", "altitude"]


def test_people_get_tables(capsys):
    assert run(["trim", *at(100, 75)]) == 0
    told = capsys.readouterr().out
    assert "cyclic flapping" in told
    assert "in lb" in told
    assert run(["linearize", *at(100, 75), "--closed-loop"]) == 0
    told = capsys.readouterr().out
    assert "The loop as flown is stable" in told
    assert "pitch [rad]" in told
    assert "and 42 of pilot and outer loops" in told
    assert run(["model", "info"]) == 0
    out = capsys.readouterr().out
    assert "neighbour check" in out
    assert "as built" in out


def test_info_describes_the_shipped_database(capsys):
    result = answer(capsys, "model", "info")
    assert result["content_hash"] == load_database().content_hash
    assert result["current"] is True
    assert result["neighbour_check"]["above"] == 0
    assert result["neighbour_check"]["largest"] <= 0.01
    assert {170.0, 180.0} <= set(result["airspeed_kt"])
    assert set(result["pilots"]) == {"integrators", "pi", "lateral"}
    assert len(result["states"]) == 17


@pytest.mark.parametrize("suffix", [".nc", ".mat"])
def test_export_and_import_keep_the_hash(capsys, tmp_path, suffix):
    exported = tmp_path / f"copy{suffix}"
    assert run(["model", "export", str(exported)]) == 0
    imported = answer(capsys, "model", "import", str(exported), "--out", str(tmp_path / "back.nc"))
    shipped = load_database()
    assert imported["content_hash"] == shipped.content_hash
    assert load_database(tmp_path / "back.nc").content_hash == shipped.content_hash
    trim = answer(capsys, "trim", *at(100, 75), "--database", str(exported))
    assert trim == answer(capsys, "trim", *at(100, 75))


def test_import_refuses_what_is_wrong_by_name(capsys, tmp_path):
    from scipy.io import loadmat, savemat

    save_database(load_database(), tmp_path / "own.mat")
    content = {key: value for key, value in loadmat(tmp_path / "own.mat").items() if not key.startswith("__")}
    content["A"] = content["A"][..., :-1]
    savemat(tmp_path / "own.mat", content, long_field_names=True)
    assert run(["model", "import", str(tmp_path / "own.mat")]) == 2
    err = capsys.readouterr().err
    for word in ("own.mat", "A:", "wrong shape"):
        assert word in err
    assert not (tmp_path / "own.rtsim.nc").exists()


def test_unwritable_target_is_exit_four(capsys, tmp_path):
    assert run(["model", "export", str(tmp_path / "absent" / "copy.nc")]) == 4
    assert "cannot be written: there is no folder" in capsys.readouterr().err


@pytest.mark.slow
def test_build_regenerates_the_shipped_database(capsys, tmp_path):
    """Same trims, derivatives and gains as shipped; rounding of another processor is allowed for."""
    result = answer(capsys, "model", "build", "--out", str(tmp_path / "new.nc"))
    new, shipped = load_database(tmp_path / "new.nc"), load_database()
    assert result["content_hash"] == new.content_hash
    np.testing.assert_array_equal(new.valid, shipped.valid)
    for name in set(GRIDDED) - {"valid"}:
        mine, theirs = getattr(new, name), getattr(shipped, name)
        size = np.abs(theirs).max(axis=(0, 1, 2))
        assert np.all(np.abs(mine - theirs) <= 1e-5 * np.maximum(size, 1e-6)), name
    assert set(new.pilot) == set(shipped.pilot)
    for design, pilot in shipped.pilot.items():
        for name, theirs in pilot.arrays.items():
            size = np.abs(theirs).max(axis=(0, 1))
            mine = new.pilot[design].arrays[name]
            assert np.all(np.abs(mine - theirs) <= 1e-3 * np.maximum(size, 1e-9)), (design, name)


@pytest.mark.slow
@pytest.mark.parametrize(("stop", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_build_stops_cleanly(tmp_path, stop, code):
    """Ctrl-C reaches the whole process group, SIGTERM the command alone; no file, traceback or process is left."""
    command = [sys.executable, "-m", "rtsim", "model", "build", "--out", str(tmp_path / "new.nc"), "--jobs", "2"]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, env=environment
    )
    time.sleep(6.0)
    assert process.poll() is None, "the build ended before it could be stopped"
    if stop == signal.SIGINT:
        os.killpg(process.pid, stop)
    else:
        process.send_signal(stop)
    out, err = process.communicate(timeout=60)
    assert process.returncode == code, err
    assert "Traceback" not in err
    assert out == ""
    assert list(tmp_path.iterdir()) == []
    deadline = time.monotonic() + 20.0
    while _group_lives(process.pid):
        assert time.monotonic() < deadline, "worker processes are left"
        time.sleep(0.1)


def _group_lives(group):
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def test_beside_the_edge_of_the_database_the_nonlinear_model_answers(capsys):
    """117 kn at 90 deg lies between grid points of which one has no trim; the nonlinear model ends at 118 kn."""
    assert run(["trim", "--airspeed-kt", "117", "--nacelle-deg", "90", "--json"]) == 0
    result = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert result["converged"] is True
    assert result["source"] == "nonlinear"
    assert run(["linearize", "--airspeed-kt", "117", "--nacelle-deg", "90", "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out.splitlines()[-1])["A"]) == 17
