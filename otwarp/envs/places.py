"""A task's scene as terms read it: spheres, held spheres, obstacles; and as its environments step it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import warp as wp

from otwarp.envs.kernels.geometry import tabulate_poses
from otwarp.envs.kernels.types import EpisodeData, PlaceData
from otwarp.envs.layout import Layout
from otwarp.envs.task import Task
from otwarp.scene import Scene, Track, Trap
from otwarp.simulation.model import Model
from otwarp.simulation.packing.arrays import device_array
from otwarp.simulation.packing.bodies import pack_obstacles


def stepped_scene(task: Task, scene: Scene) -> Scene:
    """The scene with the traps of hands at rest where they start: actions move them, not time samples.

    They have no speed limit where hands are no faster than it: a limit that is never met costs as much as one that is.
    """
    return replace(scene, traps=tuple(_led(task, trap) for trap in scene.traps), judged=True)


def limited_scene(task: Task, scene: Scene) -> Scene:
    """The same with traps that are as fast as hands are, which the time step follows from."""
    held = {prim for hand in task.hands for prim in hand.traps}
    speed = [min(t.speed_limit, task.speed_limit) if t.prim in held else t.speed_limit for t in scene.traps]
    traps = (replace(trap, speed_limit=limit) for trap, limit in zip(scene.traps, speed, strict=True))
    return replace(scene, traps=tuple(traps))


def _led(task: Task, trap: Trap) -> Trap:
    """A trap as hands take it over, if one does."""
    if all(trap.prim not in hand.traps for hand in task.hands):
        return trap
    place, power = Track.constant(trap.position.at(0.0)), Track.constant(float(trap.power.at(0.0)[0]))
    limit = math.inf if task.speed_limit <= trap.speed_limit else trap.speed_limit
    return replace(trap, position=place, power=power, speed_limit=limit)


def place_data(layout: Layout, model: Model) -> tuple[Any, list[wp.Mesh]]:
    """`PlaceData`, and the meshes that must outlive it."""
    task, scene, place = layout.task, model.scene, model.place
    device = place.device
    data = PlaceData()
    spheres = [
        [*(np.array(s.offset) - model.reference[b]), s.radius]
        for b, body in enumerate(scene.bodies)
        for s in body.spheres
    ]
    data.sphere_start = device_array([0, *np.cumsum([len(b.spheres) for b in scene.bodies])], wp.int32, device)
    data.sphere = device_array(spheres, wp.vec4, device)
    held = [
        np.array(scene.bodies[b].spheres[i].offset) - model.reference[b] if b >= 0 else np.zeros(3)
        for b, i in model.held
    ]
    data.held_body = device_array([b for b, _ in model.held], wp.int32, device)
    data.held_offset = device_array(held, wp.vec3, device)
    away = model.data.traps.equilibrium.numpy()[:, None] * model.data.traps.axis.numpy()
    data.equilibrium = device_array(away, wp.vec3, device)
    data.hand = device_array(layout.hand, wp.int32, device)
    data.obstacles, meshes = pack_obstacles(scene, True, place)
    last = max((float(o.position.times[-1]) for o in scene.obstacles), default=0.0)
    shape = 2 + math.ceil(min(last, task.time_limit) * task.rate), len(scene.obstacles)
    data.obstacle_position = wp.zeros(shape, dtype=wp.vec3, device=device)
    data.obstacle_rotation = wp.zeros(shape, dtype=wp.quat, device=device)
    poses = [wp.float64(1.0 / task.rate), data.obstacle_position, data.obstacle_rotation]
    wp.launch(tabulate_poses, dim=shape, inputs=[data.obstacles, *poses], device=device)
    if np.all(data.obstacle_rotation.numpy() == (0.0, 0.0, 0.0, 1.0)):
        data.obstacle_rotation = wp.zeros((shape[0], 0), dtype=wp.quat, device=device)
    data.watched = device_array(layout.watched(), wp.int32, device)
    data.flow_speed = model.data.flow.speed
    data.period, data.time_limit = 1.0 / task.rate, task.time_limit
    data.speed_limit = task.speed_limit
    data.low_power, data.high_power = task.power
    return data, meshes


def episode_data(layout: Layout, model: Model) -> Any:
    """`EpisodeData`, all zero, but for gaps, which are not known."""
    data, w, f = EpisodeData(), model.worlds, model.features
    traps, bodies, numbers = len(model.scene.traps), len(model.scene.bodies), len(layout.acted)
    shapes = {
        "goal": (w,), "focus": (w, traps), "power": (w, traps), "energy": (w,),
        "start": (w, bodies), "before": (w, bodies), "turned": (w, bodies if f.rigid else 0), "gap": (w, bodies),
        "action": (w, numbers),
        "last_action": (w, numbers), "period": (w,), "held": (w,), "number": (w,), "over": (w,), "over_count": (1,),
        "variant": (w,),
    }  # fmt: skip
    for name, shape in shapes.items():
        setattr(data, name, wp.zeros(shape, dtype=EpisodeData.vars[name].type.dtype, device=model.device))
    data.gap.fill_(math.nan)
    return data
