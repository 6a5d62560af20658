"""Parameters given by the user: shapes they may have, values they may not."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.simulation.packing.parameters import PARAMETERS, expand, expand_all
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import bead_scene

W, T = 4, 3


@pytest.mark.parametrize(
    ("name", "values", "shape"),
    [
        ("medium_viscosity", 1e-3, (1,)),
        ("medium_viscosity", [1e-3], (1,)),
        ("medium_temperature", np.full(W, 300.0), (W,)),
        ("trap_power", 5.0, (1, T)),
        ("trap_power", [1.0, 2.0, 3.0], (1, T)),
        ("trap_power", np.ones((W, 1)), (W, T)),
        ("trap_power", np.ones((1, T)), (1, T)),
        ("trap_power", np.ones((W, T)), (W, T)),
        ("trap_position", [1.0, 2.0, 3.0], (1, T, 3)),
        ("trap_position", np.zeros((T, 3)), (1, T, 3)),
        ("trap_position", np.zeros((W, 1, 3)), (W, T, 3)),
        ("trap_cutoff", np.inf, (1, T)),
    ],
)
def test_shapes(name, values, shape):
    out = expand(name, values, worlds=W, traps=T)
    assert out.shape == shape
    assert out.dtype == np.float64
    np.testing.assert_array_equal(out, np.broadcast_to(np.asarray(values, dtype=float), shape))


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("medium_viscosity", np.ones(W + 1)),
        ("medium_viscosity", np.ones((W, 1))),
        ("trap_power", np.ones(W)),
        ("trap_power", np.ones((T, W))),
        ("trap_power", np.ones((W, T, 1))),
        ("trap_position", 1.0),
        ("trap_position", np.ones(2)),
        ("trap_position", np.ones((W, T))),
    ],
)
def test_wrong_shapes_name_the_right_ones(name, values):
    with pytest.raises(InputError) as error:
        expand(name, values, worlds=W, traps=T)
    text = str(error.value)
    assert "\n" not in text
    assert name in text
    assert str(np.shape(values)) in text
    assert "allowed: scalar" in text
    assert f"worlds = {W}" in text


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("medium_viscosity", 0.0, "> 0, finite Pa·s"),
        ("medium_viscosity", np.inf, "> 0, finite Pa·s"),
        ("medium_temperature", -1.0, "≥ 0, finite K"),
        ("flow_speed", np.nan, "finite µm/s"),
        ("flow_speed", -np.inf, "finite µm/s"),
        ("trap_power", np.inf, "≥ 0, finite mW"),
        ("trap_power", np.nan, "≥ 0, finite mW"),
        ("trap_speed_limit", 0.0, "> 0 µm/s"),
        ("trap_speed_limit", np.nan, "> 0 µm/s"),
        ("trap_cutoff", -np.inf, "> 0 µm"),
    ],
)
def test_values_out_of_range(name, value, allowed):
    with pytest.raises(InputError, match="allowed: ") as error:
        expand(name, value, worlds=W, traps=T)
    assert str(error.value) == f"parameter {name} has the value {value:g}; allowed: {allowed}"


def test_one_bad_value_among_good_ones_is_found():
    values = np.ones((W, T))
    values[2, 1] = -3.0
    with pytest.raises(InputError, match="has the value -3;"):
        expand("trap_power", values, worlds=W, traps=T)


def test_unknown_parameters_list_the_known_ones():
    with pytest.raises(InputError) as error:
        expand_all({"trap_pwoer": 1.0}, worlds=W, traps=T)
    assert "'trap_pwoer'" in str(error.value)
    assert all(name in str(error.value) for name in PARAMETERS)


def test_memory_is_that_of_what_is_swept(device):
    """A swept power costs one number per world; the other parameters stay single rows."""
    sims = [
        Simulation(bead_scene(), worlds=1000, device=device, parameters=p)
        for p in ({}, {"trap_power": np.linspace(1, 20, 1000)[:, None]})
    ]
    assert sims[1].memory() - sims[0].memory() == 999 * 4
    assert sims[1].model.data.traps.stiffness.shape == (1, 1)
