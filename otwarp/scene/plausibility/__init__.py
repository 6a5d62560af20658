"""What a scene says that is allowed, yet implausible: slips of units, traps that cannot hold, tasks that are lost.

Works on the `Scene`, so that files and scenes built in Python are judged alike; what only the file says stands in
`Scene.remarks`. `judge` is asked by `validate` and by every model that is built.

| file | what it judges |
|---|---|
| `ranges` | numbers outside what the field uses, and the unit that was meant |
| `holding` | which sphere each trap holds at the start, how far and how strongly |
| `traps` | traps that reach no sphere, share one, stand in an obstacle or leap |
| `meshes` | faces without area, open and inside-out meshes |
| `task` | tasks that are decided before they begin |
"""

from __future__ import annotations

from otwarp.scene.finding import Finding
from otwarp.scene.plausibility.meshes import odd_meshes
from otwarp.scene.plausibility.ranges import unusual_numbers
from otwarp.scene.plausibility.task import decided_tasks
from otwarp.scene.plausibility.traps import odd_traps
from otwarp.scene.scene import Scene

RULES = (unusual_numbers, odd_traps, odd_meshes, decided_tasks)
"""`Scene` → findings; a rule gives one finding for all prims that share an oddity."""


def judge(scene: Scene) -> tuple[Finding, ...]:
    """What is implausible in a scene that can be run, each as a warning; nothing for one that can be believed."""
    return (*scene.remarks, *(finding for rule in RULES for finding in rule(scene)))
