"""Rows of `PROFILES`: each bound against the velocity itself, and that nobody else knows a profile by name."""

import ast
from pathlib import Path

import numpy as np
import pytest

from otwarp.kernels.bodies.flow import FLOW_TERMS
from otwarp.scene import Flow, vocabulary
from otwarp.scene.flow_grid import FlowGrid
from otwarp.scene.flow_profile import PROFILES, X, Y, Z, flow_velocity, kinds_with
from tests.reference.rotations import exponential, matrix

PACKAGE = Path(__file__).resolve().parents[2] / "otwarp"

STEP = 1e-5
"""Of difference quotients [µm]: they round to 1e-10 of the velocity over the step."""

CUT = 2e-4
"""What 200 terms of the series of a rectangular channel leave at its walls, relative to the largest velocity."""

AXES = (X, Y, Z)


def swirl() -> FlowGrid:
    """u = (z, 0, −x) on nodes that hold the flow's frame up to ±5 µm."""
    x, y, z = np.meshgrid(*[np.linspace(-5.0, 5.0, 11)] * 3, indexing="ij")
    return FlowGrid(low=(-5.0, -5.0, -5.0), spacing=(1.0, 1.0, 1.0), velocity=np.stack([z, 0.0 * y, -x], axis=3))


def flow(kind: str) -> Flow:
    """One of each kind, in its own frame."""
    field = swirl() if PROFILES[kind].strength is None else None
    return Flow(prim="/F", kind=kind, speed=7.0, shear_rate=-3.0, half_height=4.0, half_width=2.5, field=field)


def points(n: int = 2000) -> np.ndarray:
    return np.random.default_rng(3).uniform(-2.4, 2.4, (n, 3)) * [1.0, 1.0, 1.6]


def strength(kind: str) -> float:
    return abs(getattr(flow(kind), PROFILES[kind].strength or "", 0.0))


def test_the_step_the_vocabulary_and_the_host_know_the_same_profiles():
    (kind,) = (row for row in vocabulary.FLOW.attributes if row.field == "kind")
    assert set(kind.allowed) == set(FLOW_TERMS) == set(PROFILES)
    assert kinds_with(strength="speed") == ("uniform", "poiseuille", "rectangular")
    assert kinds_with(length="half_width") == ("rectangular",)


@pytest.mark.parametrize("kind", PROFILES)
def test_bounds_hold_and_are_reached(kind: str):
    row, at = PROFILES[kind], points()
    speed = np.linalg.norm(row.velocity(flow(kind), at), axis=1).max()
    bound = row.fastest(flow(kind), strength(kind), np.abs(at).max(axis=0))
    assert 0.6 * bound < speed <= bound * (1.0 + 1e-12)
    slopes = [row.velocity(flow(kind), at + STEP * e) - row.velocity(flow(kind), at - STEP * e) for e in np.eye(3)]
    steepest = np.abs(np.array(slopes) / (2.0 * STEP)).max()
    # a swirl turns twice as fast as each of its slopes
    assert 0.4 * row.gradient(flow(kind), strength(kind)) <= steepest + 1e-9
    assert steepest <= row.gradient(flow(kind), strength(kind)) * (1.0 + CUT) + 1e-9


@pytest.mark.parametrize("kind", [k for k, row in PROFILES.items() if row.still is not None])
def test_it_stands_still_where_it_says_and_varies_along_what_it_says(kind: str):
    row, at = PROFILES[kind], points()
    assert row.still is not None
    for axis, half in row.still(flow(kind)):
        for side in (-half, half):
            there = np.where(np.arange(3) == axis, side, at)
            assert np.abs(row.velocity(flow(kind), there)).max() <= CUT * 7.0
    still = np.where(np.isin(np.arange(3), row.across), at, 0.0)
    np.testing.assert_array_equal(row.velocity(flow(kind), at), row.velocity(flow(kind), still))
    for axis in row.across:
        moved = at + 0.3 * np.eye(3)[axis]
        assert np.abs(row.velocity(flow(kind), moved) - row.velocity(flow(kind), at)).max() > 0.1


def test_velocities_turn_with_the_prim():
    turn, origin = exponential(np.array([0.3, 0.8, -0.5])), np.array([1.0, -2.0, 0.5])
    turned = Flow(prim="/F", kind="shear", shear_rate=2.0, orientation=tuple(turn), origin=tuple(origin))
    there = points(20) @ matrix(turn).T + origin
    expected = 2.0 * points(20)[:, 2:] * matrix(turn)[:, 0]
    np.testing.assert_allclose(flow_velocity(turned, there), expected, atol=1e-12)


def test_no_other_file_knows_a_profile_by_name():
    """A new one would be forgotten there, silently: benchmarks of single terms and tables of names apart."""
    own = {"scene/flow_profile.py", "scene/vocabulary/medium.py", "kernels/bodies/flow.py", "bench/terms/scenes.py"}
    names = set(PROFILES) - {"uniform", "grid"}  # which are also names of a noise and of a driver
    for path in sorted(PACKAGE.rglob("*.py")):
        place = path.relative_to(PACKAGE).as_posix()
        text = path.read_text("utf-8")
        if place not in own and any(name in text for name in names):
            said = {n.value for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Constant)}
            # a microscope shears images
            mine = names - {"shear"} if place.startswith(("vision/", "scene/vocabulary/task")) else names
            assert not mine & {s for s in said if isinstance(s, str)}, path
