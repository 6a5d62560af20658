"""A small stage with every kind of thing a recording must handle, and frames whose every number is known.

The stage is in units of 0.5 µm, starts at time code 24 with 24 codes per second, and its bodies live below a turned,
shifted and scaled parent. It holds two robots, a cell between them, three instanced cells, two traps, a goal and a
moving obstacle.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from otwarp.scene import Scene
from otwarp.simulation.frame import Frame

HELD = ((0, 0), (1, 0))
RATE = 60.0

_ROBOT = """
        def Xform "{name}" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "OtBodyAPI"])
        {{
            double ot:body:warningForce = 1e-11
            float3 xformOp:translate = ({x}, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
            def Sphere "ball" (prepend apiSchemas = ["OtSphereAPI"])
            {{
                double radius = 1
                float3[] extent = [(-1, -1, -1), (1, 1, 1)]
            }}
        }}
"""

_TRAP = """
        def Xform "{name}" (prepend apiSchemas = ["OtTrapAPI", "OtTrapLawAPI:isotropic"])
        {{
            token ot:trap:model = "harmonic"
            rel ot:trap:holds = </World/Group/{holds}/ball>
            double ot:trapLaw:isotropic:stiffness = 1e-6
            double ot:trapLaw:isotropic:cutoff = 2e-6
            double3 xformOp:translate = ({x}, 0, 20)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }}
"""

_STAGE = f"""#usda 1.0
(
    defaultPrim = "World"
    startTimeCode = 24
    endTimeCode = 48
    timeCodesPerSecond = 24
    framesPerSecond = 24
    metersPerUnit = 5e-7
    kilogramsPerUnit = 1e-15
    upAxis = "Z"
)

def Xform "World" (prepend apiSchemas = ["OtSceneAPI"])
{{
    def Xform "Group"
    {{
        double3 xformOp:translate = (0, 0, 20)
        quatd xformOp:orient = (0.7071067811865476, 0, 0, 0.7071067811865476)
        double3 xformOp:scale = (2, 2, 2)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient", "xformOp:scale"]
{_ROBOT.format(name="left", x=-4)}
{_ROBOT.format(name="right", x=4)}
        def Sphere "cell" (prepend apiSchemas = ["OtCellAPI"])
        {{
            double ot:cell:warningForce = 5e-12
            double radius = 1.5
            float3[] extent = [(-1.5, -1.5, -1.5), (1.5, 1.5, 1.5)]
        }}
    }}
    def PointInstancer "Crowd"
    {{
        double3 xformOp:translate = (0, 40, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        int[] protoIndices = [0, 0, 0]
        point3f[] positions = [(0, 0, 10), (10, 0, 10), (20, 0, 10)]
        rel prototypes = [</World/Crowd/Cell>]
        def Sphere "Cell" (prepend apiSchemas = ["OtCellAPI"])
        {{
            double radius = 2
            float3[] extent = [(-2, -2, -2), (2, 2, 2)]
        }}
    }}
    def Xform "Traps"
    {{
{_TRAP.format(name="left", holds="left", x=-8)}
{_TRAP.format(name="right", holds="right", x=8)}
    }}
    def Cube "block" (prepend apiSchemas = ["PhysicsCollisionAPI"])
    {{
        double size = 4
        float3[] extent = [(-2, -2, -2), (2, 2, 2)]
        double3 xformOp:translate.timeSamples = {{ 24: (40, 0, 20), 48: (64, 0, 20) }}
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
    def Xform "goal" (prepend apiSchemas = ["OtGoalAPI"])
    {{
        rel ot:goal:cell = </World/Group/cell>
        rel ot:goal:robots = [</World/Group/left>, </World/Group/right>]
        double ot:goal:tolerance = 1e-6
        double ot:goal:lostDistance = 3e-6
        double ot:goal:cellLostDistance = 4e-6
        double ot:goal:distanceWarning = 1e-6
        double3 xformOp:translate = (0, -60, 20)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
}}
"""


def write_stage(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "small.usda"
    path.write_text(_STAGE)
    return path


def load(folder: Path) -> Scene:
    return Scene.load(write_stage(folder))


def frame(scene: Scene, index: int, *, worlds: int = 1, rate: float = RATE, **changes: object) -> Frame:
    """Frame `index`: bodies drift along −y and turn about z, traps lag behind, forces grow; worlds differ by 0.1 µm."""
    time = index / rate
    bodies, traps = len(scene.bodies), len(scene.traps)
    start = np.array([b.position for b in scene.bodies])
    position = start + np.array([0.0, -10.0 * time, 0.0]) + 0.1 * np.arange(worlds)[:, None, None]
    half = 0.5 * time
    orientation = np.broadcast_to([0.0, 0.0, np.sin(half), np.cos(half)], (worlds, bodies, 4))
    force = np.zeros((worlds, bodies, 3))
    force[:, 0, 0], force[:, 1, 0] = -1.0 - time, 1.0 + time
    values = {
        "position": position,
        "orientation": orientation,
        "trap_position": position[:, :traps] + (0.0, -0.25, 0.0),
        "trap_power": np.full((worlds, traps), 20.0 + time),
        "trap_force": np.broadcast_to([0.0, -0.25, 0.0], (worlds, traps, 3)),
        "trap_distance": np.full((worlds, traps), 0.25),
        "escape_time": np.full((worlds, traps), np.nan),
        "contact_force": force,
        "contact_load": np.linalg.norm(force, axis=2),
    }
    return dataclasses.replace(Frame(step=10 * index, time=time, **values), **changes)
