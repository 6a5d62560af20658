"""Environments of Gymnasium: tasks in scenes, one world each, thousands of them on a device.

In: a `Task` (a scene, hands that move its traps, terms that are observed, earned and end an episode). Out: `Env` and
`VectorEnv`. Importing this package registers the shipped ones. Open `task` first, then `batch`.

task           `Task`, `Hand`, `Shift`: what an environment is made of
task_arguments  ranges of its arguments
terms          what is observed, what is earned, and what ends an episode
layout         what the numbers of observations and actions are
batch          worlds on a device: actions in, a period of control, verdicts out, as one graph
observer       what a learner would see of worlds that something else steps
scenes         the shipped scenes, as tasks step them
places         a task's scene as terms read it
randomise      what differs from episode to episode
actions        what is accepted of actions
results        verdicts as arrays of NumPy or tensors of torch
spaces         spaces of observations and actions
single         `Env`, one environment
vector         `VectorEnv`, many
grouped        both of scenes that differ in what a model fixes
check          what vector environments promise, checked bit for bit
picture        pictures of worlds
images         images of the microscope as observations
window         the page of live sessions, drawn after every step
rollout        episodes of a policy
describe       tables of what the numbers mean
goal_task      any scene with a goal as a task
pettingzoo     hands as agents
registration   the shipped ones by name
written_options  options of a task, as texts
tasks          the shipped tasks
experts        scripted policies
adapters       environments for Stable-Baselines3, skrl, rsl_rl
kernels        what runs on the device
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.envs.registration import register_all
from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.envs.batch import Batch as Batch
    from otwarp.envs.check import check_vector as check_vector
    from otwarp.envs.goal_task import from_scene as from_scene
    from otwarp.envs.grouped import GroupedEnv as GroupedEnv
    from otwarp.envs.grouped import GroupedVectorEnv as GroupedVectorEnv
    from otwarp.envs.kernels.types import TaskNow as TaskNow
    from otwarp.envs.randomise.groups import group_tasks as group_tasks
    from otwarp.envs.registration import task_of as task_of
    from otwarp.envs.single import Env as Env
    from otwarp.envs.task import Hand as Hand
    from otwarp.envs.task import Shift as Shift
    from otwarp.envs.task import Task as Task
    from otwarp.envs.terms import Term as Term
    from otwarp.envs.terms import term as term
    from otwarp.envs.vector import VectorEnv as VectorEnv

_NAMES = {
    "batch": ("Batch",),
    "check": ("check_vector",),
    "goal_task": ("from_scene",),
    "grouped": ("GroupedEnv", "GroupedVectorEnv"),
    "kernels.types": ("TaskNow",),
    "randomise.groups": ("group_tasks",),
    "registration": ("task_of",),
    "single": ("Env",),
    "task": ("Hand", "Shift", "Task"),
    "terms": ("Term", "term"),
    "vector": ("VectorEnv",),
}

__getattr__, __dir__ = lazy_names(__name__, _NAMES, rooms=("terms",))

register_all()
