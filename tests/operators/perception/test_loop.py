"""The loop with perception in it: without errors the plain one to the last bit, and whatever runs beside whatever."""

import numpy as np
import pytest

from otwarp.operators.perception.errors import Perception
from otwarp.operators.perception.loop import PerceivedLoop
from otwarp.operators.perception.sweep import Sweep
from otwarp.operators.study import kept
from tests.operators.work import study

BAD = Perception(
    delay=0.05, frame_rate=60.0, depth_error=0.2, lateral_error=0.1, tilt_error=5.0, correlation=0.05, lost=0.2
)


def run(asked, perceptions):
    """Trials of a study's operators, all conditions, with perceptions; the loop at its end."""
    operators = np.arange(asked.operators)
    loop = PerceivedLoop(
        asked.task, asked.persons(operators), perceptions, seed=asked.seed, device="cpu", time_step=asked.time_step,
    )  # fmt: skip
    while loop.running:
        loop.run(0.25)
    return loop


@pytest.fixture(scope="module")
def asked():
    """Three operators without haptics and with, for 0.4 s."""
    return study()


@pytest.mark.parametrize("eyes", ["microscope", "twin"])
def test_without_errors_it_is_the_plain_loop(asked, eyes):
    """Bit for bit, whatever the operators look at."""
    loop = run(asked, [Perception(eyes=eyes)] * 6)
    plain = asked.run_chunk(0, device="cpu")
    for name, row in kept(loop).items():
        np.testing.assert_array_equal(row, plain[name].ravel(), err_msg=name)
    found = loop.fidelity()
    assert np.all(np.isnan(found["force_rmse"][:3])) and np.all(found["force_rmse"][3:] > 0.0)


def test_a_picture_every_period_gives_the_perfect_force(asked):
    """To the last bit: perfect chains and those of the operators are given the same."""
    loop = run(asked, [Perception(frame_rate=1000.0)] * 6)
    assert np.all(loop.fidelity()["force_rmse"][3:] == 0.0)


def test_errors_are_felt():
    """By the same operator: each makes the force worse, and lateness without time stamps more than with."""
    each = [{}, {"delay": 0.1}, {"delay": 0.1, "stamped": False}, {"depth_error": 0.2}, {"lateral_error": 0.2},
            {"tilt_error": 10.0}, {"yaw_error": 10.0}, {"frame_rate": 50.0}, {"lost": 0.6}]  # fmt: skip
    asked = study(conditions=("with",), duration=1.5)
    rows = np.repeat(asked.persons(np.arange(1)), len(each))
    loop = PerceivedLoop(asked.task, rows, [Perception(**row) for row in each], seed=1, device="cpu")
    loop.run(1.5)
    worse = loop.fidelity()["force_rmse"]
    assert np.all(worse[1:] > worse[0])
    assert worse[2] > worse[1]
    angle = loop.fidelity()["direction_error"]
    assert np.all(angle[1:7] > angle[0])


def test_trials_do_not_depend_on_what_runs_beside_them():
    """All cells of two operators at once, and one trial after the other."""
    axes = {"delay": (0.0, 0.04), "depth_error": (0.0, 0.2)}
    make = {"study": study(operators=2, duration=0.2), "axes": axes, "base": BAD, "repeats": 0}
    whole = Sweep(**make, chunk=100)
    together = whole.run_chunk(0, device="cpu")
    alone = Sweep(**make, chunk=1)
    assert whole.count == alone.chunks == 2 * (2 + 4)
    for n in (1, 5, 10):
        for name, row in alone.run_chunk(n, device="cpu").items():
            np.testing.assert_array_equal(row, together[name][n : n + 1], err_msg=name)
