"""Environments whose scenes differ in what a model fixes: as each alone, in any mode, and refused where none can be."""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np
import pytest

pytest.importorskip("gymnasium")

import gymnasium
from gymnasium.utils.env_checker import check_env

from otwarp import studies
from otwarp.envs import Env, GroupedEnv, GroupedVectorEnv, VectorEnv, check_vector, group_tasks
from otwarp.envs.grouped import group_of
from otwarp.envs.kernels.starts import NEXT_EPISODE
from otwarp.envs.randomise.groups import merged
from otwarp.envs.rollout import policy_of, run_policy
from otwarp.errors import InputError, PlausibilityWarning
from otwarp.scene import Scene, SceneBuilder, Track, Trap, TrapLaw
from tests.envs.bead_task import BEAD, HEIGHT, PILLARS
from tests.envs.bead_task import scene as bead_scene
from tests.envs.bead_task import task as bead_task

RADIUS = f"{BEAD}/sphere.radius"
RADII = studies.values([0.8, 1.0, 1.2], unit="µm")
FAR = (50.0, 0.0, HEIGHT)
"""A goal that is not reached."""
PILLAR = next(iter(PILLARS))
CARRIER = "/World/carrier"
"""A trap that no hand moves, and goes to and fro without power."""


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """The scene of beads with a carrier, in a file."""
    return saved(bead_scene(), tmp_path_factory.mktemp("grouped") / "beads.usda")


def saved(first, file):
    """The file of a scene, and a carrier."""
    builder = SceneBuilder(settings=first.settings)
    for thing in (*first.bodies, *first.traps, *first.obstacles):
        builder.add(thing)
    times = np.linspace(0.0, 20.0, 81)
    way = np.stack([np.sin(times), np.full(81, 20.0), np.full(81, HEIGHT)], axis=1)
    law = TrapLaw(stiffness=2.0, power=1.0)
    path, off = Track(times=times, values=way), Track.constant(0.0)
    builder.add(Trap(prim=CARRIER, position=path, power=off, model="harmonic", radial=law))
    return builder.save(file)


def task_in(file, **changes):
    """Short episodes, some of which reach the goal; the trap without power holds nothing that may be lost."""
    task = bead_task()
    ends = tuple(end for end in task.ends if end.name != "lost")
    shortened = {"time_limit": 0.5, "goal": (-8.0, 0.0, HEIGHT), "scene": Scene.load(file), "ends": ends}
    return dataclasses.replace(task, **shortened | changes)


@pytest.mark.quick
def test_each_value_that_needs_a_model_has_a_task_of_its_own(file):
    """All combinations; what worlds of one model may differ in is left to the table."""
    task = task_in(
        file,
        randomise={
            RADIUS: RADII,
            f"speed:{CARRIER}": studies.values([0.5, 2.0], unit="µm/s"),
            "trap_power": studies.values([4.0, 6.0], unit="mW"),
        },
    )
    tasks = group_tasks(task)
    made = []
    for one in tasks:
        scene = one.load()
        way = next(t for t in scene.traps if t.prim == CARRIER).position
        speed = np.linalg.norm(np.diff(way.values, axis=0), axis=1) / np.diff(way.times)
        made.append((scene.bodies[0].spheres[0].radius, round(float(speed.max()), 6)))
        assert list(one.randomise) == [("trap_power",)]
    assert made == [(r, v) for r in (0.8, 1.0, 1.2) for v in (0.5, 2.0)]
    alone = task_in(file, randomise={"trap_power": studies.values([4.0, 6.0], unit="mW")})
    assert group_tasks(alone) == (alone,)


@pytest.mark.quick
def test_what_goes_along_with_a_radius_has_the_value_of_its_row(file):
    density = studies.values([1000.0, 2000.0, 3000.0], unit="kg/m³")
    task = task_in(file, randomise={(RADIUS, f"{BEAD}.ot:body:density"): (RADII, density)})
    bodies = [one.load().bodies[0] for one in group_tasks(task)]
    assert [b.spheres[0].radius for b in bodies] == [0.8, 1.0, 1.2]
    assert np.allclose([b.density for b in bodies], [1e-9, 2e-9, 3e-9])


@pytest.mark.quick
def test_a_change_of_the_task_and_one_of_its_axes_are_both_kept(file):
    """As of a shipped task whose bodies touch nothing, which its file does not say."""
    scene = Scene.load(file)
    touching = tuple(
        dataclasses.replace(b, spheres=tuple(dataclasses.replace(s, collides=True) for s in b.spheres))
        for b in scene.bodies
    )
    task = task_in(file, scene=dataclasses.replace(scene, bodies=touching), randomise={RADIUS: RADII})
    for one, radius in zip(group_tasks(task), (0.8, 1.0, 1.2), strict=True):
        sphere = one.load().bodies[0].spheres[0]
        assert sphere.collides and sphere.radius == radius
    with pytest.raises(InputError, match="changed by the task, and by what is randomised"):
        merged(scene, _with_radius(scene, 1.1), _with_radius(scene, 0.9), "scene")
    # one of the values is that of the file, the other the task's: the axis would do nothing
    collides = studies.values([True, False])
    task = task_in(file, scene=scene, randomise={f"{BEAD}/sphere.ot:sphere:collides": collides})
    assert [one.load().bodies[0].spheres[0].collides for one in group_tasks(task)] == [True, False]
    with pytest.raises(InputError, match="changed by the task, and by what is randomised"):
        group_tasks(dataclasses.replace(task, scene=dataclasses.replace(scene, bodies=touching)))


def _with_radius(scene, radius):
    body = scene.bodies[0]
    sphere = dataclasses.replace(body.spheres[0], radius=radius)
    return dataclasses.replace(scene, bodies=(dataclasses.replace(body, spheres=(sphere,)), *scene.bodies[1:]))


def test_many_are_as_each_alone_in_all_modes(file, device):
    """Five environments of three models, of which one has fewer; beside a parameter of the table."""
    power = studies.values([4.0, 6.0], unit="mW")
    task = task_in(file, randomise={RADIUS: RADII, "trap_power": power})

    def make(n, mode):
        return GroupedVectorEnv(task, n, device=device, autoreset_mode=mode)

    assert len(check_vector(make, num_envs=5, steps=12)) == 7


def test_episodes_of_one_are_those_of_its_models(file, device):
    task = task_in(file, randomise={RADIUS: RADII})
    env, alone = GroupedEnv(task, device=device), [Env(one, device=device) for one in group_tasks(task)]
    check_env(env, skip_render_check=True)
    action = np.full(2, 0.5, dtype=np.float32)
    for episode in range(6):
        seen, _ = env.reset(seed=7 if episode == 0 else None)
        one = alone[group_of(7, episode, 3)]
        wanted, _ = one.reset(seed=(7 + episode * int(NEXT_EPISODE)) % 2**32)
        assert env.now.task.load() == one.task.load()
        for _ in range(3):
            assert np.array_equal(seen, wanted)
            seen, reward, *_ = env.step(action)
            wanted, earned, *_ = one.step(action)
            assert reward == earned
    env.close()


@pytest.mark.quick
def test_models_come_up_equally_often():
    """Of 3,000 episodes 1,000 each, standard deviation √(n p q) = 26."""
    counts = np.bincount([group_of(seed, episode, 3) for seed in range(60) for episode in range(50)])
    assert np.all(np.abs(counts - 1000) < 5.0 * np.sqrt(3000 * (1 / 3) * (2 / 3)))


def test_larger_beads_lag_behind_by_their_drag(file, device):
    """A bead without noise follows its trap at v by 6πηav/k, in environments of each model."""
    scene = Scene.load(file)
    still = dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, brownian=False))
    envs = GroupedVectorEnv(
        task_in(file, scene=still, shifts=(), goal=FAR, randomise={RADIUS: RADII}), 3, device=device
    )
    envs.reset(seed=0)
    for _ in range(4):
        envs.step(np.tile(np.float32([0.0, 1.0]), (3, 1)))
    for env, radius in zip(envs.envs, (0.8, 1.0, 1.2), strict=True):
        lag = (env.batch.sim.control.trap_position.numpy() - env.batch.sim.state.position.numpy())[0, 0, 1]
        speed, stiffness = env.task.speed_limit, 10.0
        assert lag == pytest.approx(6.0 * np.pi * scene.medium.viscosity * radius * speed / stiffness, rel=1e-3)


def test_tensors_and_arrays_say_the_same(file, device):
    torch = pytest.importorskip("torch")
    task = task_in(file, randomise={RADIUS: RADII})
    arrays, tensors = (
        GroupedVectorEnv(task, 4, device=device, arrays=kind, autoreset_mode="SameStep") for kind in ("numpy", "torch")
    )
    seen, also = arrays.reset(seed=3)[0], tensors.reset(seed=3)[0]
    action = np.full((4, 2), 0.8, dtype=np.float32)
    for _ in range(25):
        assert np.array_equal(seen, also.cpu().numpy())
        seen, reward, *_, told = arrays.step(action)
        also, earned, *_, same = tensors.step(torch.as_tensor(action, device=also.device))
        assert np.array_equal(reward, earned.cpu().numpy())
        if "final_obs" in told:
            assert np.array_equal(told["final_obs"], same["final_obs"].cpu().numpy())


def test_a_rollout_is_that_of_the_environments(file, device):
    """Environment i has model i modulo their number, in however many blocks they run."""
    task = task_in(file, randomise={RADIUS: RADII})
    still = policy_of(task, "still")
    whole = run_policy(task, still, episodes=7, seed=3, device=device)
    blocks = run_policy(task, still, episodes=7, seed=3, worlds=2, device=device)
    for name in ("success", "outcome", "earned", "periods"):
        assert np.array_equal(getattr(whole, name), getattr(blocks, name))
    for i in (0, 4):
        one = run_policy(group_tasks(task)[i % 3], still, episodes=1, seed=3 + i, device=device)
        assert one.earned[0] == whole.earned[i]


def test_gymnasium_makes_them(device):
    radius = studies.values([0.9, 1.1], unit="µm")
    how = {"randomise": {"/World/robot/sphere.radius": radius}, "device": device}
    env = gymnasium.make("otwarp/Navigate-v0", **how).unwrapped
    many = gymnasium.make_vec("otwarp/Navigate-v0", num_envs=2, vectorization_mode="vector_entry_point", **how)
    assert isinstance(env, GroupedEnv) and isinstance(many.unwrapped, GroupedVectorEnv)
    # Gymnasium's checker makes one of each of them
    assert env.metadata["render_modes"] == ["rgb_array"]
    assert env.reset(seed=1)[0].shape == many.reset(seed=1)[0].shape[1:]


def test_refused_actions_and_steps_change_nothing(file):
    task = task_in(file, randomise={RADIUS: RADII}, time_limit=0.1, goal=FAR)
    one, other = (GroupedVectorEnv(task, 4, device="cpu", autoreset_mode="Disabled") for _ in range(2))
    action = np.full((4, 2), 0.5, dtype=np.float32)
    with pytest.raises(InputError, match="before the first reset"):
        one.step(action)
    one.reset(seed=0), other.reset(seed=0)
    bad = action.copy()
    bad[3, 1] = np.nan
    with pytest.raises(InputError, match=r"action \(3, 1\) is nan"):
        one.step(bad)
    with pytest.raises(InputError, match=r"of shape \(3, 2\); allowed: floating-point numbers of shape \(4, 2\)"):
        one.step(action[:3])
    for _ in range(2):
        assert np.array_equal(one.step(action)[0], other.step(action)[0])
    one.reset(options={"reset_mask": np.array([True, True, False, True])})
    with pytest.raises(InputError, match="step of environment 2, whose episode is over"):
        one.step(action)


def test_refused_options_of_a_reset_change_nothing(file):
    task = task_in(file, randomise={RADIUS: RADII}, time_limit=0.1, goal=FAR)
    env, other = (GroupedEnv(task, device="cpu") for _ in range(2))
    assert np.array_equal(env.reset(seed=4, options={})[0], other.reset(seed=4)[0])
    made = len(env._envs)
    seed = next(n for n in range(20) if group_of(n, 0, 3) != group_of(4, 0, 3))
    for wrong, said in (({"where": 1}, "'where'"), (3, "3"), ([], r"\[\]")):
        with pytest.raises(InputError, match=f"^option {said} of reset is unknown; allowed: none$"):
            env.reset(seed=seed, options=wrong)  # type: ignore[arg-type]
    assert len(env._envs) == made
    assert np.array_equal(env.reset()[0], other.reset()[0])


def test_pictures_are_those_of_the_environments(file):
    task = task_in(file, randomise={RADIUS: RADII})
    envs = GroupedVectorEnv(task, 4, device="cpu", render_mode="rgb_array", render_envs=(3, 1))
    envs.reset(seed=2)
    alone = VectorEnv(group_tasks(task)[1], 1, device="cpu", render_mode="rgb_array")
    alone.reset(seed=3)
    pictures = envs.render()
    assert len(pictures) == 2 and np.array_equal(pictures[1], alone.render()[0])


def test_pictures_show_the_values_of_their_scene(file, tmp_path):
    """As of a file that has them: a bead of another size, a pillar at another place; in whatever order they came."""
    pillar, place = f"{PILLAR}.xformOp:translate", (-3.0, 6.0, HEIGHT)
    places = studies.values([(-3.0, 3.0, HEIGHT), place], unit="µm")
    sizes = studies.values([1.0, 2.0], unit="µm")
    both = group_tasks(task_in(file, randomise={(RADIUS, pillar): (sizes, places)}))[1]
    (sized,) = group_tasks(task_in(file, randomise={RADIUS: studies.values([2.0], unit="µm")}))
    then = group_tasks(dataclasses.replace(sized, randomise={pillar: places}))[1]
    scene = _with_radius(bead_scene(), 2.0)
    moved = [dataclasses.replace(o, position=Track.constant(place)) if o.prim == PILLAR else o for o in scene.obstacles]
    written = task_in(saved(dataclasses.replace(scene, obstacles=tuple(moved)), tmp_path / "beads.usda"))
    shown = []
    for one in (written, both, then, task_in(file)):
        env = Env(one, render_mode="rgb_array")
        env.reset(seed=1)
        shown.append(env.render())
    assert np.array_equal(shown[1], shown[0]) and np.array_equal(shown[2], shown[0])
    assert np.any(shown[3] != shown[0])
    with pytest.warns(PlausibilityWarning, match=f"have {BEAD} shown as in"):
        Env(task_in(file, scene=_with_radius(Scene.load(file), 2.0)), render_mode="rgb_array")


def test_wrapped_ones_are_checked_beside_a_list_of_single_ones(file, device):
    task = task_in(file, randomise={RADIUS: RADII}, time_limit=0.1)

    def make(n, mode):
        return gymnasium.vector.VectorWrapper(GroupedVectorEnv(task, n, device=device, autoreset_mode=mode))

    with pytest.raises(InputError, match="single is None, where scenes of wrapped environments differ"):
        check_vector(make, steps=3, num_envs=2)
    singles = partial(list, [Env(one, device=device) for one in group_tasks(task)])
    assert len(check_vector(make, single=singles, steps=3, num_envs=2)) == 7


@pytest.mark.quick
@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda t: VectorEnv(t, 2, device="cpu"), "GroupedEnv and GroupedVectorEnv of otwarp.envs"),
        (lambda t: GroupedEnv(t, render_mode="human"), "render_mode is 'human'"),
        (lambda t: GroupedEnv(t, render_mode="ansi"), "render_mode is 'ansi', where scenes of tests/Bead-v0 differ"),
        (lambda t: GroupedVectorEnv(t, 2, render_envs=(2,)), "render_envs is 2; allowed"),
        (lambda t: GroupedVectorEnv(t, 0), "num_envs is 0; allowed"),
        (
            lambda t: group_tasks(
                dataclasses.replace(t, randomise={"speed:/World/trap": studies.values([1.0], unit="µm/s")})
            ),
            "axis speed:/World/trap: /World/trap stands still",
        ),
        (
            lambda t: group_tasks(dataclasses.replace(t, randomise={f"{BEAD}/sphere.radios": RADII})),
            "has no attribute radios; did you mean radius?",
        ),
        (lambda t: group_tasks(dataclasses.replace(t, scene=bead_scene())), "has no file"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(file, make, said):
    task = task_in(file, randomise={RADIUS: RADII})
    with pytest.raises(InputError) as error:
        partial(make, task)()
    assert said in str(error.value) and "\n" not in str(error.value)
