"""Where the bodies of a scene are: at a time of a simulation, or in a frame of a recorded run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.record.folder import check_run
from otwarp.scene import Scene
from otwarp.simulation.simulation import Simulation
from otwarp.vision.replay import Replay, exposed
from otwarp.vision.view import camera_of


@dataclass(frozen=True, eq=False)
class Moments:
    """A scene and the poses of its bodies during one exposure.

    Attributes:
        scene: What is seen.
        time: When the exposure begins [s].
        position: (e, B, 3) origins of the bodies' prims [µm].
        orientation: (e, B, 4) quaternions (x, y, z, w).
    """

    scene: Scene
    time: float
    position: np.ndarray
    orientation: np.ndarray


def moments(
    path: str | Path,
    *,
    time: float = 0.0,
    world: int = 0,
    seed: int = 0,
    device: str | None = None,
    center: str | None = None,
    exposure: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Moments:
    """The bodies of a scene at a time, or of a recorded run in the frame nearest to it.

    A scene is simulated up to that time; where its camera exposes for longer than a moment, on through the exposure.
    So is a recorded run, from its frame on.

    Args:
        path: Of a scene, or the folder of a recorded run.
        time: From the start [s].
        world: Of a recorded run.
        seed: Of the simulation.
        device: Of the simulation.
        center: A body that must be there.
        exposure: How long the shutter is open [s]; None: as the camera says.
        progress: Called with time steps taken and time steps in all.

    Raises:
        InputError: No such scene, run, world, time or body, or a time that is more steps away than a run may have.
    """
    path = Path(path)
    if path.is_dir():
        return _recorded(path, time, world, center, exposure, device, progress)
    scene = Scene.load(path, duration=max(time, 1e-9) if time > 0.0 else None)
    if world:
        raise InputError(f"--world is {world}; allowed of a scene: 0, only recorded runs have several worlds")
    check_body(scene, center)
    shutter = camera_of(scene).exposure if exposure is None else exposure
    if time == 0.0 and shutter == 0.0:
        place, turn = ([getattr(b, name) for b in scene.bodies] for name in ("position", "orientation"))
        return Moments(scene, time, np.array(place).reshape(1, -1, 3), np.array(turn).reshape(1, -1, 4))
    return Moments(scene, time, *exposed(Simulation(scene, seed=seed, device=device), time, shutter, progress))


def check_body(scene: Scene, name: str | None) -> None:
    """Refuse a body that is not there.

    Raises:
        InputError: Of that name is none.
    """
    names = [b.name for b in scene.bodies]
    if name is not None and name not in names:
        raise InputError(f"--center is {name}; allowed: {', '.join(names[:8]) or 'nothing, there is no body'}")


def _recorded(
    folder: Path,
    time: float,
    world: int,
    center: str | None,
    exposure: float | None,
    device: str | None,
    progress: Callable[[int, int], None] | None,
) -> Moments:
    """Poses from `run.nc`, of the frame nearest to a time, and on from there through an exposure."""
    import netCDF4

    file = folder / "run.nc"
    check_run(file)
    scene = Scene.load(folder / "run.usda")
    check_body(scene, center)
    with _opened(netCDF4, file) as data:
        data.set_auto_mask(False)
        worlds, times = len(data.dimensions["world"]), np.asarray(data["time"][:])
        if not 0 <= world < worlds:
            raise InputError(f"{file}: world = {world}; allowed: 0 … {worlds - 1}")
        if not len(times) or not times[0] - 1e-9 <= time <= times[-1] + 1e-9:
            until = f"{times[0]:g} to {times[-1]:g} s" if len(times) else "none, the run has no frames"
            raise InputError(f"{file}: time = {time:g} s; allowed: {until}")
        frame = int(np.argmin(np.abs(times - time)))
        position = np.asarray(data["position"][frame, world], dtype=float)
        orientation = np.asarray(data["orientation"][frame, world], dtype=float)
        shutter = camera_of(scene).exposure if exposure is None else exposure
        if shutter > 0.0:
            replay, step = Replay(scene, data, world, device=device), int(data["step"][frame])
            return Moments(scene, float(times[frame]), *replay.during(position, orientation, step, shutter, progress))
    return Moments(scene, float(times[frame]), position[None], orientation[None])


def _opened(netCDF4: Any, file: Path) -> Any:
    try:
        return netCDF4.Dataset(file)
    except OSError as error:
        raise InputError(f"{file}: contents = {error.strerror}; allowed: the netCDF file of a recorded run") from None
