"""The compiled local model against the one in plain Python: the same bits, whatever is felt."""

from __future__ import annotations

import dataclasses
import json
import math
import pickle
import random
import signal
import subprocess
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.errors import InputError
from otwarp.haptics.chain.chain import make_chain
from otwarp.haptics.core import DeviceInfo, DeviceSample, SceneFrame, SphereFrame, TrapFrame, Vec3
from otwarp.haptics.core.config import ChainConfig, HandConfig, LowPass
from otwarp.haptics.force import LocalModel
from otwarp.haptics.force.compiled import CompiledLaw, CompiledModel, model_of, models_of, tried
from otwarp.haptics.force.law import IsotropicLaw, Law, SplitLaw, TableLaw
from otwarp.kernels.optics.local_force import FELT, machine_code
from otwarp.laws import TrapLaw
from otwarp.teleop.operators.servo import compile_laws
from tests.reference.tables import BEAMS, made_up_table

RADIAL = TrapLaw(stiffness=0.6, threshold=0.6, inverse_square=0.17, offset=-0.1122, cutoff=1.2, power=1.0)
INFO = DeviceInfo(name="test", kind="virtual", absolute=True, force=3.3, continuous_force=0.9)


def crossed(rng: random.Random) -> tuple[Vec3, Vec3]:
    """Two unit vectors at right angles."""
    a, b, c, d = (rng.gauss(0.0, 1.0) for _ in range(4))
    n = math.sqrt(a * a + b * b + c * c + d * d)
    a, b, c, d = a / n, b / n, c / n, d / n
    first = (1 - 2 * (c * c + d * d), 2 * (b * c + a * d), 2 * (b * d - a * c))
    return first, (2 * (b * c - a * d), 1 - 2 * (b * b + d * d), 2 * (c * d + a * b))


TABLES = tuple(
    TableLaw.of(made_up_table(beam, how, n), side=side, axis=axis)
    for how in ("bilinear", "bicubic")
    for n, beam in enumerate(BEAMS)
    for side, axis in (crossed(random.Random(n)),)
)


@pytest.fixture(scope="module")
def code() -> CompiledLaw:
    """All that can be felt, in one kernel."""
    return CompiledLaw(**machine_code(tuple(sorted(FELT))))


numbers = st.floats(-2.0, 2.0, allow_subnormal=False)
lengths = st.floats(0.0, 2.0, allow_subnormal=False)


@st.composite
def curves(draw) -> TrapLaw:
    threshold, cutoff = sorted((draw(lengths), draw(st.one_of(lengths, st.just(math.inf)))))
    constants = {"stiffness": draw(numbers), "inverse_square": draw(numbers), "offset": draw(numbers)}
    return TrapLaw(threshold=threshold, cutoff=cutoff, power=1.0, **constants)


@st.composite
def felt(draw) -> tuple[Law, ...]:
    """One authored law of each kind, turned and displaced, and two of the tables."""
    axes = [crossed(random.Random(draw(st.integers(0, 99))))[0] for _ in range(2)]
    one = IsotropicLaw(draw(curves()), axes[0], draw(numbers))
    two = SplitLaw(draw(curves()), draw(curves()), axes[1], draw(numbers))
    return (one, two, *draw(st.permutations(TABLES))[:2])


def alike(one: Vec3, other: Vec3) -> bool:
    """Whether two forces are the same; no number where a law has none, as 1/r² has at r = 0."""
    return all(a == b or (math.isnan(a) and math.isnan(b)) for a, b in zip(one, other, strict=True))


@settings(max_examples=60, deadline=None)
@given(felt(), st.integers(0, 2**32), st.booleans(), st.sampled_from((1.0, 0.2)))
def test_forces_and_states_are_those_of_python_bit_for_bit(code, laws, seed, prediction, smoothing):
    """Two traps, two spheres of each kind: states that come and go, spheres that change places, on a focus and far."""
    rng = random.Random(seed)

    def place(size: float) -> Vec3:
        size *= rng.choice((0.0, 0.3, 1.0, 1.0, 5.0))
        return rng.gauss(0.0, size), rng.gauss(0.0, size), rng.gauss(0.0, size)

    of_traps, kinds = {0: laws, 3: laws[::-1]}, (0, 1, 2, 3) * 2
    how = {"smoothing": smoothing, "prediction": prediction}
    plain, compiled = LocalModel(of_traps, kinds, **how), CompiledModel(of_traps, kinds, code=code, **how)
    for beat in range(8):
        bodies = rng.sample(range(9), len(kinds))
        traps = (TrapFrame(0, place(0.2), rng.uniform(1.0, 99.0)), TrapFrame(3, place(0.2), rng.uniform(1.0, 99.0)))
        scene = SceneFrame(beat, 8e-3 * beat, tuple(SphereFrame(place(1.0), b) for b in bodies), traps)
        hold = {0: place(0.2), 3: place(0.2)}
        assert plain.refresh(scene, hold) and compiled.refresh(scene, hold)
        assert json.dumps(compiled.state()) == json.dumps(plain.state())
        for _ in range(3):
            carried = place(0.3)
            assert alike(compiled.force(*carried), plain.force(*carried))
        if beat == 4:  # fresh ones go on from a snapshot of either, as replays do
            state = json.loads(json.dumps(compiled.state()))
            plain, compiled = LocalModel(of_traps, kinds, **how), CompiledModel(of_traps, kinds, code=code, **how)
            for model in (plain, compiled):
                model.refresh(scene, hold)
                model.restore(state)


@pytest.mark.parametrize(
    "law", [IsotropicLaw(RADIAL), SplitLaw(RADIAL, RADIAL), *TABLES], ids=lambda law: model_of(law)
)
def test_what_is_no_number_is_seen_in_the_sum(code, law):
    model = CompiledModel({0: (law,)}, code=code)
    model.refresh(
        SceneFrame(1, 0.0, (SphereFrame((0.1, 0.0, 0.0), 0),), (TrapFrame(0, (0.0, 0.0, 0.0), 1.0),)),
        {0: (0.0, 0.0, 0.0)},
    )
    assert math.isfinite(sum(model.force(0.1, 0.2, 0.3)))
    assert math.isnan(sum(model.force(math.nan, 0.2, 0.3)))


def test_a_chain_with_code_runs_it_and_sends_the_forces_of_one_without(code):
    """The law that runs is the compiled one; what is sent, kept and stored of it is the same."""
    chain = ChainConfig(pose_filter=LowPass(alpha=0.3, rate=1000.0), pose_prediction=True)
    config, laws, rng = (
        HandConfig(traps=(0, 1), chain=chain),
        {n: (TABLES[0], IsotropicLaw(RADIAL)) for n in (0, 1)},
        random.Random(5),
    )
    both = [make_chain(config, laws, (0, 1), INFO, code=use) for use in (code, None)]
    assert [type(one.model) for one in both] == [CompiledModel, LocalModel]
    for one in both:
        one.arm()
    for n in range(400):
        spheres = tuple(SphereFrame((rng.gauss(0.0, 0.3), 0.1 * rng.random(), 0.0), b) for b in (0, 1))
        traps = tuple(TrapFrame(t, (0.1 * t, 0.0, 0.0), 20.0) for t in (0, 1))
        scene = SceneFrame(n // 8 + 1, 1e-3 * (n // 8 * 8), spheres, traps) if n % 8 == 0 else scene  # noqa: F821
        sample = DeviceSample(1e-3 * n, (3e-3 * math.sin(0.02 * n), 1e-3, 0.0))
        one, other = (each.step(sample, scene) for each in both)
        assert one == other
        assert both[0].state(scene) == both[1].state(scene)
    assert max(map(abs, both[0].asked)) > 1e-3


def test_equal_laws_lie_in_memory_once(code):
    laws = {n: (TABLES[1], pickle.loads(pickle.dumps(TABLES[1])), TABLES[3]) for n in range(3)}
    packed = CompiledModel(laws, (0, 1, 2), code=code)._sum.laws
    assert len(packed.row) == 2 and len(packed.start) == 3
    nodes = sum(len(grid.node) // 3 for law in (TABLES[1], TABLES[3]) for grid in law.grids)
    assert len(packed.node) <= 4 * nodes + 40


def test_compiling_says_which_law_runs():
    laws = {0: (IsotropicLaw(RADIAL),), 4: (IsotropicLaw(RADIAL),)}
    found, said = compile_laws(laws)
    assert isinstance(found, CompiledLaw) and found.models == ("isotropic",) and said == "compiled"
    assert compile_laws({}) == (None, "in Python: no sphere is trapped")

    class Odd(IsotropicLaw):
        """A law of somebody else's."""

    assert models_of({0: (Odd(RADIAL),)}) is None
    assert compile_laws({0: (Odd(RADIAL),)}) == (None, "in Python: one of the laws has no compiled form")


def test_without_a_compiler_there_is_the_law_in_python(monkeypatch):
    def fails(models: tuple[str, ...]) -> None:
        raise RuntimeError("no room on the device")

    monkeypatch.setattr("otwarp.teleop.operators.servo.machine_code", fails)
    found, said = compile_laws({0: (IsotropicLaw(RADIAL),)})
    assert found is None and said == "in Python: Warp cannot compile it (no room on the device)"


BROKEN = {
    "symbol": ("absent", "cannot be loaded"),
    "file": ("/no/such.o", "cannot be loaded"),
    "loader": ("/no/such.so", "cannot be loaded"),
    "bounds": (bytes(24), "where Python gives"),
}


@pytest.mark.parametrize("field", BROKEN)
def test_a_trial_finds_code_that_must_not_be_used(code, field):
    value, why = BROKEN[field]
    broken = dataclasses.replace(code, **{field: value})
    assert why in tried(broken, {0: (IsotropicLaw(RADIAL),)})
    if field != "bounds":
        with pytest.raises(InputError, match="compiled force law"):
            broken.load()


def test_a_trial_that_dies_takes_nobody_with_it(code, monkeypatch):
    kill = f"import os; os.kill(os.getpid(), {int(signal.SIGKILL)})"
    run = subprocess.run
    monkeypatch.setattr(subprocess, "run", lambda command, **how: run([sys.executable, "-c", kill], **how))
    assert tried(code, {0: (IsotropicLaw(RADIAL),)}) == "its trial ended with -9"


def test_the_servo_loads_code_without_warp(code):
    """A fresh interpreter that computes by it has neither Warp nor NumPy."""
    order = pickle.dumps((code, {0: (TABLES[0],)}))
    script = (
        "import pickle, sys\n"
        "from otwarp.haptics.force.compiled import difference\n"
        "print(repr(difference(*pickle.loads(sys.stdin.buffer.read()))), *({'warp', 'numpy'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", script], input=order, capture_output=True, check=True)
    assert done.stdout.decode().strip() == "''"
