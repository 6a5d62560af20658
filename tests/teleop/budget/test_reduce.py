"""The reduced scene: what stays, freezes and leaves, in which order, with a machine whose costs are arithmetic."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.laws import TrapLaw
from otwarp.scene import Body, Flow, Goal, Material, Obstacle, Rod, Scene, Settings, Sphere, Track, Trap
from otwarp.scene.flow_profile import flow_velocity
from otwarp.simulation.simulation import Simulation
from otwarp.teleop.budget import AUTO_SHARE, WORST_ERROR, parse_budget, reduce_scene, round_down
from otwarp.teleop.budget.reach import PATH_STEP, Reach, frozen_body, thin_out
from otwarp.teleop.budget.report import BudgetReport, SceneCost, measure_scene

SOFT = Material(youngs_modulus=1000.0, poisson_ratio=0.45)


def bead(x: float, **about) -> Body:
    sphere = Sphere(prim="/World/bead/s", radius=1.5)
    return Body(**({"prim": "/World/bead", "position": (x, 0.0, 0.0), "spheres": (sphere,)} | about))


def cell(x: float, y: float = 0.0, index: int = 0, **about) -> Body:
    sphere = Sphere(prim="/World/Cells/proto/s", radius=3.0, trapped=False)
    kind = {"kind": "cell", "instance": index, "prim": "/World/Cells", "material": SOFT}
    return Body(**(kind | {"position": (x, y, 0.0), "spheres": (sphere,)} | about))


def trap(x: float = 0.0, **about) -> Trap:
    law = TrapLaw(stiffness=10.0, threshold=1.0, cutoff=1.0)
    fixed = {"prim": "/World/trap", "position": Track.constant((x, 0.0, 0.0)), "power": Track.constant(20.0)}
    return Trap(**(fixed | {"radial": law, "hand": "left"} | about))


def line_of_cells(count: int, spacing: float = 10.0, **about) -> Scene:
    """A bead in a trap at 0 and cells at `spacing`, 2·`spacing`, … to the right, not touching."""
    cells = tuple(cell(spacing * (i + 1), index=i) for i in range(count))
    fixed = {"bodies": (bead(0.0), *cells), "traps": (trap(),), "settings": Settings(duration=1.0, brownian=False)}
    return Scene(**(fixed | about))


class Machine:
    """A machine on which a step takes a time per body and one per obstacle, and the step length follows accuracy."""

    def __init__(self, per_body: float, *, per_obstacle: float = 0.0, limit: float = math.inf, frame: float = 0.0):
        self.per_body, self.per_obstacle, self.limit, self.frame = per_body, per_obstacle, limit, frame
        self.seen: list[Scene] = []

    def __call__(self, scene: Scene, *, device: str | None, speed: float, rate: float) -> SceneCost:
        self.seen.append(scene)
        wanted = scene.settings.time_step or 1e-3 * math.sqrt(scene.settings.accuracy / 0.01)
        step = min(wanted, self.limit)
        return SceneCost(
            bodies=len(scene.bodies),
            driver="grid" if len(scene.bodies) > 24 else "world",
            time_step=step,
            largest_stable=1e-2,
            error=0.9 * scene.settings.accuracy,
            chosen_by="something" if step < wanted else "accuracy",
            step=self.per_body * len(scene.bodies) + self.per_obstacle * len(scene.obstacles),
            frame=self.frame,
        )


def far_of(report: BudgetReport) -> set[str]:
    return {*report.frozen, *report.left}


class TestCost:
    def test_load_counts_steps_and_frames(self):
        cost = Machine(1e-5, frame=1e-4)(Scene(bodies=(bead(0.0),)), device=None, speed=1.0, rate=100.0)
        # 1000 steps of 10 µs and 100 frames of 100 µs in a second
        assert cost.load(1.0, 100.0) == pytest.approx(0.02)
        # slower than one step per frame, every step is read out
        assert cost.load(0.05, 100.0) == pytest.approx(50 * 1.1e-4)

    @pytest.mark.parametrize("share", [1e-3, 0.011, 0.02, 0.7])
    def test_speed_is_the_inverse_of_load(self, share):
        cost = Machine(1e-5, frame=1e-4)(Scene(bodies=(bead(0.0),)), device=None, speed=1.0, rate=100.0)
        assert cost.load(cost.speed(share, 100.0), 100.0) == pytest.approx(share)


class TestReach:
    def test_what_is_within_is_told_by_surfaces(self):
        scene = line_of_cells(6)
        reach = Reach.of(scene, sweep=20.0)
        # focus 20 µm out, the bead it carries 1.5 µm more; a cell of 3 µm at 24.5 µm would be touched just so
        assert reach.carried == pytest.approx(1.5)
        assert np.allclose(reach.gap[1:], np.arange(10.0, 61.0, 10.0) - 20.0 - 1.5 - 3.0)

    def test_a_speed_limit_shortens_the_sweep(self):
        scene = line_of_cells(2, traps=(trap(speed_limit=4.0),), settings=Settings(duration=2.0, brownian=False))
        assert Reach.of(scene).sweep == pytest.approx(8.0)

    def test_the_whole_path_of_a_trap_counts(self):
        track = Track(times=np.array([0.0, 1.0]), values=np.array([[0.0, 0.0, 0.0], [0.0, 50.0, 0.0]]))
        scene = line_of_cells(0, traps=(trap(position=track),), bodies=(bead(0.0), cell(9.0, 49.0), cell(9.0, -30.0)))
        gap = Reach.of(scene, sweep=5.0).gap
        assert gap[1] == pytest.approx(9.0 - 5.0 - 1.5 - 3.0, abs=1.1 * PATH_STEP)
        assert gap[2] > 15.0

    def test_the_flow_brings_cells_from_upstream(self):
        flow = Flow(prim="/World/flow", kind="uniform", speed=40.0)
        scene = line_of_cells(0, bodies=(bead(0.0), cell(-90.0, index=0), cell(90.0, index=1)), flow=flow)
        gap = Reach.of(scene, sweep=20.0, horizon=2.0).gap
        assert gap[1] == pytest.approx(10.0 - 20.0 - 1.5 - 3.0)
        assert gap[2] == pytest.approx(90.0 - 20.0 - 1.5 - 3.0)

    def test_poiseuille_flow_is_still_at_the_plates(self):
        flow = Flow(prim="/World/flow", kind="poiseuille", origin=(0.0, 0.0, 10.0), speed=40.0, half_height=10.0)
        place = np.array([[0.0, 0.0, 10.0], [5.0, 0.0, 15.0], [0.0, 0.0, 0.0], [0.0, 0.0, 40.0]])
        found = flow_velocity(flow, place)
        assert np.allclose(found, [[40, 0, 0], [30, 0, 0], [0, 0, 0], [0, 0, 0]])

    def test_heat_and_weight_roam(self):
        still = line_of_cells(1)
        hot = dataclasses.replace(still, settings=Settings(duration=1.0))
        heavy = dataclasses.replace(still, settings=Settings(duration=1.0, gravity=True))
        assert Reach.of(still).roam[1] == 0.0
        # 3·√(2 D t), D = k_B T/(6πηr)
        assert Reach.of(hot).roam[1] == pytest.approx(
            3.0 * math.sqrt(2.0 * 4.116e-3 / (6 * math.pi * 8.9e-4 * 3.0)), rel=1e-3
        )
        assert Reach.of(heavy).roam[1] > Reach.of(hot).roam[1]

    def test_without_traps_the_middle_counts(self):
        scene = Scene(bodies=tuple(cell(x, index=i) for i, x in enumerate((0.0, 10.0, 50.0))))
        reach = Reach.of(scene)
        assert reach.anchor == "the middle of the bodies"
        assert np.argmax(reach.gap) == 2

    @pytest.mark.parametrize("what", [{"sweep": -1.0}, {"sweep": math.nan}, {"horizon": math.inf}])
    def test_bad_numbers_are_refused(self, what):
        with pytest.raises(InputError, match=next(iter(what))):
            Reach.of(line_of_cells(1), **what)


class TestFreeze:
    def test_a_sphere_stays_where_it_was(self):
        turned = (0.0, 0.0, math.sin(math.pi / 4), math.cos(math.pi / 4))
        ball = Sphere(prim="/World/c/s", offset=(1.0, 0.0, 0.0), radius=2.0)
        (found,) = frozen_body(cell(5.0, index=7, orientation=turned, spheres=(ball,)))
        assert (found.prim, found.shape, found.size) == ("/World/Cells[7]", "sphere", (2.0, 0.0, 0.0))
        assert np.allclose(found.position.values, [[5.0, 1.0, 0.0]])

    @pytest.mark.parametrize("end", [(0.0, 4.0, 0.0), (0.0, 0.0, 4.0), (0.0, 0.0, -4.0), (1.0, -2.0, 3.0)])
    def test_a_rod_becomes_a_capsule_along_it(self, end):
        rod = Rod(prim="/World/c/r", start=(0.0, 0.0, 0.0), end=end, radius=0.5)
        ball = Sphere(prim="/World/c/s", radius=1.0, collides=False)
        (found,) = frozen_body(cell(2.0, spheres=(ball,), rods=(rod,)))
        x, y, z, w = found.orientation.values[0]
        axis = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
        assert found.shape == "capsule"
        assert np.allclose(axis * 2.0 * found.size[1], end)
        assert np.allclose(found.position.values[0], np.array([2.0, 0.0, 0.0]) + 0.5 * np.array(end))

    def test_only_what_can_be_touched_freezes(self):
        scene = line_of_cells(12, spacing=6.5)
        reach = Reach.of(scene, sweep=20.0)
        keep = [i for i in range(13) if reach.gap[i] <= 0.0]
        thinned = thin_out(scene, keep, reach)
        # a trap that pushes a cell to the edge of its reach touches what is a cell's diameter beyond
        assert thinned.frozen == tuple(i for i in range(13) if 0.0 < reach.gap[i] <= 6.0)
        assert thinned.frozen
        assert sorted(thinned.kept + thinned.frozen + thinned.left) == list(range(13))
        assert len(thinned.scene.obstacles) == len(thinned.frozen)

    def test_cells_in_a_stream_leave(self):
        flow = Flow(prim="/World/flow", kind="uniform", speed=50.0)
        scene = line_of_cells(12, spacing=6.5, flow=flow)
        thinned = thin_out(scene, range(4), Reach.of(scene, sweep=20.0))
        assert (thinned.frozen, len(thinned.left)) == ((), 9)

    def test_what_does_not_collide_leaves(self):
        ghost = Sphere(prim="/World/Cells/proto/s", radius=3.0, collides=False)
        scene = line_of_cells(0, bodies=(bead(0.0), cell(26.0, spheres=(ghost,))))
        assert thin_out(scene, [0], Reach.of(scene, sweep=20.0)).left == (1,)

    @pytest.mark.thorough
    def test_a_frozen_cell_is_a_wall(self, device):
        """A bead pressed on a frozen cell comes to rest on its surface; the scene has the cell as an obstacle."""
        wall = frozen_body(cell(4.0))[0]
        law = TrapLaw(stiffness=5.0, threshold=20.0, cutoff=20.0)
        scene = Scene(
            bodies=(bead(-2.0),),
            traps=(trap(0.5, radial=law),),
            obstacles=(wall,),
            settings=Settings(duration=1.0, brownian=False),
        )
        sim = Simulation(scene, device=device)
        sim.run(0.5)
        # 4.5 µm between the centres when they touch; 3 pN press a bead of 1 MPa in by some nanometres
        assert sim.prim_poses()[0][0, 0, 0] == pytest.approx(-0.5, abs=0.02)
        assert sim.readout.contact_load.numpy()[0, 0] > 1.0


class TestOrder:
    def test_everything_stays_if_it_fits(self):
        scene = line_of_cells(30)
        machine = Machine(AUTO_SHARE * 1e-3 / 31)
        found = reduce_scene(scene, measure=machine)
        assert found.scene is scene
        assert not found.report.reduced and found.report.fits
        assert len(machine.seen) == 1
        assert "nothing was left out" in found.report.lines()[-1]

    def test_the_farthest_go_first_and_no_more_than_needed(self):
        scene = line_of_cells(99)
        found = reduce_scene(scene, budget=0.5, measure=Machine(1e-5), sweep=20.0)
        report = found.report
        # 100 bodies take 1.0 of a core, 50 fit into the half
        assert 42 <= report.kept <= 50
        assert report.fits and report.after.load(1.0) <= 0.5
        assert far_of(report) == {f"/World/Cells[{i}]" for i in range(report.kept - 1, 99)}
        assert report.accuracy == (0.01, 0.01)
        assert len(report.log) <= 5

    def test_what_traps_can_reach_always_stays(self):
        scene = line_of_cells(40, spacing=6.5)
        found = reduce_scene(scene, budget=0.01, measure=Machine(1e-5), sweep=30.0)
        names = {body.name for body in found.scene.bodies}
        assert {
            body.name for body, gap in zip(scene.bodies, Reach.of(scene, sweep=30.0).gap, strict=True) if gap <= 0
        } == names
        assert not found.report.fits

    def test_robots_the_goal_and_what_is_held_stay_however_far(self):
        goal = Goal(
            prim="/World/goal", position=(0.0, 0.0, 0.0), cell="/World/target", robots=("/World/bead",), tolerance=1.0,
            lost_distance=1.0, cell_lost_distance=1.0, distance_warning=1.0,
        )  # fmt: skip
        held = Sphere(prim="/World/held/s", radius=1.0)
        bodies = (
            bead(0.0),
            bead(900.0, prim="/World/other"),
            cell(800.0, prim="/World/target", instance=None),
            cell(700.0, prim="/World/held", instance=None, spheres=(held,)),
            cell(600.0, index=0),
        )
        scene = Scene(bodies=bodies, traps=(trap(holds="/World/held/s"),), goal=goal)
        found = reduce_scene(scene, budget=0.5, measure=Machine(1.5e-4))
        assert [body.name for body in found.scene.bodies] == [body.name for body in bodies[:4]]

    def test_frozen_cells_leave_if_they_cost_too_much(self):
        scene = line_of_cells(40, spacing=6.5)
        machine = Machine(1e-5, per_obstacle=1e-3)
        found = reduce_scene(scene, budget=0.1, measure=machine, sweep=20.0)
        assert any(len(seen.obstacles) for seen in machine.seen)
        assert found.report.frozen == () and found.report.left and found.report.fits

    def test_the_accuracy_comes_after_the_bodies(self):
        scene = line_of_cells(3)
        found = reduce_scene(scene, budget=0.5, measure=Machine(2e-4), sweep=100.0)
        # 4 bodies take 0.8; no cell is beyond reach; a step 1.6 to 1.9 times as long fits
        assert not far_of(found.report)
        assert 0.01 < found.scene.settings.accuracy < WORST_ERROR
        assert found.report.fits and found.report.after.error <= WORST_ERROR
        assert any("accuracy lowered" in line and "predicted error" in line for line in found.report.lines())

    def test_an_authored_time_step_gives_way_last(self):
        scene = line_of_cells(3, settings=Settings(time_step=5e-4, brownian=False))
        found = reduce_scene(scene, budget=0.5, measure=Machine(2e-4), sweep=100.0)
        assert found.scene.settings.time_step is None
        assert found.report.fits

    def test_slow_motion_is_what_remains_and_is_said(self):
        scene = line_of_cells(3)
        found = reduce_scene(scene, budget=0.5, measure=Machine(2e-3), sweep=100.0)
        report = found.report
        # 8 ms a step of √5 ms
        assert report.speed == pytest.approx(0.5 * math.sqrt(5.0) / 8.0, rel=0.1)
        assert report.after.load(report.speed) <= 0.5
        assert found.scene.settings.accuracy == WORST_ERROR
        assert any("slow motion" in line and "does not slip" in line for line in report.lines())

    def test_fewer_bodies_that_bring_nothing_are_not_taken(self):
        class Obstinate(Machine):
            def __call__(self, scene: Scene, *, device: str | None, speed: float, rate: float) -> SceneCost:
                found = super().__call__(scene, device=device, speed=speed, rate=rate)
                return dataclasses.replace(found, step=2e-3)

        found = reduce_scene(line_of_cells(40), budget=0.5, measure=Obstinate(1.0), sweep=20.0)
        assert not far_of(found.report) and found.report.kept == 41
        assert any("bring nothing" in line for line in found.report.log)

    def test_a_step_limited_otherwise_keeps_its_accuracy(self):
        scene = line_of_cells(3)
        found = reduce_scene(scene, budget=0.5, measure=Machine(2e-4, limit=1e-3), sweep=100.0)
        assert found.scene.settings.accuracy == 0.01
        assert found.report.speed == pytest.approx(0.62)
        assert any("something" in line for line in found.report.log)

    def test_no_accuracy_worse_than_the_authored_one_is_invented(self):
        scene = line_of_cells(3, settings=Settings(accuracy=0.2, brownian=False))
        found = reduce_scene(scene, budget=0.1, measure=Machine(2e-3), sweep=100.0)
        assert found.scene.settings.accuracy == 0.2

    def test_a_crowd_stays_one_if_that_fits_and_falls_to_few_if_not(self):
        machine = Machine(1e-5)
        crowd = reduce_scene(line_of_cells(60), budget=0.4, measure=machine, sweep=1.0)
        assert min(len(s.bodies) for s in machine.seen) == 25
        few = reduce_scene(line_of_cells(60), budget=0.1, measure=Machine(1e-5), sweep=1.0)
        assert crowd.report.kept > 24 >= few.report.kept
        assert few.report.fits

    def test_a_crowd_without_traps_is_thinned_about_its_middle(self):
        scene = Scene(bodies=tuple(cell(10.0 * i, index=i) for i in range(101)), settings=Settings(brownian=False))
        found = reduce_scene(scene, budget=0.5, measure=Machine(1e-5))
        kept = [body.instance for body in found.scene.bodies if body.instance is not None]
        assert kept == list(range(kept[0], kept[-1] + 1))
        assert abs(0.5 * (kept[0] + kept[-1]) - 50.0) <= 0.5
        assert "no traps" in " ".join(found.report.lines())

    def test_a_lone_body_is_never_taken_away(self):
        found = reduce_scene(Scene(bodies=(cell(0.0),)), budget=0.5, measure=Machine(1.0))
        assert len(found.scene.bodies) == 1 and not found.report.fits

    def test_it_is_the_same_every_time(self):
        a, b = (reduce_scene(line_of_cells(99), budget=0.5, measure=Machine(1e-5), sweep=20.0) for _ in range(2))
        assert a.scene == b.scene and a.report == b.report


class TestReport:
    def test_off_measures_nothing(self):
        machine = Machine(1.0)
        found = reduce_scene(line_of_cells(3), budget="off", measure=machine)
        assert machine.seen == [] and found.report.lines()[0].startswith("budget off")
        assert json.loads(json.dumps(found.report.to_json()))["budget"] == "off"

    def test_json_groups_instances_and_is_finite(self):
        scene = line_of_cells(99, obstacles=(Obstacle(
            prim="/World/floor", shape="plane", position=Track.constant((0.0, 0.0, -50.0)),
            orientation=Track.constant((0.0, 0.0, 0.0, 1.0))),))  # fmt: skip
        report = reduce_scene(scene, budget=0.5, measure=Machine(1e-5), sweep=20.0).report
        data = json.loads(json.dumps(report.to_json(), allow_nan=False))
        assert sum(len(data[n].get("/World/Cells", [])) for n in ("frozen", "left")) == 100 - report.kept
        assert data["after"]["load"] <= 0.5 and data["fits"] is True

    def test_progress_tells_each_measurement(self):
        lines: list[str] = []
        report = reduce_scene(
            line_of_cells(99), budget=0.5, measure=Machine(1e-5), sweep=20.0, progress=lines.append
        ).report
        assert len(lines) == len(report.log)
        assert all(line.startswith("measuring") for line in lines)

    @pytest.mark.parametrize(
        ("value", "down"), [(0.756, 0.75), (0.62, 0.62), (1.0, 1.0), (0.0123, 0.012), (12.9, 12.0)]
    )
    def test_speeds_are_rounded_down(self, value, down):
        assert round_down(value) == pytest.approx(down)

    @pytest.mark.parametrize(("text", "value"), [("auto", "auto"), (" OFF ", "off"), ("0.5", 0.5), ("1", 1.0)])
    def test_budgets_as_typed(self, text, value):
        assert parse_budget(text) == value

    @pytest.mark.parametrize("text", ["", "much", "0", "-1", "1.5", "nan", "inf", "5e-324"])
    def test_bad_budgets_are_one_line(self, text):
        with pytest.raises(InputError, match="budget is") as caught:
            reduce_scene(line_of_cells(1), budget=text, measure=Machine(1.0))
        assert "\n" not in str(caught.value)

    @pytest.mark.parametrize("speed", [0.0, -1.0, math.nan, math.inf])
    def test_bad_speeds_are_refused(self, speed):
        with pytest.raises(InputError, match="speed"):
            reduce_scene(line_of_cells(1), speed=speed, measure=Machine(1.0))


class TestRealMeasurement:
    def test_a_scene_is_measured(self, device):
        scene = line_of_cells(0)
        cost = measure_scene(scene, device=device, seconds=0.02)
        sim = Simulation(scene, device=device)
        assert (cost.bodies, cost.driver) == (1, sim.model.features.driver)
        assert cost.time_step == sim.time_step < cost.largest_stable
        assert 0.0 < cost.error <= 1.01 * scene.settings.accuracy
        assert cost.step > 0.0 and cost.frame > 0.0

    @pytest.mark.thorough
    def test_a_scene_is_reduced_by_the_real_machine(self, device):
        """A share that no machine keeps: every step of the order is taken, and what comes out can be stepped."""
        scene = line_of_cells(2, spacing=6.5)

        def quick(scene: Scene, *, device: str | None, speed: float, rate: float) -> SceneCost:
            found = measure_scene(scene, device=device, speed=speed, rate=rate, seconds=0.02)
            # what the clock says is not for tests
            return dataclasses.replace(found, step=1e-5 * len(scene.bodies), frame=1e-5)

        found = reduce_scene(scene, device=device, budget=1e-7, measure=quick, sweep=0.0)
        assert far_of(found.report) == {"/World/Cells[0]", "/World/Cells[1]"}
        assert 0.0 < found.report.speed < 1.0 and not found.report.fits
        sim = Simulation(found.scene, device=device)
        sim.step(5)
        assert np.isfinite(sim.state.position.numpy()).all()
