"""A recorded session (`otwarp teleop --record`) as something that can be played back."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from otwarp.teleop.page.compose import compose
from otwarp.teleop.page.protocol import PageFrame
from otwarp.teleop.recording.frames import frame_names, read_frames, scene_of
from otwarp.view.source import Moments, page_frame


class SessionSource:
    """A recording of a session; a `Source`, whose time is that of the session's clock.

    Args:
        path: MCAP, the folder that a killed session left, or a bag that was made of one.
        scene: File of its scene; None for where it was when the session ran.

    Raises:
        InputError: It cannot be read, or its scene is not there or another one.
    """

    def __init__(self, path: Path, scene: Path | None = None):
        frames = read_frames(path)
        self.scene = scene_of(path, frames.about, scene)
        self.title, self.time = path.resolve().name, frames.time
        self._simulated, said = frames.simulated, frames.about
        bodies, traps = frame_names(self.scene)
        turns = [frames.poses[name] for name in bodies]
        self._arrays = dict(frames.arrays)
        self._arrays["position"] = _stack([rows[:, :3] for rows in turns], len(self.time), 3)
        self._arrays["orientation"] = _stack([rows[:, 3:] for rows in turns], len(self.time), 4)
        foci = [frames.poses[name][:, :3] for name in traps]
        self._arrays["trap_position"] = _stack(foci, len(self.time), 3)
        self.held = np.array([trap.held for trap in compose(self.scene).traps], dtype=int)
        rows = (
            ("scene", str(self.scene.file)),
            ("recorded", str(said.get("recorded"))),
            ("devices", ", ".join(f"{hand}: {name}" for hand, name in said.get("devices", {}).items()) or "none"),
            ("frames", f"{len(self.time):,}"),
            ("time shown", "that of the session's clock"),
            ("simulated", f"{frames.simulated[0]:.3f} s to {frames.simulated[-1]:.3f} s"),
            ("the whole session", "yes" if frames.complete else "no: cut short"),
            ("otwarp", str(said.get("otwarp"))),
        )
        self.about = rows

    def frame(self, index: int) -> PageFrame:
        """See `Source`; moving obstacles stand where simulated time has them."""
        return page_frame(index, float(self._simulated[index]), {name: a[index] for name, a in self._arrays.items()})

    def moments(self, which: slice) -> Moments:
        """See `Source`."""
        position = self._arrays["position"][which].astype(float)
        return Moments(
            time=self.time[which],
            position=position,
            contact_load=self._arrays["contact_load"][which].astype(float),
            trap_distance=self._arrays["trap_distance"][which].astype(float),
            trap_power=self._arrays["trap_power"][which].astype(float),
            came_in=np.zeros(position.shape[:2]),
        )


def _stack(rows: list[np.ndarray], count: int, width: int) -> np.ndarray:
    """(count, k, width) of k rows of (count, width)."""
    return np.stack(rows, axis=1) if rows else np.zeros((count, 0, width), dtype=np.float32)
