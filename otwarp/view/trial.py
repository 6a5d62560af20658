"""A trial that was run again, as something that can be played back."""

from __future__ import annotations

import numpy as np

from otwarp.simulation.frame import Frame
from otwarp.studies.rerun import Rerun
from otwarp.teleop.page.protocol import PageFrame
from otwarp.view.source import Moments, page_frame

_SHOWN = ("position", "orientation", "trap_position", "trap_power", "trap_force", "trap_distance")
_SHOWN += ("contact_force", "contact_load")


class TrialSource:
    """A `Source` of the frames of a trial.

    Args:
        found: The trial.
        title: What a user calls it.
        about: Names and values that say which it is.
    """

    def __init__(self, found: Rerun, title: str, about: tuple[tuple[str, str], ...] = ()):
        self._frames: tuple[Frame, ...] = found.frames
        self.scene, self.held, self.title = found.scene, found.held, title
        self.time = np.array([frame.time for frame in found.frames])
        said = "yes" if found.same else "NO: other bits, or another end, than the study recorded"
        self.about = (*about, ("end", found.end), ("the study's own bits", said))

    def frame(self, index: int) -> PageFrame:
        """See `Source`."""
        frame = self._frames[index]
        return page_frame(index, frame.time, {name: getattr(frame, name)[0] for name in _SHOWN})

    def moments(self, which: slice) -> Moments:
        """See `Source`."""
        frames = self._frames[which]

        def stacked(name: str) -> np.ndarray:
            """Of all of them."""
            return np.stack([np.asarray(getattr(frame, name)[0], dtype=float) for frame in frames])

        place = "position" if frames[0].unwrapped is None else "unwrapped"
        position = stacked(place)
        came_in = np.zeros(position.shape[:2]) if frames[0].entries is None else stacked("entries")
        return Moments(
            time=self.time[which],
            position=position,
            contact_load=stacked("contact_load"),
            trap_distance=stacked("trap_distance"),
            trap_power=stacked("trap_power"),
            came_in=came_in,
        )
