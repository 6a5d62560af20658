"""What a chain remembers from one step to the next, as plain lists for JSON, and a chain that goes on from it.

Configuration, laws and tables are not part of it: they are stored once with a recording. Numbers come back bit for bit,
as Python writes floats by `repr`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from otwarp.errors import InputError
from otwarp.haptics.core.types import SceneFrame, SphereFrame, TrapFrame

if TYPE_CHECKING:
    from otwarp.haptics.chain.chain import Chain

REMEMBERED: dict[str, tuple[str, ...]] = {
    "": (
        *("_back", "_tick", "_time", "_beat", "_scene_time", "_scene_age", "_device_age"),
        *("_position", "_felt", "_paper_force", "asked", "complaint"),
    ),
    "safety": ("_ceiling", "_faulty", "_gain", "_held", "_wanted", "force", "heat", "state"),
    "passivity": ("_hand", "energy"),
    "motion": ("_hand", "_last", "_map", "_origin", "carried", "commanded"),
    "motion._filter": ("value",),
    "_coupling": ("_hand", "proxy"),
    "_filter": ("value",),
    "model": ("_shares", "_went", "_way", "_focus", "_carried", "_bodies", "_time"),
    "_paper": ("_gain", "_robot"),
    "_paper._node": ("_last", "_robot", "_trap", "force", "gain"),
    "_paper._node._filter": ("value",),
}
"""Part of a chain → its attributes that change after it was made; parts that a chain lacks are skipped. Kept apart:
the chain's `_anchors`, the windows of its velocity estimate, the model's spheres and their prediction."""


def snapshot(chain: Chain, scene: SceneFrame) -> dict[str, Any]:
    """All that a chain remembers after a step with `scene`."""
    state: dict[str, Any] = {
        name: [getattr(part, key) for key in keys]
        for name, keys in REMEMBERED.items()
        if (part := _part(chain, name)) is not None
    }
    model: Any = chain.model
    state["windows"] = [list(axis) for axis in chain._velocity._axes]
    state["anchors"] = list(chain._anchors.items())
    state["scene"] = scene_to_json(scene)
    state["targets"] = model._targets
    # None: they are there; else they are on their way
    state["spheres"] = None if model._spheres is model._targets else model._spheres
    return state


def restore(chain: Chain, state: Mapping[str, Any]) -> None:
    """Let a fresh chain of the same configuration go on from a snapshot.

    Raises:
        InputError: The snapshot is of another configuration, or none.
    """
    try:
        anchors = {int(trap): _tuples(place) for trap, place in state["anchors"]}
        if anchors:
            chain.model.refresh(scene_from_json(state["scene"]), anchors)
        chain._anchors = anchors
        for name, keys in REMEMBERED.items():
            part = _part(chain, name)
            if (part is None) != (name not in state):
                raise ValueError(f"{name or 'chain'} is {'not ' * (part is None)}configured")
            if part is not None:
                for key, value in zip(keys, state[name], strict=True):
                    setattr(part, key, _tuples(value))
        x, y, z = state["windows"]
        chain._velocity._axes = (list(x), list(y), list(z))
        model: Any = chain.model
        model._targets = _groups(state["targets"])
        model._spheres = model._targets if state["spheres"] is None else _groups(state["spheres"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"start of a recording: does not fit its configuration ({error})") from None


def scene_to_json(scene: SceneFrame) -> list[Any]:
    """A state of the simulation as plain lists."""
    traps = [(trap.index, trap.position, trap.power) for trap in scene.traps]
    spheres = [(sphere.position, sphere.body) for sphere in scene.spheres]
    return [scene.beat, scene.time, spheres, traps, scene.contact_force]


def scene_from_json(data: Any) -> SceneFrame:
    """The state that `scene_to_json` wrote."""
    beat, time, spheres, traps, contact = data
    balls = tuple(SphereFrame(_tuples(position), body) for position, body in spheres)
    return SceneFrame(beat, time, balls, tuple(TrapFrame(n, _tuples(p), power) for n, p, power in traps), contact)


def _part(chain: Chain, name: str) -> Any:
    """A part by its dotted name, None if the chain lacks it; "" is the chain itself."""
    part: Any = chain
    for step in name.split(".") if name else ():
        part = getattr(part, step) if part is not None else None
    return part


def _groups(value: Any) -> list[list[Any]]:
    """Vectors of the spheres of each kind."""
    return [[_tuples(vector) for vector in group] for group in value]


def _tuples(value: Any) -> Any:
    """Lists as tuples, to any depth."""
    return tuple(_tuples(item) for item in value) if isinstance(value, list | tuple) else value
