"""Roles of variables: known names get theirs, others must say one, and nothing settles that is not known to settle."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rtsim.aids.design import design_aids
from rtsim.aircraft.profile import xv15_profile
from rtsim.aircraft.variables import INPUTS, OUTPUTS, ROLES, SCHEDULING_SPEED, STATES, Variable, of_role, with_roles
from rtsim.errors import InputError
from rtsim.lpv.files.storage import load_database, save_database
from rtsim.lpv.flown import flown_database
from rtsim.lpv.reduction import settled
from rtsim.pilot.design_plant import plant_layout
from rtsim.protection.limits import load_weights
from rtsim.protection.model import reduce_model


def with_state(database, variable):
    """The same aircraft with one more state, which acts on nothing and dies away."""

    def wider(name, axes):
        array = getattr(database, name)
        pads = [(0, 0)] * (array.ndim - len(axes)) + [(0, extra) for extra in axes]
        return np.pad(array, pads)

    arrays = {name: wider(name, (1,)) for name in ("x_ref", "xdot_ref", "df_dnacelle")}
    arrays |= {"A": wider("A", (1, 1)), "B": wider("B", (1, 0)), "C": wider("C", (0, 1))}
    arrays["A"][..., -1, -1] = -20.0
    return dataclasses.replace(database, states=(*database.states, variable), **arrays)


def test_every_variable_of_the_xv15_has_a_role():
    for kind, variables in (("state", STATES), ("input", INPUTS), ("output", OUTPUTS)):
        assert {variable.role for variable in variables} == set(ROLES[kind])


def test_known_names_get_their_roles_and_others_must_say_one(toy_database):
    bare = tuple(dataclasses.replace(variable, role="") for variable in STATES)
    assert with_roles("state", bare) == STATES
    for role, words in (("", "is not known and says no role"), ("wing", "has a role that does not exist")):
        with pytest.raises(InputError, match=f"'roll' {words}"):
            with_state(toy_database, Variable("roll", "rad", "Bank", role))


@pytest.mark.parametrize("suffix", [".nc", ".mat"])
def test_files_keep_roles(toy_database, tmp_path, suffix):
    save_database(toy_database, tmp_path / f"toy{suffix}")
    assert load_database(tmp_path / f"toy{suffix}").states == toy_database.states


@pytest.mark.parametrize(
    "reckon",
    [
        lambda d: reduce_model(d, load_weights()),
        design_aids,
        lambda d: plant_layout(d, integrators=True),
        flown_database,
    ],
    ids=["protection", "aids", "pilot", "closed loop"],
)
def test_a_rigid_state_that_nobody_knows_is_refused(reckon):
    rolling = with_state(load_database(), Variable("roll_rate", "rad/s", "Roll rate", "rigid"))
    with pytest.raises(InputError, match="roll_rate"):
        reckon(rolling)


def test_a_rotor_state_more_settles_and_changes_nothing_that_it_does_not_touch():
    database = load_database()
    more = with_state(database, Variable("lag", "rad", "Lag of the blades", "rotor"))
    for place, twin in zip(reduced(database), reduced(more), strict=True):
        np.testing.assert_allclose(twin, place, rtol=1e-9, atol=1e-9)
    assert len(of_role(more.states, "rotor")) == len(of_role(database.states, "rotor")) + 1


def reduced(database):
    model = settled(database, keep=("u", "w", "q", "pitch"), inputs=("stick", "lever"), purpose="a test")
    return model.a, model.b


def test_the_settled_models_are_those_of_patient_integration(toy_database):
    """The kept states' derivatives with the fast ones at rest, from the full matrices."""
    model = settled(toy_database, keep=("q", "u", "w", "pitch"), inputs=("stick",), purpose="a test")
    A, B = toy_database.A[toy_database.level_layer, 2, 1], toy_database.B[toy_database.level_layer, 2, 1]
    kept, fast, column = list(model.kept), list(model.fast), list(model.inputs)
    assert [toy_database.states[k].role for k in fast] == ["actuator", "rotor", "actuator"]
    x = np.zeros(len(A))
    x[kept] = [0.1, -0.2, 0.3, 0.05]
    push = A[np.ix_(fast, kept)] @ x[kept] + B[np.ix_(fast, column)] @ [0.7]
    x[fast] = np.linalg.solve(A[np.ix_(fast, fast)], -push)
    expected = (A @ x + B[:, column] @ [0.7])[kept]
    np.testing.assert_allclose(model.a[2, 1] @ x[kept] + model.b[2, 1] @ [0.7], expected, rtol=1e-9, atol=1e-12)


def test_the_scheduling_speed_stands_once_in_kernels_and_profile():
    assert xv15_profile().dimensions.number("scheduling_speed_m_s") == SCHEDULING_SPEED
