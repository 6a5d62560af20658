"""A task for tests: a bead in a trap, past pillars and a moving cube, to a goal that differs between episodes."""

from __future__ import annotations

import numpy as np

from otwarp.envs import terms as t
from otwarp.envs.task import Hand, Shift, Task
from otwarp.scene import Body, Obstacle, Scene, SceneBuilder, Settings, Sphere, Track, Trap, TrapLaw

HEIGHT = 5.0
"""Of bead and trap above the floor [µm]."""
BEAD, TRAP = "/World/bead", "/World/trap"
PILLARS = {"/World/Obstacles/pillar_a": (-3.0, 3.0, 2.0), "/World/Obstacles/pillar_b": (4.0, -3.5, 2.5)}
"""x, y and radius [µm]."""
CUBE = "/World/Obstacles/cube"


def scene() -> Scene:
    """The bead on the left, the goal on the right, pillars and a cube that goes up and down between them."""
    still = Track.constant((0.0, 0.0, 0.0, 1.0))
    builder = SceneBuilder(settings=Settings(duration=20.0))
    bead = Sphere(prim=f"{BEAD}/sphere", radius=1.0, refractive_index=1.59, collides=False)
    builder.add(Body(prim=BEAD, position=(-10.0, 0.0, HEIGHT), spheres=(bead,), density=1050e-12))
    law = TrapLaw(stiffness=2.0, power=1.0)
    place, power = Track.constant((-10.0, 0.0, HEIGHT)), Track.constant(5.0)
    builder.add(
        Trap(prim=TRAP, position=place, power=power, model="harmonic", radial=law, hand="right", holds=f"{BEAD}/sphere")
    )
    for prim, (x, y, radius) in PILLARS.items():
        where = Track.constant((x, y, HEIGHT))
        builder.add(Obstacle(prim=prim, shape="cylinder", position=where, orientation=still, size=(radius, HEIGHT, 0)))
    times = np.linspace(0.0, 20.0, 81)
    way = np.stack([np.full(81, 0.5), 6.0 * np.sin(2 * np.pi * times / 8.0), np.full(81, HEIGHT)], axis=1)
    turn = Track(times=times, values=np.tile((0.0, 0.0, 0.0, 1.0), (81, 1)))
    cube = Obstacle(prim=CUBE, shape="box", position=Track(times=times, values=way), orientation=turn, size=(1, 1, 1))
    builder.add(cube)
    return builder.scene()


def task() -> Task:
    """The task."""
    around = [
        t.obstacle_offset(body=BEAD, obstacle=prim, axes="xy", name=f"{prim.rsplit('/', 1)[-1]}_offset")
        for prim in (*PILLARS, CUBE)
    ]
    return Task(
        name="tests/Bead-v0",
        description="Bring a bead past two pillars and a moving cube to the goal.",
        scene=scene(),
        hands=(Hand(name="hand", traps=(TRAP,)),),
        observations=(
            t.goal_offset(body=BEAD, axes="xy"),
            t.body_velocity(body=BEAD, axes="xy"),
            t.trap_offset(trap=TRAP, axes="xy"),
            *around,
            t.obstacle_velocity(obstacle=CUBE, axes="xy", name="cube_velocity"),
        ),
        rewards=(
            t.progress(body=BEAD, weight=0.1),
            t.nearness(body=BEAD, margin=1.0, weight=-0.05),
            t.passing(weight=-0.05),
            t.arrival(body=BEAD, radius=1.0, weight=1.0),
        ),
        ends=(
            t.reached(body=BEAD, radius=1.0, success=True),
            t.collided(body=BEAD),
            t.lost(distance=2.0),
            t.strayed(body=BEAD, radius=40.0),
        ),
        shifts=(Shift(bodies=(BEAD,), traps=(TRAP,), half=(1.0, 6.0, 0.0)),),
        goal=(10.0, 0.0, HEIGHT),
        goal_half=(1.0, 6.0, 0.0),
    )
