"""Films by Gymnasium's `RecordVideo`, with a double of MoviePy that keeps the pictures."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium")

import gymnasium

from otwarp.envs.registration import TASKS

NAVIGATE = next(name for name in TASKS if name.startswith("otwarp/Navigate"))
PERIODS = 4


class Clip:
    """What MoviePy makes of pictures."""

    made: list[tuple[str, int, list[np.ndarray]]]

    def __init__(self, pictures: list[np.ndarray], fps: int) -> None:
        self.pictures, self.fps = pictures, fps

    def write_videofile(self, path: str, logger: Any = None) -> None:
        """Keep them."""
        Clip.made.append((Path(path).name, self.fps, self.pictures))


@pytest.fixture(autouse=True)
def moviepy(monkeypatch: pytest.MonkeyPatch) -> None:
    """The modules that the wrappers import."""
    Clip.made = []
    names = "moviepy", "moviepy.video", "moviepy.video.io", "moviepy.video.io.ImageSequenceClip"
    for name in names:
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    monkeypatch.setattr(sys.modules[names[-1]], "ImageSequenceClip", Clip, raising=False)


@pytest.mark.quick
def test_a_film_of_an_episode(device, tmp_path: Path) -> None:
    """A picture at the start and after each period, at the rate of the task."""
    made = gymnasium.make(NAVIGATE, render_mode="rgb_array", device=device, rate=8.0, time_limit=PERIODS / 8.0)
    env = gymnasium.wrappers.RecordVideo(made, str(tmp_path / "films"), episode_trigger=lambda episode: True)
    env.reset(seed=1)
    over, periods = False, 0
    while not over:
        periods += 1
        *_, ended, late, _ = env.step(np.ones_like(env.action_space.sample()))
        over = ended or late
    env.close()
    ((name, fps, pictures),) = Clip.made
    assert name == "rl-video-episode-0.mp4" and fps == 8.0 and len(pictures) == periods + 1 > 2
    assert {(p.shape, p.dtype) for p in pictures} == {((360, 480, 3), np.dtype(np.uint8))}
    assert all(np.any(a != b) for a, b in itertools.pairwise(pictures))


def test_a_film_of_many_environments(device, tmp_path: Path) -> None:
    """All of them are drawn, side by side."""
    how = {"vectorization_mode": "vector_entry_point", "render_mode": "rgb_array", "device": device}
    made = gymnasium.make_vec(NAVIGATE, num_envs=3, render_envs=range(3), time_limit=PERIODS / 20.0, **how)
    envs = gymnasium.wrappers.vector.RecordVideo(
        made, str(tmp_path / "films"), episode_trigger=lambda episode: episode == 0
    )
    envs.reset(seed=1)
    for _ in range(PERIODS + 1):
        envs.step(np.ones_like(envs.action_space.sample()))
    envs.close()
    ((_, fps, pictures),) = Clip.made
    assert fps == 20.0 and len(pictures) >= PERIODS and {p.shape for p in pictures} == {(360, 3 * 480, 3)}
