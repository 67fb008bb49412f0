"""Numbers that decode but cannot mean an aircraft are refused, with what to do about them."""

from __future__ import annotations

import netCDF4
import numpy as np
import pytest
from scipy.io import loadmat, savemat

from rtsim.errors import InputError
from rtsim.lpv.files.storage import load_database, save_database


def _scaled(name, factor):
    def spoil(data):
        data.variables[name][...] = factor * data.variables[name][...]

    return spoil


def _unit(name, unit):
    return lambda data: data.variables[name].__setattr__("units", unit)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (_scaled("nacelle", 180.0 / np.pi), r"nacelle\[\d+\]: is out of range .* give radians: 0 airplane"),
        (_unit("nacelle", "deg"), r"nacelle.units: is in another unit \(got 'deg'\); allowed: rad; convert it"),
        (_unit("airspeed", "kn"), r"airspeed.units: is in another unit \(got 'kn'\); allowed: m/s"),
        (_scaled("airspeed", 1.94), "has another airspeed than the axis .* give axis and states in m/s and rad"),
        (_scaled("layer_acceleration", 30.0), r"layer_acceleration\[0\]: is out of range .* give m/s\^2"),
        (_scaled("flap", 57.3), "flap.*is out of range .* give radians"),
        (_scaled("A", 1e15), r"A\[.*: is out of range .* correct it"),
        (
            lambda data: data.variables["state_unit"].__setitem__(2, "kn"),
            r"the state 'u' is in another unit \(got 'kn'\)",
        ),
        (lambda data: data.variables["airspeed"].__setitem__(1, np.nan), "airspeed: not a finite number on the axis"),
    ],
)
def test_other_units_and_noise_are_told(toy_database, tmp_path, spoil, words):
    path = tmp_path / "toy.nc"
    save_database(toy_database, path)
    with netCDF4.Dataset(path, "a") as dataset:
        dataset.delncattr("content_hash")
        spoil(dataset)
    with pytest.raises(InputError, match=rf"toy\.nc: .*{words}"):
        load_database(path)


@pytest.mark.parametrize("unit", ["m s-1", "m s^-1", "m/s", " m*s**-1 "])
def test_a_unit_may_be_spelled_in_several_ways(toy_database, tmp_path, unit):
    path = tmp_path / "toy.nc"
    save_database(toy_database, path)
    with netCDF4.Dataset(path, "a") as dataset:
        dataset.variables["airspeed"].units = unit
    assert load_database(path).content_hash == toy_database.content_hash


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("A", lambda array: array + 1e-3j, "A: holds complex numbers; give real numbers"),
        ("nacelle", lambda array: array * 1j, "nacelle: holds complex numbers"),
        ("rotor_speed", lambda _: np.array([60.0, 61.0]), "rotor_speed: wrong shape"),
        ("nacelle", lambda array: array[..., ::-1], r"nacelle\[1\]: the axis does not ascend"),
        ("x_ref", lambda _: "text", "x_ref: not an array of numbers"),
    ],
)
def test_arrays_of_matlab_files_are_real_and_whole(toy_database, tmp_path, name, value, words):
    path = tmp_path / "toy.mat"
    save_database(toy_database, path)
    content = {key: array for key, array in loadmat(path).items() if not key.startswith("__")}
    savemat(path, {**content, name: value(content[name])}, long_field_names=True)
    with pytest.raises(InputError, match=rf"toy\.mat: .*{words}"):
        load_database(path)


@pytest.mark.parametrize("content", [b"", b"hello\n", b"MATLAB 5.0 MAT-file" + b" " * 200, b"\0" * 200])
def test_what_is_no_matlab_file_at_all(tmp_path, content):
    (tmp_path / "a.mat").write_bytes(content)
    with pytest.raises(InputError, match=r"a\.mat: .*(is empty|is damaged, or no MATLAB database|is missing)"):
        load_database(tmp_path / "a.mat")
