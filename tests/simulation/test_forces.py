"""Forces that users write, in every driver, integrator and precision: what they move, and what they count for."""

from __future__ import annotations

import dataclasses
import subprocess
import sys

import numpy as np
import pytest
import warp as wp

import otwarp as ot
from otwarp.errors import InputError
from otwarp.hydrodynamics import body_mobility
from otwarp.kernels.core.functions import function_from_text
from otwarp.kernels.forces.table import FORCES
from otwarp.scene import Body, Medium, Scene, SceneBuilder, Settings
from otwarp.simulation.info import describe
from otwarp.simulation.packing.forces import Force
from otwarp.simulation.simulation import Simulation
from otwarp.simulation.time_step.steady_loads import resting_loads
from otwarp.units import BOLTZMANN
from tests.simulation.setups import FIVE, VISCOSITY, drag, harmonic, robot, sphere_body

ROUNDING = {"float32": 3e-6, "float64": 1e-12}
"""Relative error of a displacement after some steps of rounding."""

SLOPE = 1.7
"""Stiffness of the linear force [pN/µm]."""


@ot.force(push="pN")
def constant(body: ot.ForceInput, push: wp.vec3):
    return push


@ot.force(stiffness="pN/µm", centre="µm")
def spring(body: ot.ForceInput, stiffness: float, centre: wp.vec3 = (0.0, 0.0, 0.0)):
    return -stiffness * (body.position - centre)


@ot.force(acts_on="spheres", per_radius="pN/µm")
def by_size(body: ot.ForceInput, per_radius: float):
    return wp.vec3(0.0, 0.0, per_radius * body.radius)


@ot.force(strength="pN·µm")
def turning(body: ot.ForceInput, strength: float) -> ot.Wrench:
    return ot.Wrench(wp.vec3(0.0), wp.vec3(0.0, 0.0, strength))


AMPLITUDE = 0.7


@wp.func
def wave(time: float, frequency: float) -> float:
    return AMPLITUDE * wp.sin(6.283185307179586 * frequency * time)


@ot.force(frequency="Hz", acts_on="body")
def shaken(body: ot.ForceInput, frequency: float):
    """Calls another function, which uses a constant."""
    return wp.vec3(wave(body.time, frequency), 0.0, 0.0)


def quiet(*bodies: Body, **settings) -> Scene:
    return Scene(bodies=bodies, settings=Settings(brownian=False, time_step=1e-4, **settings))


def colliding(n: int) -> tuple[Body, ...]:
    """Beads that could touch, far apart."""
    return tuple(sphere_body(f"B{i}", (6.0 * i, 0.0, 0.0), collides=True) for i in range(n))


DRIVERS = {
    "solo": quiet(sphere_body("B0")),
    "world": quiet(*colliding(2)),
    "coupled": dataclasses.replace(
        quiet(sphere_body("B0"), sphere_body("B1", (4000.0, 0.0, 0.0))),
        settings=Settings(brownian=False, time_step=1e-4, coupling=True),
    ),
    "grid": quiet(*colliding(30)),
    "rigid": quiet(robot("B0")),
}


@pytest.mark.parametrize(
    ("driver", "precision"),
    [(d, p) for d in DRIVERS for p in ROUNDING if (d, p) != ("grid", "float64")],
)
def test_a_constant_force_moves_a_body_by_its_mobility(driver: str, precision: str, device: str):
    scene, force = DRIVERS[driver], np.array([0.3, -0.2, 0.5])
    worlds = np.array([1.0, 2.0])[:, None, None] * force
    sim = Simulation(
        scene,
        worlds=2,
        device=device,
        precision=precision,
        forces=[constant],
        parameters={"constant_push": np.broadcast_to(worlds, (2, len(scene.bodies), 3))},
    )
    assert sim.model.features.driver == {"coupled": "world", "rigid": "solo"}.get(driver, driver)
    start = sim.state.position.numpy().astype(float)
    sim.step(50)
    moved = sim.state.position.numpy() - start
    mobility = np.eye(3) / drag(1.0)
    if driver == "rigid":
        centres, radii = np.array([o for o, _ in FIVE]), np.array([r for _, r in FIVE])
        mobility = body_mobility(centres, radii, accuracy=Body.mobility_accuracy).mobility[:3, :3] / VISCOSITY
    expected = 50 * 1e-4 * np.array([1.0, 2.0])[:, None] * (mobility @ force)
    # coupled beads 4 mm apart carry each other along by 1.5·radius/distance; a robot that is pushed turns a little, too
    far = 1e-3 if driver in ("coupled", "rigid") else 30 * ROUNDING[precision]
    # float32 positions up to 200 µm from the origin
    spacing = 50 * np.spacing(np.float32(4000.0 if driver == "coupled" else 200.0)) if precision == "float32" else 0.0
    np.testing.assert_allclose(moved[:, 0], expected, rtol=far, atol=0.0 if driver in ("solo", "rigid") else spacing)
    force_now = sim.readout.body_force.numpy()
    np.testing.assert_allclose(force_now[:, 0, 0], worlds[:, 0] * [[1.0]], rtol=1e-6)


@pytest.mark.parametrize("integrator", ["eulerMaruyama", "leimkuhlerMatthews", "heun", "exponential"])
def test_every_stage_of_every_integrator_sums_it(integrator: str, device: str):
    """A spring relaxes as e^{−kt/γ}, to the order of the scheme; only a force that both stages see is of order two."""
    rate = SLOPE / drag(1.0)
    dt = 0.1 / rate
    scene = quiet(sphere_body("B", (1.0, 0.0, 0.0)))
    sim = Simulation(scene, device=device, time_step=dt, integrator=integrator, forces=[spring(stiffness=SLOPE)])
    assert sim.model.features.integrator == integrator
    sim.step(10)
    order = {"eulerMaruyama": 1, "leimkuhlerMatthews": 1}.get(integrator, 2)
    lost = sim.state.position.numpy()[0, 0, 0] / np.exp(-1.0) - 1.0
    # local error z²/2 or z³/6 per step
    assert abs(lost) == pytest.approx(10 * 0.1 ** (order + 1) / (order * (order + 1)), rel=0.15)


def test_a_spring_of_the_users_is_a_spring_of_a_trap(device: str):
    """The same step is chosen, and the same path taken, as in a harmonic trap of this stiffness."""
    law = {"stiffness": SLOPE, "power": 1.0}
    trap = dataclasses.replace(harmonic("T", power=1.0), radial=dataclasses.replace(harmonic("T").radial, **law))
    bead = sphere_body("B", (0.1, 0.0, 0.0))
    trapped = Simulation(Scene(bodies=(bead,), traps=(trap,)), worlds=4, seed=3, device=device)
    pulled = Simulation(Scene(bodies=(bead,)), worlds=4, seed=3, device=device, forces=[spring(stiffness=SLOPE)])
    # the slope was measured by differences in float64
    assert pulled.time_step == pytest.approx(trapped.time_step, rel=1e-6)
    assert pulled.model.scales.stiffest_body == bead.name
    for sim in (trapped, pulled):
        sim.step(200)
    np.testing.assert_allclose(pulled.state.position.numpy(), trapped.state.position.numpy(), atol=2e-5)


def test_a_stated_slope_takes_the_place_of_the_measured_one(device: str):
    @ot.force(stiffness="pN/µm", slope=lambda stiffness: 4.0 * stiffness, load=1.0)
    def stated(body: ot.ForceInput, stiffness: float):
        return -stiffness * body.position

    bead = Scene(bodies=(sphere_body("B", (0.1, 0.0, 0.0)),))
    sims = [Simulation(bead, device=device, forces=[f(stiffness=SLOPE)]) for f in (spring, stated)]
    assert sims[1].time_step == pytest.approx(sims[0].time_step / 4.0, rel=1e-6)
    assert sims[1].model.loads[0].force == 1.0


def test_a_spring_holds_the_thermal_variance(device: str):
    """⟨x²⟩ = k_B T/k, standard error √(2/N) of N = 3·4096 independent values; the step errs by 1 % at most."""
    sim = Simulation(Scene(bodies=(sphere_body("B"),)), worlds=4096, seed=11, device=device,
                     forces=[spring(stiffness=SLOPE)])  # fmt: skip
    sim.run(8.0 * drag(1.0) / SLOPE)
    values = sim.state.position.numpy().ravel()
    expected = BOLTZMANN * Medium().temperature / SLOPE
    assert abs(np.mean(values**2) / expected - 1.0) < 0.01 + 5.0 * np.sqrt(2.0 / values.size)


def test_forces_on_spheres_turn_a_body_and_torques_too(device: str):
    """Against sums over the spheres, and angular velocity M_rr T."""
    scene = quiet(robot("R"))
    sim = Simulation(scene, device=device, forces=[by_size(per_radius=0.4), turning(strength=0.3)])
    reference = sim.model.reference[0]
    offsets, radii = np.array([o for o, _ in FIVE]) - reference, np.array([r for _, r in FIVE])
    forces = np.stack([0 * radii, 0 * radii, 0.4 * radii], axis=1)
    found = sim.readout.body_force.numpy()[0, :, 0], sim.readout.body_torque.numpy()[0, :, 0]
    np.testing.assert_allclose(found[0], [forces.sum(axis=0), np.zeros(3)], atol=1e-6)
    np.testing.assert_allclose(found[1], [np.cross(offsets, forces).sum(axis=0), (0, 0, 0.3)], atol=1e-5)


@pytest.mark.parametrize("precision", ROUNDING)
def test_functions_and_constants_that_it_uses_come_along(precision: str, device: str):
    sim = Simulation(quiet(sphere_body("B")), device=device, precision=precision, forces=[shaken(frequency=100.0)])
    sim.step(25)  # a quarter of a period: 2.5 ms
    assert sim.readout.body_force.numpy()[0, 0, 0, 0] == pytest.approx(AMPLITUDE, rel=30 * ROUNDING[precision])


def test_it_acts_where_it_is_given_and_costs_nothing_elsewhere(device: str):
    scene = quiet(*colliding(2))
    sim = Simulation(scene, device=device, forces=[constant(push={"/World/B1": (0.0, 0.0, 1.0)})])
    sim.step(20)
    moved = sim.state.position.numpy()[0, :, 2]
    assert moved[0] == 0.0
    assert moved[1] > 0.0
    free = Simulation(scene, device=device)
    assert free.model.features.forces == ()
    assert free.readout.body_force.shape == (1, 0, 0)
    assert free.model.data.forces.shape == (0,)
    assert free._step.forces is None


def test_a_checkpoint_goes_on_with_the_same_function_alone(tmp_path, device: str):
    builder = SceneBuilder()
    builder.add(sphere_body("B", (0.5, 0.0, 0.0)))
    scene = Scene.load(builder.save(tmp_path / "bead.usda"))
    how = {"worlds": 2, "device": device, "parameters": {"spring_stiffness": [[1.0], [3.0]]}}
    sim = Simulation(scene, forces=[spring(stiffness={"/World/B": 1.0})], **how)
    sim.step(30)
    kept = sim.save(tmp_path / "end.npz")
    sim.step(30)
    again = Simulation.restore(kept, device=device, forces=[spring])
    again.step(30)
    np.testing.assert_array_equal(again.state.position.numpy(), sim.state.position.numpy())
    with pytest.raises(InputError, match="was made with forces: spring; given: none"):
        Simulation.restore(kept, device=device)

    def other(body: ot.ForceInput, stiffness: float, centre: wp.vec3 = (0.0, 0.0, 0.0)):
        return -2.0 * stiffness * (body.position - centre)

    other.__name__ = "spring"
    with pytest.raises(InputError, match="force spring is another function"):
        Simulation.restore(kept, device=device, forces=[ot.force(stiffness="pN/µm", centre="µm")(other)])


def test_an_authored_force_is_the_same_as_a_users(tmp_path, device: str):
    """`ot:body:externalForce`, in newton, written and read back, and swept by its parameter."""
    builder = SceneBuilder(settings=Settings(brownian=False, time_step=1e-3))
    builder.add(dataclasses.replace(sphere_body("B"), forces={"external_force": (0.0, 0.25, 0.0)}))
    scene = Scene.load(builder.save(tmp_path / "pushed.usda"))
    assert scene.bodies[0].forces == {"external_force": (0.0, 0.25, 0.0)}
    swept = {"external_force": np.array([0.25, 0.5])[:, None, None] * [[[0.0, 1.0, 0.0]]]}
    sim = Simulation(scene, worlds=2, device=device, parameters=swept)
    assert sim.model.features.integrator == "eulerMaruyama"  # it depends on no place: one stage is exact
    sim.step(10)
    np.testing.assert_allclose(sim.state.position.numpy()[:, 0, 1], 0.01 / drag(1.0) * np.array([0.25, 0.5]), rtol=1e-5)
    about = describe(scene, device=device)
    assert about["forces"][0]["parameters"]["force"] == {
        "unit": "pN",
        "low": [0.0, 0.25, 0.0],
        "high": [0.0, 0.25, 0.0],
    }
    assert about["steady_loads"]["force"] == pytest.approx(0.25)


def test_a_steady_force_shortens_the_step_of_what_collides(device: str):
    """As weight does: no body may drift by a tenth of its radius in a step."""
    scene = Scene(bodies=colliding(2), settings=Settings(brownian=False))
    steps = [
        Simulation(scene, device=device, forces=[constant(push=(0.0, 0.0, f))]).time_step for f in (1e3, 2e3)
    ]  # fmt: skip
    assert steps[0] == pytest.approx(0.1 * drag(1.0) / 1e3, rel=1e-9)
    assert steps[1] == pytest.approx(0.5 * steps[0], rel=1e-9)


def made(text: str, **units: str) -> Force:
    """A force of a function from text, as a user would type it."""
    from otwarp.kernels.core.functions import function_from_text

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
        ([constant.law.function], {}, "allowed: functions decorated with otwarp.force"),
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

print(push.law.digest)
"""


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


def test_a_stated_load_does_not_hide_a_torque(device: str):
    @ot.force(strength="pN·µm", slope=0.0, load=0.0)
    def motor(body: ot.ForceInput, strength: float) -> ot.Wrench:
        return ot.Wrench(wp.vec3(0.0), wp.vec3(0.0, 0.0, strength))

    sim = Simulation(Scene(bodies=(robot("R"),)), device=device, forces=[motor(strength=50.0)])
    assert sim.model.loads[0].torque == pytest.approx(50.0)
    assert sim.model.scales.turning is not None


def test_an_oscillation_is_seen_whatever_its_frequency(device: str):
    for frequency in (4.0, 100.0):
        sim = Simulation(Scene(bodies=(sphere_body("B"),)), device=device, forces=[shaken(frequency=frequency)])
        assert 0.9 * AMPLITUDE < sim.model.loads[0].force <= AMPLITUDE * (1.0 + 1e-6)


def test_forces_of_a_scene_that_state_nothing_count_for_the_budget(monkeypatch):
    """As ours would if it stated no bounds: 0.25 pN are measured."""
    row = FORCES["external"]
    unbounded = dataclasses.replace(row.parametric, load=None, slope=None)
    monkeypatch.setitem(FORCES, "external", dataclasses.replace(row, parametric=unbounded))
    bead = dataclasses.replace(sphere_body("B"), forces={"external_force": (0.0, 0.25, 0.0)})
    (load,) = resting_loads(Scene(bodies=(bead,)))
    assert load.force == pytest.approx(0.25)
