"""The kernel of the local model, launched by Warp: eq. 2 by hand. Its bits are tested by `tests/haptics/force`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core.precision import kernel_module
from otwarp.kernels.optics.local_force import FELT, machine_code
from otwarp.kernels.optics.traps import TRAP_TERMS
from otwarp.laws.local_rows import HAND, LAW, PULL, SPHERE

ROUNDING = {"float32": 2e-6, "float64": 1e-14}
"""Of some thirty operations, relative to the largest force."""


def row(names: tuple[str, ...], **values: float) -> list[float]:
    assert set(values) <= set(names)
    return [values.get(name, 0.0) for name in names]


@pytest.mark.parametrize("precision", ROUNDING)
def test_sums_over_traps_and_spheres(precision):
    """A spring and a split law of springs, turned; spheres glide half way and follow a part of the hand's way."""
    models, real = ("isotropic", "split"), np.dtype(precision).type
    curve = {"stiffness": 2.0, "threshold2": 9.0, "cutoff2": 9.0}
    axial = {f"axial_{name}": value for name, value in (curve | {"stiffness": 0.5}).items()}
    laws = [
        row(LAW, model=0, table=-1, axis_z=1.0, equilibrium=0.1, reach2=9.0, **curve),
        row(LAW, model=1, table=-1, axis_x=1.0, reach2=9.0, **curve, **axial),
    ]
    spheres = [row(SPHERE, x=0.2, target_x=0.4, share=0.5), row(SPHERE, y=0.3, target_y=0.3), row(SPHERE, x=9.0)]
    pulls = [row(PULL, power=20.0, law=0, first=0, end=1), row(PULL, z=0.1, power=5.0, law=1, first=1, end=3)]
    hand = row(HAND, carried_x=0.3, published_x=0.1, alpha=0.5)
    arrays = [wp.array(np.array(rows, real), device="cpu") for rows in (hand, pulls, spheres, laws)]
    empty = wp.zeros(8, dtype=wp.int32, device="cpu")
    counted = [(a.ptr, a.shape[0]) for a in arrays[1:]] + [(empty.ptr, 0)] * 2
    inputs = [arrays[0].ptr, *(number for pair in counted for number in pair), empty.ptr]
    kernel = kernel_module("optics.local_force", precision).local_force_kernel(models)
    wp.launch(kernel, 1, inputs, device="cpu", block_dim=1)

    first = np.array([0.3 + 0.5 * 0.2 - 0.3, 0.0, -0.1])
    second = np.array([-0.3, 0.3, -0.1])
    expected = -20.0 * 2.0 * first - 5.0 * np.array([0.5, 2.0, 2.0]) * second
    found = dict(zip(HAND, arrays[0].numpy().astype(float), strict=True))
    force = [found[f"force_{axis}"] for axis in "xyz"]
    np.testing.assert_allclose(force, expected, atol=ROUNDING[precision] * np.abs(expected).max())
    np.testing.assert_allclose(arrays[2].numpy()[:, :3], [[0.3, 0.0, 0.0], [0.0, 0.3, 0.0], [4.5, 0.0, 0.0]], rtol=1e-6)


def test_every_law_with_a_curve_or_a_table_can_be_felt():
    """Terms of the simulation that are left out: a spring is felt as eq. 1, and upright tables as any other."""
    names = {name.removeprefix("piecewise_") for name in TRAP_TERMS if not name.startswith("harmonic")}
    assert set(FELT) == {name for name in names if not name.endswith("_upright")}


def test_machine_code_says_where_it_is():
    code = machine_code(("isotropic", "split"))
    assert code["models"] == ("isotropic", "split")
    assert "warp-clang" in code["loader"] and code["symbol"].endswith("_cpu_forward")
    assert code["symbol"].encode() in Path(code["file"]).read_bytes()
    assert machine_code(("isotropic", "split")) == code
