"""float64 by option: the same paths as float32 up to rounding, the same numbers as float64 NumPy to 1e-12.

Both precisions take the same float32 deviates, so that paths can be compared one by one.
"""

import dataclasses
import functools
import json
import subprocess
import sys

import numpy as np
import pytest
import warp as wp
from click.testing import CliRunner
from scipy.optimize import brentq

from otwarp.kernels.core import precision as kernels
from otwarp.kernels.core.noise import six_deviates_term, three_deviates_term
from otwarp.kernels.core.random import GAUSSIAN_TERMS, Stream, noise_words
from otwarp.scene import Medium, Scene, Settings, Track, Trap
from otwarp.simulation.simulation import Simulation
from tests.reference import rotations
from tests.reference import walls as walls_reference
from tests.reference.body import thermal_move
from tests.reference.contact import sphere_pair
from tests.reference.traps import body_wrench
from tests.simulation.setups import (
    CELL,
    ENERGY,
    VISCOSITY,
    bead_scene,
    contact_scene,
    drag,
    harmonic,
    neutral,
    obstacle,
    robot,
    sphere_body,
)
from tests.simulation.test_contact_thermal import pairs
from tests.simulation.test_coupling import coupled, mixed

ROUNDINGS = 40.0
"""Spacings of float32 at the largest coordinate by which paths of a few hundred steps may differ: each step rounds a
position by up to half a spacing, which adds up like noise (√300/√12 = 5), five times that, and as much for forces."""

EXACT = 1e-12
"""Error of float64 against NumPy after some steps: thousands of roundings of 1e-16."""

SINGLE = 1e-10
"""Error that float32 exceeds where float64 has `EXACT`: its roundings are 6e-8 of displacements of some 10 nm."""

DT = 2e-5


@pytest.fixture(autouse=True)
def cache(tmp_path_factory, monkeypatch):
    """Force tables apart from the user's."""
    monkeypatch.setenv("OTWARP_CACHE", str(tmp_path_factory.getbasetemp() / "tables"))


def settings(**more) -> Settings:
    return Settings(**{"time_step": DT, "integrator": "heun"} | more)


def table_scene() -> Scene:
    """A bead beside the focus of a tabulated trap."""
    optical = {"model": "table", "interpolation": "bicubic", "tolerance": 1e-2}
    trap = Trap(prim="/World/T", position=Track.constant((0.0, 0, 0)), power=Track.constant(5.0), **optical)
    return Scene(bodies=(sphere_body("Bead", (0.3, -0.2, 0.4)),), traps=(trap,), settings=settings())


def robot_scene() -> Scene:
    """Five spheres in three springs that each reach one or two of them."""
    traps = tuple(harmonic(f"T{i}", (3.5 * (i - 1), 0.0, 0.5 * abs(i - 1)), cutoff=2.0) for i in range(3))
    return Scene(medium=Medium(viscosity=VISCOSITY), bodies=(robot("Robot"),), traps=traps, settings=settings())


def pair_scene(temperature: float = 298.15, gap: float = 0.3) -> Scene:
    """Two unequal cells pressed together by two traps, and away from them a floor and a box."""
    stand = 0.5 * (3.5 - gap)
    traps = (harmonic("TA", (-stand, 0, 9), cutoff=1.2), harmonic("TB", (stand, 0, 9), cutoff=1.2))
    cells = [neutral(n, (x, 0, 9.0), radius=r, material=CELL) for n, x, r in (("A", -stand, 1.5), ("B", stand, 2.0))]
    return contact_scene(*cells, traps=traps, temperature=temperature)


def wall_scene() -> Scene:
    """A bead that diffuses near a wall and is not heavy."""
    floor = dataclasses.replace(obstacle("Floor", "plane", (0.0, 0.0, 0.0)), hydrodynamic=True)
    return Scene(
        medium=Medium(viscosity=VISCOSITY),
        bodies=(sphere_body("Bead", (0.0, 0.0, 1.3), trapped=False),),
        obstacles=(floor,),
        settings=settings(),
    )


def coupled_scene() -> Scene:
    """A robot and two beads that carry each other along, as far from the origin as the pair of cells."""
    scene, up = mixed(DT), np.array([0.0, 0.0, 9.0])
    bodies = tuple(dataclasses.replace(b, position=tuple(up + b.position)) for b in scene.bodies)
    traps = tuple(dataclasses.replace(t, position=Track.constant(up + t.position.at(0.0))) for t in scene.traps)
    return dataclasses.replace(scene, bodies=bodies, traps=traps)


def coupled_pair() -> Scene:
    """Two touching beads in one spring that carry each other along."""
    return coupled(pairs(1), time_step=DT)


SCENES = {
    "bead": bead_scene,
    "table": table_scene,
    "robot": robot_scene,
    "pair": pair_scene,
    "walls": wall_scene,
    "coupled": coupled_scene,
    "coupled pair": coupled_pair,
}


def start(scene: Scene, precision: str, device: str, **more) -> Simulation:
    return Simulation(scene, precision=precision, device=device, seed=11, allow_large_step=True, **more)


def places(sim: Simulation) -> np.ndarray:
    return sim.state.position.numpy().astype(float)


@pytest.mark.parametrize(
    # two coupled bodies are coupled as well
    "name",
    [pytest.param(n, marks=pytest.mark.validate) if n == "coupled" else n for n in SCENES],
)
def test_paths_agree_to_rounding(name, device):
    """300 steps of the same noise, in three worlds; forces of traps and contact too."""
    sims = [start(SCENES[name](), p, device, worlds=3) for p in kernels.PRECISIONS]
    for sim in sims:
        sim.step(300)
    single, double = (places(sim) for sim in sims)
    spacing = float(np.spacing(np.float32(np.abs(double).max())))
    assert np.abs(single - double).max() < ROUNDINGS * spacing
    assert np.abs(double[0] - double[1]).max() > 1e3 * spacing
    assert not np.array_equal(single, double)
    assert [s.state.position.dtype for s in sims] == [wp.vec3, wp.vec3d]
    if sims[0].model.features.rigid:
        np.testing.assert_allclose(*(s.state.orientation.numpy() for s in sims), atol=1e-5)
    for field in ("trap_force", "contact_force"):
        forces = [getattr(s.readout, field).numpy() for s in sims]
        # stiffness up to some 100 pN/µm
        np.testing.assert_allclose(*forces, rtol=1e-4, atol=100.0 * ROUNDINGS * spacing)


@pytest.mark.parametrize("integrator", ["eulerMaruyama", "leimkuhlerMatthews", "exponential"])
@pytest.mark.parametrize("name", ["bead", "robot"])
def test_paths_of_every_integrator_agree_to_rounding(name, integrator, device):
    """100 steps of the same noise; Heun is above."""
    sims = [start(SCENES[name](), p, device, worlds=3, integrator=integrator) for p in kernels.PRECISIONS]
    assert sims[0].model.features.integrator == integrator
    for sim in sims:
        sim.step(100)
    single, double = (places(sim) for sim in sims)
    assert 0.0 < np.abs(single - double).max() < ROUNDINGS * float(np.spacing(np.float32(np.abs(double).max())))


def probe(term: wp.Function, kind: type) -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False)
    def draw(seed: wp.uint32, out: wp.array(dtype=kind)):
        out[wp.tid()] = term(seed, wp.int64(wp.tid()), 0, 0)

    return draw


def deviates(kind: type, term: wp.Function, steps: int, device: str) -> np.ndarray:
    """(steps, n) the float32 deviates that body 0 of world 0 gets."""
    out = wp.empty(steps, dtype=kind, device=device)
    wp.launch(probe(term, kind), dim=steps, inputs=[wp.uint32(11), out], device=device)
    return out.numpy().astype(float)


def errors(expected: np.ndarray, scene: Scene, device: str, steps: int, **more) -> list[float]:
    """Largest error of float32 and of float64 after `steps` steps."""
    out = []
    for precision in kernels.PRECISIONS:
        sim = start(scene, precision, device, **more)
        sim.step(steps)
        out.append(float(np.abs(places(sim)[0] - expected).max()))
    return out


def test_bead_is_that_of_numpy(device):
    """Heun's step of a spring with its noise, 50 times."""
    scene = bead_scene(time_step=1e-4)
    z = 20.0 / drag(1.0) * 1e-4
    x, spread = np.zeros(3), np.sqrt(2.0 * ENERGY / drag(1.0) * 1e-4)
    for xi in deviates(wp.vec3, three_deviates_term("gaussian"), 50, device):
        move = -z * x + spread * xi
        x = x + spread * xi - 0.5 * z * (x + (x + move))
    scene = dataclasses.replace(scene, medium=Medium(viscosity=VISCOSITY), settings=settings(time_step=1e-4))
    single, double = errors(x, scene, device, 50)
    assert double < EXACT < SINGLE < single


def test_table_force_is_that_of_numpy(device):
    """Interpolation, blending of levels and all, at random places."""
    rng = np.random.default_rng(4)
    where = rng.normal(size=(200, 1, 3)) * [1.0, 1.0, 2.0]
    found = []
    for precision in kernels.PRECISIONS:
        sim = start(table_scene(), precision, device, worlds=200)
        sim.set_state(position=where)
        table = sim.model.optics.tables[0]
        expected = 5.0 * table.beam.force_scale * table.force(where[:, 0])
        found.append(np.abs(sim.readout.trap_force.numpy()[:, 0] - expected).max() / np.abs(expected).max())
    assert found[1] < EXACT < SINGLE < found[0]


def robot_move(scene: Scene, mobility: np.ndarray, reference: np.ndarray, x: np.ndarray, q: np.ndarray) -> np.ndarray:
    """(6,) drift of the robot in one step, world axes."""
    spheres = [(np.array(s.offset), s.radius) for s in scene.bodies[0].spheres]
    traps = [(t, t.position.at(0.0), 20.0) for t in scene.traps]
    wrench = np.concatenate(body_wrench(traps, x, q, reference, spheres))
    turn = np.kron(np.eye(2), rotations.matrix(q))
    return DT / VISCOSITY * (turn @ mobility @ turn.T @ wrench)


def test_robot_is_that_of_numpy(device):
    """Heun's step with rotation, its pull-back and full coupling, 20 times."""
    scene = robot_scene()
    model = start(scene, "float64", device).model
    mobility, root = (a.numpy()[0] for a in (model.data.body.mobility, model.data.body.cholesky))
    x, q, reference = model.start_position()[0], np.array([0.0, 0.0, 0.0, 1.0]), model.reference[0]
    move_at = functools.partial(robot_move, scene, mobility, reference)

    def shifted(move: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return x + move[:3], rotations.multiply(rotations.exponential(move[3:]), q)

    six = kernels.typed(kernels.kernel_module("core.types", "float32").vec6, "float32")
    for xi in deviates(six, six_deviates_term("gaussian"), 20, device):
        turn = np.kron(np.eye(2), rotations.matrix(q))
        noise = turn @ thermal_move(np.sqrt(2.0 * ENERGY * DT / VISCOSITY) * root, xi)
        first = move_at(x, q)
        move = noise + first
        later = move_at(*shifted(move))
        later[3:] -= 0.5 * np.cross(move[3:], later[3:])
        x, q = shifted(move + 0.5 * (later - first))
    single, double = errors(x, scene, device, 20)
    assert double < EXACT < SINGLE < single


def test_wall_step_is_that_of_numpy(device):
    """One step of Heun without a force is the noise with its thermal drift; derivatives by differences err by 1e-10."""
    scene = wall_scene()

    @wp.func
    def four(seed: wp.uint32, step: wp.int64, world: int, body: int) -> wp.vec4:
        words = noise_words(seed, wp.static(wp.uint32(Stream.BROWNIAN_A)), step, world, body)
        a = pair(words[0], words[1])
        b = pair(words[2], words[3])
        return wp.vec4(a[0], a[1], b[0], b[1])

    pair = GAUSSIAN_TERMS[False]
    xi = deviates(wp.vec4, four, 1, device)[0]
    walls = (np.array([[0.0, 0.0, 1.0]]), np.zeros(1))
    spread, here = np.sqrt(2.0 * ENERGY / drag(1.0) * DT), np.array([0.0, 0.0, 1.3])
    expected = here + walls_reference.sphere_move(here, 1.0, walls, spread, xi[:3], xi[3])
    single, double = errors(expected, scene, device, 1)
    assert double < EXACT < SINGLE < single


PRESSED = 1e-8
"""Relative error of an overlap at rest: 4000 steps of 200 µs are some 40 relaxations. float32 has 2e-3."""


def test_pressed_cells_obey_hertz_far_better(device):
    """At rest the traps' pull is the Hertz force of the overlap; noise at 1e-16 K moves nothing."""
    gap = 0.3
    exact = brentq(lambda d: sphere_pair(CELL, 1.5, CELL, 2.0, 3.5 - d)[0] - 10.0 * (gap - d), 0, gap, xtol=1e-15)
    found = []
    for precision in kernels.PRECISIONS:
        sim = start(pair_scene(1e-16, gap), precision, device)
        sim.step(4000)
        a, b = places(sim)[0]
        found.append(abs(3.5 - np.linalg.norm(a - b) - exact) / exact)
    assert found[1] < PRESSED < found[0] < 2e-3


FAR = 1e5
WORLDS, STEPS = 2000, 50


def test_diffusion_far_from_the_origin(device):
    """At 1e5 µm coordinates of float32 are 8 nm apart, and steps of 1 nm round to nothing; float64 does not care.

    Mean square of 3·WORLDS·STEPS steps: standard error √(2/(3·WORLDS)) = 1.8 % of what all steps together make.
    """
    bead = sphere_body("Bead", (FAR, FAR, FAR), trapped=False)
    scene = Scene(medium=Medium(viscosity=VISCOSITY), bodies=(bead,), settings=settings(time_step=2e-6))
    expected = 2.0 * ENERGY / drag(1.0) * 2e-6 * STEPS
    ratio = {}
    with pytest.warns(UserWarning, match="falsified by the rounding of float32 coordinates"):
        sims = [start(scene, p, device, worlds=WORLDS) for p in ("float32", "float64")]
    for sim, name in zip(sims, kernels.PRECISIONS, strict=True):
        sim.step(STEPS)
        ratio[name] = float(((places(sim) - FAR) ** 2).mean()) / expected
    assert ratio["float64"] == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / (3.0 * WORLDS)))
    assert ratio["float32"] < 0.1


def test_orientation_stays_a_unit_quaternion(device):
    """1e5 steps of a robot: rounding alone."""
    for precision, bound in (("float64", 4e-16), ("float32", 2e-7)):
        sim = start(robot_scene(), precision, device)
        sim.step(100_000)
        norm = np.linalg.norm(sim.state.orientation.numpy().astype(float))
        assert abs(norm - 1.0) <= bound
        assert sim.readout.fault_count.numpy()[0] == 0


def test_runs_are_reproducible_bit_for_bit(device):
    """Whatever the threads, and however the steps are grouped."""
    sims = [start(robot_scene(), "float64", device, worlds=3, threads=n) for n in (1, 2)]
    sims[0].step(200)
    sims[1].step(50)
    sims[1].step(150)
    np.testing.assert_array_equal(*(s.state.position.numpy() for s in sims))
    np.testing.assert_array_equal(*(s.state.orientation.numpy() for s in sims))


def test_commands_and_places_are_kept_in_full(device):
    """What does not fit into float32 is not rounded on the way in."""
    place = 1.0 + 2.0**-40
    sim = start(bead_scene(), "float64", device, worlds=2)
    sim.control.set(trap_position=(place, 0.0, 0.0), trap_power=[[place], [2.0]])
    sim.set_state(position=[[place, 0.0, 0.0]])
    for array in (sim.control.trap_position, sim.control.trap_power, sim.state.position):
        assert array.numpy().ravel()[0] == place


def test_checkpoint_keeps_the_precision(tmp_path, device):
    scene = Scene.load("scenes/single_bead.usda")
    whole, first = (start(scene, "float64", device, worlds=2) for _ in range(2))
    whole.step(100)
    first.step(40)
    again = Simulation.restore(first.save(tmp_path / "c.npz"), device=device)
    assert again.model.features.precision == "float64"
    again.step(60)
    np.testing.assert_array_equal(again.state.position.numpy(), whole.state.position.numpy())


def test_command_line(tmp_path, device):
    """The whole way from the option to the files."""
    from otwarp.cli.main import cli

    arguments = ["run", "scenes/single_bead.usda", "--out", str(tmp_path / "run"), "--duration", "0.05", "--json"]
    done = CliRunner().invoke(cli, [*arguments, "--precision", "float64", "--device", device])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout[done.stdout.index("{") :])
    assert (tmp_path / "run" / "run.nc").exists()
    refused = CliRunner().invoke(cli, [*arguments, "--precision", "float16"])
    assert refused.exit_code == 2


def test_float32_does_not_import_float64():
    code = (
        "import sys; from tests.simulation.setups import bead_scene; from otwarp import Simulation;"
        "Simulation(bead_scene(), device='cpu'); print(*[m for m in sys.modules if 'kernels.float64' in m])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


@pytest.mark.parametrize(
    "name",
    [
        *("core.types", "bodies.bead", "bodies.rigid", "optics.traps", "optics.force_table"),
        *("hydrodynamics.walls_rigid", "contact.detect", "contact.solve"),
    ],
)
def test_nothing_single_is_left_in_the_source(name):
    """No type of float32, and no literal or constant of a kernel without a cast."""
    import re

    code = re.sub(r'"""(.|\n)*?"""|\'[^\'\n]*\'|#.*', "", kernels.double_source(name))
    assert not re.search(r"float32|wp\.(vec[234]|quat|mat33|mat44)\b|[^.\w]float\(", code)
