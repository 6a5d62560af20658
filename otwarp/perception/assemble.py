"""From a scene and what a user asked for to a `ClosedLoop`: bodies, sources, and who looks."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from otwarp.device import pick_device
from otwarp.errors import InputError, PlausibilityWarning
from otwarp.haptics.core.realtime import Clock, RealClock
from otwarp.perception.closed_loop import ClosedLoop
from otwarp.perception.estimator import Estimator
from otwarp.perception.followed import FollowedBody, LostRule
from otwarp.perception.hidden import Outline
from otwarp.perception.looker import Looker
from otwarp.perception.photographer import LIVE
from otwarp.perception.sources import network_of, piece_size, templates_of
from otwarp.scene import Scene
from otwarp.vision.rendering import Rendering
from otwarp.vision.tracking.commands import Commands
from otwarp.vision.tracking.recorded import Source, body_index
from otwarp.vision.view import camera_of, image_size

TEMPLATES = "templates"
"""What stands for no network."""

MOST_CELLS = 4
"""Cells that are followed where a scene has no task that names one."""


@dataclass(frozen=True, kw_only=True)
class SeeingOptions:
    """What is looked for, and by what.

    Attributes:
        networks: `templates`, or a trained network, for all robots; `BODY=NETWORK` for one of them.
        follow: Names of the bodies; none: robots, and the task's cell.
        rule: When one is lost.
        rendering: Of templates, and of a simulated camera's images.
        piece: Side of the pieces in which bodies without a network are looked for [pixels]; None: as large as they are.
        device: Of rendering and networks.
        any_robot: Whether networks may be those of other robots.
        threads: Of a network on a CPU: with another number its last bits are others.
    """

    networks: Sequence[str] = (TEMPLATES,)
    follow: Sequence[str] = ()
    rule: LostRule = field(default_factory=LostRule)
    rendering: Rendering = LIVE
    piece: int | None = None
    device: str | None = None
    any_robot: bool = False
    threads: int = 1


@dataclass(frozen=True, eq=False)
class Seeing:
    """Sources of the bodies that are followed.

    Attributes:
        sources: Body's index → what looks at its pieces.
        pieces: Body's index → side of its pieces [pixels].
        about: Body's name → `templates`, or the network's path.
    """

    sources: Mapping[int, Source]
    pieces: Mapping[int, int]
    about: Mapping[str, str]


def followed_bodies(scene: Scene, names: Sequence[str] = ()) -> list[int]:
    """Indices of the bodies that a camera follows, each once.

    Raises:
        InputError: No such body, or none at all.
    """
    if names:
        return list(dict.fromkeys(body_index(scene, _whole_name(scene, name)) for name in names))
    cell = None if scene.goal is None else scene.goal.cell
    cells = [b.name for b in scene.bodies if b.kind == "cell"]
    chosen = {cell} if cell is not None else set(cells) if len(cells) <= MOST_CELLS else set()
    found = [n for n, b in enumerate(scene.bodies) if b.kind == "robot" or b.name in chosen]
    if not found:
        raise InputError("--perception has no body to look for; allowed: a scene with robots or cells")
    return found


def see(scene: Scene, options: SeeingOptions, say: Callable[[str], None] = lambda _: None) -> Seeing:
    """What looks at each body that is followed; templates are rendered.

    Raises:
        InputError: A network that cannot be used for a robot, or no body to be seen.
    """
    from otwarp.vision.networks.use import load

    chosen = _networks(scene, options.networks)
    indices = followed_bodies(scene, options.follow)
    # what can be refused is refused before anything is rendered
    paths = {n: chosen.get(n, TEMPLATES if scene.bodies[n].kind == "cell" else chosen[-1]) for n in indices}
    loaded = {
        path: load(path, device=options.device, threads=options.threads) for path in {*paths.values()} - {TEMPLATES}
    }
    networks = {n: path for n, path in paths.items() if path != TEMPLATES}
    with warnings.catch_warnings(record=True) as unlearnt:
        warnings.simplefilter("always", PlausibilityWarning)
        found = {n: network_of(scene, n, loaded[p], p, any_robot=options.any_robot) for n, p in networks.items()}
    for warning in unlearnt:
        say(str(warning.message))
    sources: dict[int, Source] = {**found}
    pieces = {n: source.side for n, source in found.items()}
    for n in indices:
        if n not in sources:
            pieces[n] = options.piece or piece_size(scene, n)
            say(f"templates {scene.bodies[n].name}, {pieces[n]} × {pieces[n]} pixels")
            sources[n] = templates_of(scene, n, pieces[n], rendering=options.rendering, device=options.device)
    return Seeing(sources, pieces, {scene.bodies[n].name: paths[n] for n in indices})


def _networks(scene: Scene, asked: Sequence[str]) -> dict[int, str]:
    """Body's index → network that was asked for; -1 for all others."""
    found = {-1: TEMPLATES}
    for one in asked:
        name, sign, path = one.partition("=")
        if sign and not Path(one).exists():
            found[body_index(scene, _whole_name(scene, name))] = path
        else:
            found[-1] = one
    return found


def _whole_name(scene: Scene, name: str) -> str:
    """A body's name, also from the part of it below the scene's root."""
    below = f"{scene.root}/{name}"
    return below if any(b.name == below for b in scene.bodies) else name


def estimator_of(scene: Scene, seeing: Seeing) -> Estimator:
    """The estimator of a scene's camera."""
    camera = camera_of(scene)
    outlines = {n: Outline(scene, n) for n in seeing.sources}
    return Estimator(camera, image_size(camera), seeing.sources, outlines if len(outlines) > 1 else {})


def check_camera(scene: Scene, name: str | None) -> None:
    """Refuse a camera that the scene does not have.

    Args:
        scene: The scene.
        name: Prim of its camera, or the last part of it; None: whatever it is called.

    Raises:
        InputError: None of that name, or none at all.
    """
    prim = camera_of(scene).prim
    if name is not None and name not in (prim, prim.rsplit("/", 1)[-1]):
        raise InputError(
            f"--camera is {name}; allowed: {prim.rsplit('/', 1)[-1]}, or KIND:… for one that is not simulated"
        )


def closed_loop(
    scene: Scene,
    pieces: Mapping[int, int],
    looker: Looker,
    *,
    rule: LostRule | None = None,
    seeing: SeeingOptions | None = None,
    clock: Clock | None = None,
) -> ClosedLoop:
    """A twin's perception.

    Args:
        scene: Of the twin.
        pieces: Index of each body that is followed → side of its pieces [pixels].
        looker: Who looks; not started.
        rule: When a body is lost; None: as of `seeing`.
        seeing: What is looked for, and by what; for recordings.
        clock: Of the session.

    Raises:
        InputError: The scene has no camera.
    """
    camera, clock, options = camera_of(scene), clock or RealClock(), seeing or SeeingOptions()
    rule = rule or options.rule
    traps = scene.traps
    place = [t.position.at(0.0) for t in traps]
    power = [t.power.at(0.0)[0] for t in traps]
    first = np.concatenate([np.ravel(np.array(place)), np.array(power)]) if traps else np.zeros(0)
    commands = Commands(np.array([clock.now()]), first[None])
    bodies = [
        FollowedBody(scene, n, camera=camera, size=image_size(camera), piece=(side, side), commands=commands,
                     rule=rule)
        for n, side in sorted(pieces.items())
    ]  # fmt: skip
    about = {
        "camera": looker.info.name, "pieces": {scene.bodies[n].name: side for n, side in sorted(pieces.items())},
        "networks": list(options.networks), "rule": dataclasses.asdict(rule),
        "rendering": dataclasses.asdict(options.rendering), "optics": dataclasses.asdict(camera),
        "device": str(pick_device(options.device)), "threads": options.threads, "any_robot": options.any_robot,
    }  # fmt: skip
    return ClosedLoop(looker, bodies, commands, clock=clock, about=about)
