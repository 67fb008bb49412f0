"""The database: what it refuses, what it keeps, and that files give back the same bits."""

from __future__ import annotations

from dataclasses import replace

import netCDF4
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.io import loadmat, savemat

from rtsim.aircraft.variables import Variable
from rtsim.errors import InputError, OutputError
from rtsim.lpv.cells import fill_invalid, quantized, round_mantissa
from rtsim.lpv.database import GRIDDED, StoredArrays
from rtsim.lpv.files.storage import load_database, save_database

PILOT = StoredArrays(
    {"gain": np.linspace(0.0, 1.0, 24).reshape(2, 3, 4)}, {"delay": 0.15, "note": "made up", "order": 2}
)


@pytest.fixture(params=[".nc", ".mat"])
def suffix(request):
    return request.param


def test_file_gives_back_the_same_bits(toy_database, tmp_path, suffix):
    database = toy_database.with_pilot("test", PILOT)
    path = tmp_path / f"toy{suffix}"
    save_database(database, path)
    again = load_database(path)
    for name in (*GRIDDED, "layer_acceleration", "airspeed", "nacelle", "flap", "rotor_speed"):
        assert getattr(again, name).tobytes() == getattr(database, name).tobytes(), name
    assert (again.states, again.inputs, again.outputs) == (database.states, database.inputs, database.outputs)
    assert again.attributes == database.attributes
    assert again.content_hash == database.content_hash
    assert again.pilot["test"].attributes == PILOT.attributes
    np.testing.assert_array_equal(again.pilot["test"].arrays["gain"], PILOT.arrays["gain"])
    assert list(tmp_path.iterdir()) == [path]


def test_netcdf_describes_itself(toy_database, tmp_path):
    save_database(toy_database, tmp_path / "toy.nc")
    with netCDF4.Dataset(tmp_path / "toy.nc") as dataset:
        assert dataset.content_hash == toy_database.content_hash
        assert dataset.variables["A"].dimensions == ("layer", "airspeed", "nacelle", "state", "state_column")
        for name in (*GRIDDED, "airspeed", "nacelle", "layer_acceleration", "flap", "rotor_speed"):
            assert dataset.variables[name].long_name
            assert name == "valid" or dataset.variables[name].units
        # a cell without a trim is a missing value, not a number that looks real
        hole = tuple(np.argwhere(~toy_database.valid)[0])
        assert np.all(np.ma.getmaskarray(dataset.variables["A"][hole]))


def test_arrays_are_read_only_and_the_callers_stay_writable(toy_database):
    mine = toy_database.A.copy()
    database = replace(toy_database, A=mine)
    with pytest.raises(ValueError, match="read-only"):
        database.A[0, 0, 0] = 1.0
    mine[...] = 7.0
    assert not np.any(database.A == 7.0)


def test_hash_tells_every_kind_of_change(toy_database):
    changed = toy_database.x_ref.copy()
    changed[1, 0, 0, 0] = np.nextafter(changed[1, 0, 0, 0], 9.0)
    renamed = (replace(toy_database.states[0], name="power"), *toy_database.states[1:])
    variants = [
        toy_database,
        replace(toy_database, x_ref=changed),
        replace(toy_database, states=renamed),
        replace(toy_database, rotor_speed=toy_database.rotor_speed + 1.0),
        toy_database.with_pilot("test", PILOT),
        toy_database.with_pilot("other", PILOT),
    ]
    assert len({database.content_hash for database in variants}) == len(variants)
    assert replace(toy_database, attributes={"title": "another"}).content_hash == toy_database.content_hash


def _without(array, index):
    return np.delete(array, index, axis=-1)


def _with_nan(array):
    copy = array.copy()
    copy[1, 3, 4] = np.nan
    return copy


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: {"A": _without(d.A, 0)}, ["A:", "wrong shape", "(3, 14, 10, 8, 7)", "(3, 14, 10, 8, 8)"]),
        (lambda d: {"B": _with_nan(d.B)}, ["B[1, 3, 4, 0, 0]", "not a finite number", "mark the cell invalid"]),
        (lambda d: {"airspeed": d.airspeed[::-1]}, ["airspeed[1]", "does not ascend"]),
        (lambda d: {"nacelle": np.where(d.nacelle > 1.0, np.nan, d.nacelle)}, ["nacelle", "not a finite number"]),
        (lambda d: {"airspeed": d.airspeed[:1]}, ["airspeed", "not an axis"]),
        (lambda _d: {"layer_acceleration": np.array([-1.0, 1.0, 2.0])}, ["no layer of level flight"]),
        (lambda d: {"valid": np.zeros_like(d.valid)}, ["valid", "no cell of the level layer"]),
        (lambda d: {"states": (*d.states[:-1], d.states[0])}, ["states", "same name twice", "collective"]),
        (lambda d: {"states": (*d.states[:2], Variable("x", "", "", "rigid"), *d.states[3:])}, ["'u' is missing"]),
        (lambda d: {"rotor_speed": d.rotor_speed * np.nan}, ["rotor_speed", "not a finite number"]),
    ],
)
def test_refusals_name_the_array_and_the_mend(toy_database, change, words):
    with pytest.raises(InputError) as caught:
        replace(toy_database, **change(toy_database))
    for word in words:
        assert word in str(caught.value)


def test_too_many_layers_are_refused(toy_database):
    layers = np.linspace(-4.0, 4.0, 9)
    arrays = {name: np.repeat(getattr(toy_database, name)[:1], 9, axis=0) for name in GRIDDED}
    with pytest.raises(InputError, match="too many layers"):
        replace(toy_database, layer_acceleration=layers, **arrays)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda data: data.renameVariable("B", "beta"), ["B", "missing"]),
        (lambda data: data.renameVariable("state_name", "names"), ["state_name", "missing"]),
        (lambda data: data.variables["airspeed"].__setitem__(0, 99.0), ["airspeed", "does not ascend"]),
        (lambda data: data.variables["A"].__setitem__((1, 9, 5, 0, 0), 3.0), ["content_hash", "do not match"]),
        (lambda data: data.variables["u_ref"].__setitem__((1, 9, 5, 0), np.nan), ["u_ref[1, 9, 5, 0]", "not a finite"]),
        (lambda data: data.variables["valid"].__setitem__((1, 9, 5), 3), ["valid", "neither 0 nor 1"]),
    ],
)
def test_spoilt_files_are_refused_by_name(toy_database, tmp_path, spoil, words):
    path = tmp_path / "toy.nc"
    save_database(toy_database, path)
    with netCDF4.Dataset(path, "a") as dataset:
        spoil(dataset)
    with pytest.raises(InputError) as caught:
        load_database(path)
    for word in (str(path), *words):
        assert word in str(caught.value)


@pytest.mark.parametrize("name", ["absent.nc", "absent.mat"])
def test_missing_file(tmp_path, name):
    with pytest.raises(InputError, match="does not exist; check the path"):
        load_database(tmp_path / name)


@pytest.mark.parametrize("name", ["noise.nc", "noise.mat"])
def test_file_of_another_kind(tmp_path, name):
    (tmp_path / name).write_bytes(b"this is no database, but long enough to have a header " * 20)
    with pytest.raises(InputError, match=r"is damaged, or no .* database"):
        load_database(tmp_path / name)


def test_failed_write_leaves_the_old_file(toy_database, tmp_path, suffix, monkeypatch):
    path = tmp_path / f"toy{suffix}"
    save_database(toy_database, path)
    before = path.read_bytes()

    def full_disk(*_args, **_options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("rtsim.lpv.files.netcdf._write", full_disk)
    monkeypatch.setattr("scipy.io.savemat", full_disk)
    with pytest.raises(OutputError, match="No space left"):
        save_database(toy_database, path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_unwritable_target(toy_database, tmp_path, suffix):
    with pytest.raises(OutputError, match="cannot be written"):
        save_database(toy_database, tmp_path / "absent" / f"toy{suffix}")


def test_a_database_of_ones_own_from_matlab(tmp_path):
    """Four states, one input, level flight only, vectors as MATLAB keeps them, optional arrays left out."""
    rng = np.random.default_rng(1)
    names = ["u", "w", "pitch", "q"]
    grid = (1, 3, 2)
    content = {
        "layer_acceleration": 0.0,
        "airspeed": np.array([[0.0], [10.0], [20.0]]),
        "nacelle": np.array([[0.0, 1.5]]),
        "x_ref": rng.normal(size=(*grid, 4)),
        "u_ref": rng.normal(size=(*grid, 1)),
        "y_ref": rng.normal(size=(*grid, 1)),
        "A": rng.normal(size=(*grid, 4, 4)),
        "B": rng.normal(size=(*grid, 4)),  # MATLAB drops the trailing dimension of length one
        "C": rng.normal(size=(*grid, 1, 4)),
        "D": rng.normal(size=grid),
    }
    content["x_ref"][..., :3] = 0.0  # u, w and pitch close with the axis
    content["x_ref"][..., 0] = content["airspeed"]
    units = ["m s^-1", "m/s", "radian", "rad/s"]
    for kind, texts, of in (("state", names, units), ("input", ["stick"], [""]), ("output", ["load_factor"], ["-"])):
        content[f"{kind}_name"] = np.array(texts, dtype=object)
        content[f"{kind}_unit"] = np.array(of, dtype=object)
    savemat(tmp_path / "own.mat", content)
    database = load_database(tmp_path / "own.mat")
    assert [variable.name for variable in database.states] == names
    assert database.B.shape == (*grid, 4, 1)
    np.testing.assert_array_equal(database.B[..., 0], content["B"])
    np.testing.assert_array_equal(database.D[..., 0, 0], content["D"])
    assert database.valid.all()
    assert not database.xdot_ref.any()
    save_database(database, tmp_path / "own.nc")
    assert load_database(tmp_path / "own.nc").content_hash == database.content_hash


def test_matlab_file_reads_as_a_matlab_user_expects(toy_database, tmp_path):
    save_database(toy_database, tmp_path / "toy.mat")
    content = loadmat(tmp_path / "toy.mat", squeeze_me=True)
    np.testing.assert_array_equal(content["A"], toy_database.A)
    assert list(content["state_name"]) == [variable.name for variable in toy_database.states]


def test_cells_are_filled_from_the_nearest_airspeed_of_the_same_nacelle():
    valid = np.array([[[0, 1], [1, 1], [0, 0], [0, 1]], [[0, 1], [0, 1], [0, 1], [0, 1]]], dtype=bool)
    values = np.arange(16.0).reshape(2, 4, 2)
    arrays = {"valid": valid, "x_ref": values.copy()}
    fill_invalid(arrays, np.array([0.0, 5.0, 10.0, 30.0]), level_layer=0)
    expected = values.copy()
    expected[0, :, 0] = values[0, 1, 0]  # one valid airspeed serves all
    expected[0, 2, 1] = values[0, 1, 1]  # 10 is nearer to 5 than to 30
    expected[1, :, 0] = values[0, 1, 0]  # a layer without any trim repeats the level layer
    np.testing.assert_array_equal(arrays["x_ref"], expected)
    with pytest.raises(InputError, match="no trim at any airspeed"):
        fill_invalid({"valid": np.zeros((1, 2, 1), bool), "x_ref": np.zeros((1, 2, 1))}, np.array([0.0, 1.0]), 0)


@given(
    hnp.arrays(
        np.float64, 20, elements=st.floats(-1e9, 1e9, allow_nan=False).filter(lambda v: v == 0 or abs(v) > 1e-9)
    ),
    st.integers(8, 40),
)
def test_rounding_keeps_the_digits_it_promises(array, bits):
    rounded = round_mantissa(array, bits)
    assert np.all(np.abs(rounded - array) <= np.abs(array) * 2.0 ** -(bits + 1))
    assert np.array_equal(round_mantissa(rounded, bits), rounded)


def test_quantizing_leaves_trims_alone(toy_database):
    again = quantized(toy_database)
    assert again.content_hash == toy_database.content_hash  # built databases are quantized already
    rough = replace(toy_database, A=toy_database.A * (1.0 + 1e-9), x_ref=toy_database.x_ref * (1.0 + 1e-12))
    assert quantized(rough).A.tobytes() == toy_database.A.tobytes()
    assert quantized(rough).x_ref.tobytes() == rough.x_ref.tobytes()
