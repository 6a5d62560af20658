"""What becomes of a function that `otwarp.force` decorates: what is refused, its digest, and the names it may use."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import warp as wp

import otwarp as ot
from otwarp.errors import InputError
from otwarp.kernels.core.functions import function_from_text
from otwarp.scene import Medium
from otwarp.simulation.simulation import Simulation
from otwarp.simulation.user_forces import Force
from tests.simulation.forces import DRIVERS, ROUNDING, constant, quiet, spring
from tests.simulation.setups import sphere_body


def made(text: str, **units: str) -> Force:
    """A force of a function from text, as a user would type it."""
    return ot.force(**units)(function_from_text("f", text, {"ot": ot, "wp": wp}))


@pytest.mark.parametrize(
    ("text", "units", "words"),
    [
        ("def f(body, a: float):\n    return wp.vec3(a)\n", {"a": "pN"}, "first argument must be annotated"),
        ("def f(body: ot.ForceInput, a):\n    return wp.vec3(a)\n", {"a": "pN"}, "argument a is annotated as"),
        ("def f(body: ot.ForceInput, a: float):\n    return wp.vec3(a)\n", {}, "argument a has no unit"),
        ("def f(body: ot.ForceInput):\n    return wp.vec3(0.0)\n", {"b": "pN"}, "unit of 'b', which is no argument"),
        ("def f(body: ot.ForceInput, slope: float):\n    return wp.vec3(slope)\n", {}, "argument slope must be"),
        (
            "def f(body: ot.ForceInput, a: wp.vec3 = (1.0, 2.0)):\n    return a\n",
            {"a": "pN"},
            "has the default (1.0, 2.0); allowed: 3 finite numbers",
        ),
    ],
)
def test_what_is_no_force_is_refused(text: str, units: dict[str, str], words: str):
    with pytest.raises(InputError) as error:
        made(text, **units)
    assert words in str(error.value)


@pytest.mark.parametrize(
    ("forces", "parameters", "words"),
    [
        ([constant], {}, "force constant: parameter push has no value"),
        ([constant(push={"/World/x": (1, 0, 0)})], {}, "has a value for /World/x; allowed: bodies, /World/B0"),
        ([constant(push={"/World/B0": 1.0})], {}, "push of /World/B0 is 1.0; allowed: 3 numbers"),
        ([spring(stiffness=np.nan)], {}, "parameter spring_stiffness has the value nan"),
        ([spring(stiffness=1.0), spring(stiffness=2.0)], {}, "forces has spring twice"),
        ([constant.body_force.function], {}, "allowed: functions decorated with otwarp.force"),
        ([spring(stiffness=1.0)], {"spring_push": 1.0}, "parameter 'spring_push' is unknown"),
        ([spring(stiffness=[1.0, 2.0, 3.0])], {}, "spring_stiffness has shape (3,)"),
    ],
)
def test_bad_values_are_refused_before_anything_is_compiled(forces: list, parameters: dict, words: str, device: str):
    with pytest.raises(InputError) as error:
        Simulation(DRIVERS["solo"], device=device, forces=forces, parameters=parameters)
    assert words in str(error.value)


def test_an_unknown_parameter_of_a_force_is_refused():
    with pytest.raises(InputError, match="parameter 'pull' is unknown; allowed: push"):
        constant(pull=1.0)


HEADER = """
import otwarp as ot, warp as wp

@wp.func
def wave(time: float):
    return wp.sine(time)

@ot.force(a="pN")
def f(body: ot.ForceInput, a: float):
"""

BUGS = [
    ("return wp.vec3(a * b)", "f.py:9): Warp cannot compile it: Referencing undefined symbol: b"),
    ("return body.place * a", "f.py:9): Warp cannot compile it: `place` is not an attribute of 'body'"),
    ("return wp.vec3(wp.dot(a, a))", "f.py:9): Warp cannot compile it: Couldn't find function overload for 'dot'"),
    ("return wp.vec3(wave(a))", "f.py:5): Warp cannot compile it: Could not find function wp.sine"),
    ("return a", "f.py:7) returns float32; allowed: wp.vec3"),
    ("a = a + 1.0", "f.py:7) returns nothing; allowed: wp.vec3"),
    ("return ot.Wrench(wp.vec3(a), wp.vec3(a))", "f.py:7) returns Wrench; allowed: wp.vec3, or otwarp.Wrench where"),
    ("return wp.vec3(wp.sqrt(-a))", "on /World/B0 is [nan, nan, nan] pN"),
]
"""A line of a force's function, and what is said of it."""


@pytest.mark.parametrize(("line", "words"), BUGS, ids=[line for line, _ in BUGS])
@pytest.mark.parametrize("precision", ROUNDING)
def test_a_bug_is_told_in_one_line_with_its_place(line: str, words: str, precision: str, device: str, tmp_path: Path):
    file = tmp_path / "f.py"
    file.write_text(f"{HEADER.strip()}\n    {line}\n")
    force = runpy.run_path(str(file))["f"](a=1.0)
    with pytest.raises(InputError) as error:
        Simulation(DRIVERS["solo"], device=device, precision=precision, forces=[force])
    said = str(error.value)
    assert said.startswith("force f") and words in said and "\n" not in said


@pytest.mark.parametrize(
    ("load", "words"),
    [
        (lambda b: b, "load of force f cannot be had"),
        (lambda a: a + np.zeros(7), "load of force f cannot be had"),
        (lambda a: np.nan * a, "load of force f is nan; allowed: finite numbers"),
    ],
)
def test_a_bound_that_is_none_is_refused(load, words: str, device: str):
    @ot.force(a="pN", slope=0.0, load=load)
    def f(body: ot.ForceInput, a: float):
        return wp.vec3(a)

    with pytest.raises(InputError, match=words):
        Simulation(DRIVERS["solo"], device=device, forces=[f(a=1.0)])


SCRIPT = """
import otwarp as ot, warp as wp
AMPLITUDE = (1.5, 2.5)

def half(x):
    return 0.5 * x

@wp.func
def helper(x: float) -> float:
    return x * wp.static(half(AMPLITUDE[0]))

@ot.force(a="pN")
def push(body: ot.ForceInput, a: float):
    return wp.vec3(helper(a), 0.0, 0.0)

print(push.body_force.digest)
"""


@pytest.mark.thorough
def test_a_digest_is_the_same_in_every_process_and_changes_with_what_is_used(tmp_path):
    digests = []
    for name, text in (
        ("one", SCRIPT),
        ("same", SCRIPT),
        ("constant", SCRIPT.replace("(1.5,", "(1.6,")),
        ("function", SCRIPT.replace("0.5 * x", "0.4 * x")),
    ):
        file = tmp_path / f"{name}.py"
        file.write_text(text)
        done = subprocess.run([sys.executable, file], capture_output=True, text=True, check=True)
        digests.append(done.stdout.split()[-1])
    assert digests[0] == digests[1]
    assert len(set(digests)) == 3


stiffness, body = 1e6, Medium()
"""Globals with the names of a force's arguments, as a notebook has them; they mean nothing to it."""


@pytest.mark.thorough
@pytest.mark.parametrize("precision", ROUNDING)
def test_arguments_hide_globals_of_their_names_and_warp_may_have_another(precision: str, device: str):
    import warp as w

    @ot.force(stiffness="pN/µm")
    def pull(body: ot.ForceInput, stiffness: float):
        scale = 2.0
        scale = scale * stiffness
        return scale * body.radius * w.vec3(1.0, 0.0, 0.0)

    sim = Simulation(quiet(sphere_body("B")), device=device, precision=precision, forces=[pull(stiffness=0.5)])
    assert sim.readout.body_force.numpy()[0, 0, 0, 0] == pytest.approx(1.0, rel=ROUNDING[precision])
    assert sim.model.loads[0].force == pytest.approx(1.0)


def test_names_that_two_parameters_would_have_are_refused():
    def made_force(name: str, argument: str) -> Force:
        text = f"def {name}(body: ot.ForceInput, {argument}: float):\n    return wp.vec3({argument}, 0.0, 0.0)\n"
        return ot.force(**{argument: "pN"})(function_from_text(name, text, {"ot": ot, "wp": wp}))

    pairs = [[made_force("a", "b_c")(b_c=1.0), made_force("a_b", "c")(c=1.0)], [made_force("trap", "power")(power=1.0)]]
    for forces in pairs:
        with pytest.raises(InputError, match="as another parameter is"):
            Simulation(DRIVERS["solo"], device="cpu", forces=forces)
