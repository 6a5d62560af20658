"""`Env`: one environment of a task."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np

from otwarp.envs.actions import check, check_finite, read_action, write_actions
from otwarp.envs.batch import Batch
from otwarp.envs.images import images_of
from otwarp.envs.layout import Layout
from otwarp.envs.picture import Picture
from otwarp.envs.results import blank, information, reader
from otwarp.envs.spaces import action_space, observation_space
from otwarp.envs.task import Task, check_task
from otwarp.envs.window import Window
from otwarp.errors import InputError

MODES = ("rgb_array", "human")


class Env(gymnasium.Env):
    """One environment of a task: environment 0 of a `VectorEnv` of the same seed, bit for bit where that one says so.

    Args:
        task: The task.
        device: `"cpu"`, `"cuda:0"`, … or None for the CPU, where one world steps fastest.
        render_mode: `rgb_array` for pictures by the preview; `human` for the page of live sessions, whose address is
            written to stderr, in pace with the clock until `close`; or None.

    Raises:
        InputError: A task that its scene does not allow, or an argument out of range.
    """

    def __init__(self, task: Task, *, device: str | None = "cpu", render_mode: str | None = None):
        check_task(task)
        if render_mode not in (None, *MODES):
            raise InputError(f"render_mode is {render_mode!r}; allowed: {', '.join(MODES)}, or None")
        self.metadata = {"render_modes": list(MODES), "render_fps": task.rate}
        self.batch = Batch(task, 1, device=device, autoreset="off")
        self.task, self.render_mode = task, render_mode
        self.observation_space, self.action_space = (
            observation_space(self.batch.layout),
            action_space(self.batch.layout),
        )
        self._read = reader("numpy")
        self._images = images_of(self.batch)
        self._picture = Picture(self.batch) if render_mode == "rgb_array" else None
        self.window = Window(self.batch) if render_mode == "human" else None
        self._started = self.closed = False

    @property
    def layout(self) -> Layout:
        """What the numbers of observations and actions are."""
        return self.batch.layout

    def refuse_closed(self) -> None:
        """Refuse to go on after `close`.

        Raises:
            gymnasium.error.ClosedEnvironmentError: It was closed.
        """
        if self.closed:
            raise gymnasium.error.ClosedEnvironmentError(f"{self.task.name} was closed; make it anew to go on")

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode: the first one of a seed, which counts modulo 2³², or the next one.

        Raises:
            InputError: A seed or an option that is none.
            gymnasium.error.ClosedEnvironmentError: After `close`.
        """
        self.refuse_closed()
        given = read_seed(seed)
        refuse_options(options)
        super().reset(seed=given)
        first = -1 if given is None else given % 2**32
        if first < 0 and not self._started:
            first = int(self.np_random.integers(0, 2**32))
        self.batch.restart(None, np.array([first]))
        self._started = True
        return self._observed(), {name: value[0] for name, value in blank(self.batch).items()}

    def _observed(self) -> Any:
        """What the environment shows now; its window, too."""
        if self.window is not None:
            self.window.draw()
        state = self._read(self.batch.verdict.seen)
        if self._images is None:
            return state[0]
        self._images.record()
        seen = self._images.observed(state)
        return {name: rows[0] for name, rows in seen.items()} if isinstance(seen, dict) else seen[0]

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One period of control.

        Raises:
            InputError: An action of another shape or type, or that is not finite; an episode that is over, or that
                has not begun. The environment stays as it is.
            gymnasium.error.ClosedEnvironmentError: After `close`.
        """
        self.refuse_closed()
        batch, out = self.batch, self.batch.verdict
        if not self._started or batch.done[0]:
            raise InputError("step of an episode that is over or has not begun; allowed: reset() first")
        given = read_action(action)
        kinds, named = ("iu", "whole numbers") if self.task.choices else ("f", "floating-point numbers")
        check(given.dtype.kind in kinds, str(given.dtype), given.shape, self.action_space.shape or (), named)
        check_finite(given)
        write_actions(self.task, given[None], batch.actions)
        batch.step()
        info = {name: value[0] for name, value in information(batch, self._read).items()}
        seen = self._observed()
        ended = bool(self._read(out.terminated)[0]), bool(self._read(out.truncated)[0])
        return seen, float(self._read(out.reward)[0]), *ended, info

    def render(self) -> np.ndarray | None:
        """(height, width, 3) picture in the mode `rgb_array`; None without one."""
        return None if self._picture is None else self._picture.draw(0)

    def close(self) -> None:
        """End it, and the page of the mode `human`; may be called more than once."""
        self.closed = True
        if self.window is not None:
            self.window.close()


def read_seed(seed: Any) -> int | None:
    """The seed that `reset` takes.

    Raises:
        InputError: It is none.
    """
    given = seed.item() if isinstance(seed, np.ndarray) and seed.ndim == 0 else seed
    if given is not None and (isinstance(given, bool) or not isinstance(given, int | np.integer) or given < 0):
        raise InputError(f"seed is {given!r}; allowed: a whole number from 0 on, or None")
    return None if given is None else int(given)


def refuse_options(options: Any) -> None:
    """Refuse options of `reset`, of which there are none.

    Raises:
        InputError: There is one.
    """
    if options is not None and not (isinstance(options, Mapping) and not options):
        wrong = next(iter(options)) if isinstance(options, Mapping) else options
        raise InputError(f"option {wrong!r} of reset is unknown; allowed: none")
