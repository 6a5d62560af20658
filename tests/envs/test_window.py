"""The page as the window of an environment, without a browser: drawn after every step, gone after close."""

from __future__ import annotations

import dataclasses
import os
import time
import urllib.request

import numpy as np
import pytest

pytest.importorskip("gymnasium")
pytest.importorskip("viser")

from otwarp.envs import Env, from_scene

TASK = dataclasses.replace(from_scene("scenes/teleop_small.usda"), time_limit=1.0)
POLLS, PAUSE = 3000, 0.01
"""How often and how long [s] to look again before something counts as never happening."""


def eventually(true) -> bool:
    for _ in range(POLLS):
        if true():
            return True
        time.sleep(PAUSE)
    return False


def test_the_page_shows_every_step_changes_nothing_and_ends(capsys, device):
    env, unseen = Env(TASK, device=device, render_mode="human"), Env(TASK, device=device)
    try:
        page = env.window.page
        assert env.window.url in capsys.readouterr().err
        assert urllib.request.urlopen(env.window.url, timeout=30).status == 200
        drawn = []
        page.publish, publish = lambda live: (drawn.append(live), publish(live)), page.publish
        assert np.array_equal(env.reset(seed=2)[0], unseen.reset(seed=2)[0])
        action = np.float32([1, 0, 0, 0, -1, 0])
        for _ in range(4):
            seen, reward, *_ = env.step(action)
            wanted, paid, *_ = unseen.step(action)
            assert np.array_equal(seen, wanted) and reward == paid
        assert [live.frame.time for live in drawn] == pytest.approx(np.arange(5) / TASK.rate)
        poses = env.batch.sim.prim_poses()[0]
        assert np.array_equal(drawn[-1].frame.position, poses) and np.any(drawn[0].frame.position != poses)
        assert np.all(np.linalg.norm(drawn[-1].frame.trap_force[0], axis=1) > 0.0)
        assert eventually(lambda: page.ready and page.applied > 0.0) and env.render() is None
        pid = page.pid
    finally:
        env.close()
    env.close()
    assert not page.alive
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
