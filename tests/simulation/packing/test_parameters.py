"""Parameters given by the user: shapes they may have, values they may not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from otwarp.errors import InputError, PlausibilityWarning
from otwarp.scene import Scene
from otwarp.scene.plausibility.ranges import unusual_parameters
from otwarp.simulation.model import Model
from otwarp.simulation.packing.parameters import PARAMETERS, SharedRows, expand, expand_all
from otwarp.simulation.simulation import Simulation
from tests.simulation.forces import spring
from tests.simulation.setups import bead_scene

W, T = 4, 3
HOLD = Path(__file__).parents[3] / "scenes" / "hold.usda"


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
        ("medium_viscosity", 0.0, "in (0, 1000] Pa·s"),
        ("medium_viscosity", np.inf, "in (0, 1000] Pa·s"),
        ("medium_viscosity", 2e3, "in (0, 1000] Pa·s"),
        ("medium_temperature", -1.0, "in [0, 1000] K"),
        ("medium_temperature", 1001.0, "in [0, 1000] K"),
        ("flow_speed", np.nan, "finite µm/s"),
        ("flow_speed", -np.inf, "finite µm/s"),
        ("trap_power", np.inf, "in [0, 10000] mW"),
        ("trap_power", np.nan, "in [0, 10000] mW"),
        ("trap_power", 10001.0, "in [0, 10000] mW"),
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


@pytest.mark.parametrize("far", [(0.0, 2e9, 0.0), (1e200, 0.0, 0.0)])
def test_places_too_far_away(far):
    with pytest.raises(InputError, match=r"parameter trap_position has a vector of length .*; allowed: ≤ 1e\+09 µm"):
        expand("trap_position", far, worlds=W, traps=T)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        (
            "medium_viscosity",
            0.89,
            "0.89 Pa·s, 1e+03 × that of water; usual: 0.0002 … 0.1 Pa·s; did you mean 0.89 mPa·s",
        ),
        ("medium_temperature", [298.0, 25.0], "25 K; usual: 250 … 400 K; did you mean 25 °C, which is 298.15 K?"),
        ("trap_power", 2e-5, "2e-05 mW; usual: 0.001 … 3000 mW; did you mean 0.02 mW? parameters are in mW, not in W"),
        ("trap_speed_limit", 3e-5, "3e-05 µm/s; usual: 0.01 … 10000 µm/s; did you mean 30 µm/s? parameters are in"),
        ("trap_cutoff", 2e4, "20000 µm; usual: 0.01 … 1000 µm"),
        ("flow_speed", -1e5, "100000 µm/s; usual: 0.001 … 10000 µm/s"),
    ],
)
def test_unusual_values_draw_a_warning(name, value, said):
    values = expand(name, value, worlds=2, traps=T)
    (text,) = unusual_parameters({name: values})
    assert text.startswith(f"parameter {name} = {said}")


def test_usual_values_and_what_stands_for_none_draw_no_warning():
    usual = {"trap_power": [0.0, 20.0], "trap_cutoff": np.inf, "medium_temperature": 0.0, "flow_speed": -30.0}
    arrays = {name: np.asarray(value, dtype=float) for name, value in usual.items()}
    assert list(unusual_parameters({**arrays, "trap_position": np.full(3, 1e8)})) == []


def test_a_model_says_what_is_odd_in_its_parameters(device):
    scene = bead_scene()
    with pytest.warns(PlausibilityWarning, match=r"/World: parameter trap_power = 5000 mW; usual: 0.001 … 3000 mW"):
        Model.build(scene, device=device, parameters={"trap_power": 5000.0})


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


@pytest.mark.thorough
def test_rows_that_worlds_share(tmp_path, device):
    """Three rows for six worlds are the bits of six rows, in a part of the worlds as well; no checkpoint keeps them."""
    rows = {
        "trap_power": np.array([[1.0], [2.0], [4.0]]),
        "trap_position": np.array([[[0.1, 0.0, 5.0]], [[0.0, 0.2, 5.0]], [[0.0, 0.0, 5.0]]]),
        "medium_viscosity": np.array([1e-3, 2e-3, 3e-3]),
        "flow_speed": np.array([0.0, 10.0, 20.0]),
        "spring_stiffness": np.array([[0.0], [1.0], [2.0]]),
    }
    which = np.array([2, 0, 0, 1, 2, 1], dtype=np.int32)
    how = {"worlds": 6, "seed": 3, "device": device, "forces": [spring(stiffness=0.0)], "time_step": 1e-5, "ends": []}

    def after(parameters, **more) -> Simulation:
        sim = Simulation(Scene.load(HOLD), parameters=parameters, **how, **more)
        sim.step(50)
        return sim

    own = after({name: values[which] for name, values in rows.items()}).state.position.numpy()
    assert len(np.unique(own[:, 0, 0])) == 6
    assert np.array_equal(after(SharedRows(rows, 3, which), part=(2, 5)).state.position.numpy(), own[2:5])
    shared = after(SharedRows(rows, 3, which))
    assert np.array_equal(shared.state.position.numpy(), own)
    with pytest.raises(InputError, match="the worlds share rows of parameters; allowed: "):
        shared.save(tmp_path / "sim.npz")


@pytest.mark.parametrize("given", [3, 0, "", [("trap_power", 1.0)], np.ones((3, 3))])
def test_parameters_without_names_are_refused_in_a_line(given):
    with pytest.raises(InputError, match=r"^parameters is [^\n]+; allowed: a dict of values by their names$"):
        Simulation(bead_scene(), device="cpu", parameters=given)


def test_worlds_without_a_row_are_refused():
    for which in (np.array([0, 1]), np.array([0, 1, 3]), np.array([0, -1, 2]), np.array([0.0, 1.0, 2.0])):
        with pytest.raises(InputError, match=r"allowed: \(3,\) whole numbers, 0 to 2"):
            SharedRows({}, 3, which).check(3)
