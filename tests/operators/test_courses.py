"""Courses and the arm on the device, against closed forms."""

import numpy as np
import pytest
import scipy.linalg
import warp as wp

from otwarp.operators.kernels.arm import deviate
from otwarp.operators.kernels.courses import minimum_jerk, path_at
from otwarp.operators.people import arm_turn


@wp.kernel(module="unique", enable_backward=False)
def evaluate(
    x: wp.array(dtype=wp.float64), path: wp.array2d(dtype=wp.vec3d), turn: wp.vec4d, stiffness: wp.float64,
    force: wp.vec3d, steps: int, course: wp.array(dtype=wp.float64), way: wp.array(dtype=wp.vec3d),
    away: wp.array(dtype=wp.vec3d),
):  # fmt: skip
    """Courses and path at x [s]; the arm's deviation after each of some periods of a constant force."""
    i = wp.tid()
    course[i] = minimum_jerk(x[i])
    way[i] = path_at(path, 0, wp.float64(0.5), x[i])
    if i == 0:
        y, v = wp.vec3d(), wp.vec3d()
        for n in range(steps):
            y, v = deviate(turn, stiffness, force, y, v)
            away[n] = y


def evaluated(device, x, path, arm, force, steps):
    turn = arm_turn(*(np.array([value]) for value in arm), 1e-3)[0]
    outputs = [wp.zeros(len(x), dtype=wp.float64, device=device), wp.zeros(len(x), dtype=wp.vec3d, device=device)]
    outputs.append(wp.zeros(steps, dtype=wp.vec3d, device=device))
    inputs = [wp.array(x, dtype=wp.float64, device=device), wp.array(path[None], dtype=wp.vec3d, device=device)]
    inputs += [wp.vec4d(*turn), arm[2], wp.vec3d(*force), steps]
    wp.launch(evaluate, dim=len(x), inputs=inputs, outputs=outputs, device=device)
    return [out.numpy() for out in outputs]


X = np.linspace(-0.5, 2.0, 101)
PATH = np.array([[0.0, 1.0, 2.0], [4.0, 1.0, -2.0], [5.0, 0.0, 0.0]])
ARMS = {"as measured": (0.554, 6.45, 135.0), "overdamped": (0.5, 40.0, 100.0), "critical": (1.0, 20.0, 100.0)}


def test_a_submovement_is_that_of_minimum_jerk(device):
    """10x³ − 15x⁴ + 6x⁵ between 0 and 1, where its speed and acceleration vanish."""
    course, _, _ = evaluated(device, X, PATH, ARMS["as measured"], (0, 0, 0), 1)
    u = np.clip(X, 0.0, 1.0)
    np.testing.assert_allclose(course, 10 * u**3 - 15 * u**4 + 6 * u**5, atol=1e-15)
    inside = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    for derivative in (inside.deriv(1), inside.deriv(2)):
        assert derivative(0.0) == derivative(1.0) == 0.0


def test_a_path_is_linear_between_samples_and_held_outside(device):
    _, way, _ = evaluated(device, X, PATH, ARMS["as measured"], (0, 0, 0), 1)
    expected = np.stack([np.interp(X, [0.0, 0.5, 1.0], column) for column in PATH.T], axis=1)
    np.testing.assert_allclose(way, expected, atol=1e-12)


@pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS)
def test_the_arm_answers_a_step_of_force_as_its_equation_does(device, arm):
    """m ÿ + b ẏ + k y = F from rest: exact after every period."""
    mass, damping, stiffness = arm
    force = np.array([0.3, -1.0, 2.0])
    away = evaluated(device, X, PATH, arm, force, 1500)[2]
    matrix = np.array([[0.0, 1.0], [-stiffness / mass, -damping / mass]])
    expected = []
    for n in (1, 10, 100, 400, 1500):
        settled = (np.eye(2) - scipy.linalg.expm(matrix * n * 1e-3)) @ [1.0 / stiffness, 0.0]
        expected.append(settled[0] * force)
    np.testing.assert_allclose(away[[0, 9, 99, 399, 1499]], expected, rtol=1e-9, atol=1e-15)


def test_the_underdamped_step_is_the_textbooks(device):
    """y = F/k·(1 − e^{−at}(cos ωt + a/ω·sin ωt)) with a = b/2m, ω² = k/m − a²."""
    mass, damping, stiffness = ARMS["as measured"]
    away = evaluated(device, X, PATH, ARMS["as measured"], (1.0, 0.0, 0.0), 800)[2]
    t, a = np.arange(1, 801) * 1e-3, damping / (2 * mass)
    w = np.sqrt(stiffness / mass - a * a)
    expected = (1 - np.exp(-a * t) * (np.cos(w * t) + a / w * np.sin(w * t))) / stiffness
    np.testing.assert_allclose(away[:, 0], expected, rtol=1e-9, atol=1e-15)
