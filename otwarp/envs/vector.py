"""`VectorEnv`: many environments of a task, stepped on a device at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import warp as wp
from gymnasium.error import ClosedEnvironmentError
from gymnasium.vector import AutoresetMode
from gymnasium.vector import VectorEnv as GymnasiumVectorEnv
from gymnasium.vector.utils import batch_space

from otwarp.envs.actions import is_tensor, write_actions
from otwarp.envs.batch import Batch
from otwarp.envs.images import images_of, only
from otwarp.envs.layout import Layout
from otwarp.envs.picture import Picture
from otwarp.envs.results import Arrays, blank, information, masked, reader
from otwarp.envs.spaces import action_space, observation_space
from otwarp.envs.task import Task, check_task
from otwarp.errors import InputError
from otwarp.simulation.packing.arguments import whole

MODES = {AutoresetMode.NEXT_STEP: "next", AutoresetMode.SAME_STEP: "same", AutoresetMode.DISABLED: "off"}
_OPTIONS = ("reset_mask",)


class VectorEnv(GymnasiumVectorEnv):
    """N environments of a task, which are worlds of one simulation.

    Environment i of seed s is environment 0 of seed s + i, bit for bit, whatever stands beside it; but a GPU shares few
    worlds of touching rigid bodies out to several threads each, which round otherwise than one.

    Args:
        task: The task.
        num_envs: N.
        device: `"cpu"`, `"cuda:0"`, … or None for the best available.
        arrays: `numpy`, arrays of the caller's own; or `torch`, tensors on the memory of the environments, which the
            next call overwrites.
        autoreset_mode: One of `gymnasium.vector.AutoresetMode`, its value or its name.
        render_mode: `rgb_array` for pictures of `render_envs` by the preview, or None.
        render_envs: Indices of the environments that are drawn.

    Raises:
        InputError: A task that its scene does not allow, or an argument out of range.
    """

    def __init__(
        self,
        task: Task,
        num_envs: int = 1,
        *,
        device: str | None = None,
        arrays: Arrays = "numpy",
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        render_envs: Sequence[int] = (0,),
    ):
        check_task(task)
        mode = read_mode(autoreset_mode)
        if render_mode not in (None, "rgb_array"):
            raise InputError(f"render_mode is {render_mode!r}; allowed: rgb_array, or None")
        self._read = reader(arrays)
        blind = task.observation == "state"
        # images of what an episode has come to are taken before its world starts anew
        self._restarts = mode is AutoresetMode.SAME_STEP and not blind
        autoreset = "off" if self._restarts else MODES[mode]
        self.batch = Batch(task, num_envs, device=device, autoreset=autoreset)  # type: ignore[arg-type]
        self._images = images_of(self.batch)
        self.task, self.num_envs, self.arrays, self.render_mode = task, num_envs, arrays, render_mode
        self.metadata = {"autoreset_mode": mode, "render_modes": ["rgb_array"], "render_fps": task.rate}
        self.mode = mode
        self.single_observation_space = observation_space(self.batch.layout)
        self.single_action_space = action_space(self.batch.layout)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._picture = Picture(self.batch) if render_mode else None
        self._drawn = drawn(render_envs, num_envs)
        self._started = False

    @property
    def layout(self) -> Layout:
        """What the numbers of observations and actions are."""
        return self.batch.layout

    @property
    def device(self) -> wp.Device:
        """Where the environments are."""
        return self.batch.device

    def refuse_closed(self) -> None:
        """Refuse to go on after `close`.

        Raises:
            gymnasium.error.ClosedEnvironmentError: It was closed.
        """
        if self.closed:
            raise ClosedEnvironmentError(f"{self.task.name} was closed; make it anew to go on")

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start environments anew.

        Args:
            seed: Of environment 0, the next ones have the next whole numbers, all modulo 2³²; or one for each, None for
                those that go on with their next episode; None for all of them, at first with seeds of the system.
            options: `reset_mask`, (N) bool, for some environments only.

        Raises:
            InputError: A seed or an option that is none.
            gymnasium.error.ClosedEnvironmentError: After `close`.
        """
        self.refuse_closed()
        mask, seeds = read_mask(options, self.num_envs), read_seeds(seed, self.num_envs)
        if seed is not None and not isinstance(seed, Sequence) and np.ndim(seed) == 0:
            super().reset(seed=int(seed))
        if not self._started and mask is not None and not mask.all():
            raise InputError("reset_mask leaves environments out that were never reset; allowed: a reset of all first")
        if not self._started:
            first = int(self.np_random.integers(0, 2**32))
            fresh = (first + np.arange(self.num_envs, dtype=np.int64)) % 2**32
            seeds = np.where(seeds < 0, fresh, seeds)
        return self.restarted(mask, seeds)

    def restarted(self, mask: np.ndarray | None, seeds: np.ndarray) -> tuple[Any, dict[str, Any]]:
        """What environments show that start anew.

        Args:
            mask: (N) bool, which ones; None for all.
            seeds: (N) whole numbers, -1 to go on with the next episode.
        """
        self.batch.restart(mask, seeds)
        self._started = True
        everyone = np.ones(self.num_envs, dtype=bool) if mask is None else mask
        return self._observed(everyone), masked(blank(self.batch), everyone)

    def _observed(self, fresh: np.ndarray | None = None) -> Any:
        """What the environments show; images are taken of those that are `fresh`, (N) bool, or of all."""
        state = self._read(self.batch.verdict.seen)
        if self._images is None:
            return state
        self._images.record(fresh)
        return self._images.observed(state)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """One period of control.

        Args:
            actions: (N, A) numbers within ±1, or (N) choices.

        Returns:
            Observations (N, O), rewards, terminated, truncated (N), and the information of the period.

        Raises:
            InputError: Actions of another shape, type or device; a number that is not finite; no reset yet; an
                episode that is over, in the mode DISABLED. The environments stay as they are.
            gymnasium.error.ClosedEnvironmentError: After `close`.
        """
        self.refuse_closed()
        if not self._started:
            raise InputError("step before the first reset; allowed: reset() first")
        if self.mode is AutoresetMode.DISABLED:
            refuse_over(self.batch.done)
        write_actions(self.task, actions, self.batch.actions)
        return self.advance()

    def advance(self) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """The period whose actions are in the batch; see `step`."""
        batch, read = self.batch, self._read
        batch.step()
        out = batch.verdict
        terminated, truncated = read(out.terminated), read(out.truncated)
        everyone = terminated | True
        info = masked(information(batch, read), everyone)
        reward, seen, over = read(out.reward), self._observed(), terminated | truncated
        if self._restarts:
            if over.any():
                ended = over.cpu().numpy() if is_tensor(over) else over
                self._add_final(info, over, only(seen, ended))
                batch.restart(ended)
                seen = self._observed(ended)
        elif self.mode is AutoresetMode.SAME_STEP and (self.arrays != "numpy" or over.any()):
            self._add_final(info, over, read(out.last_seen))
        return seen, reward, terminated, truncated, info

    @staticmethod
    def _add_final(info: dict[str, Any], over: Any, seen: Any) -> None:
        """Of the episodes that have ended: their last observations, and the information of their last period."""
        last = {name: value for name, value in info.items() if not name.startswith("_")}
        info |= {"final_obs": seen, "_final_obs": over}
        info |= {"final_info": masked(last, over), "_final_info": over}

    def render(self) -> tuple[np.ndarray, ...] | None:
        """(height, width, 3) pictures of `render_envs`; None without a render mode."""
        return None if self._picture is None else tuple(self._picture.draw(n) for n in self._drawn)


def read_mode(mode: AutoresetMode | str) -> AutoresetMode:
    """A mode of Gymnasium by itself, its value such as `NextStep`, or its name such as `NEXT_STEP`.

    Raises:
        InputError: It is none.
    """
    try:
        return AutoresetMode(AutoresetMode.__members__.get(mode, mode) if isinstance(mode, str) else mode)
    except ValueError:
        allowed = ", ".join(m.value for m in AutoresetMode)
        raise InputError(f"autoreset_mode is {mode!r}; allowed: {allowed}") from None


def drawn(render_envs: Any, num_envs: int) -> tuple[int, ...]:
    """Indices of the environments that are drawn.

    Raises:
        InputError: They are none.
    """
    if isinstance(render_envs, str) or not isinstance(render_envs, Iterable):
        raise InputError(f"render_envs is {render_envs!r}; allowed: indices from 0 to {num_envs - 1}, as a tuple")
    return tuple(whole("render_envs", n, 0, num_envs - 1) for n in render_envs)


def refuse_over(done: np.ndarray) -> None:
    """Refuse a step of environments whose episode is over, (N) bool.

    Raises:
        InputError: There are some.
    """
    if done.any():
        raise InputError(f"step of environment {np.flatnonzero(done)[0]}, whose episode is over; "
                         'allowed: reset(options={"reset_mask": …}) first')  # fmt: skip


def read_seeds(seed: Any, num_envs: int) -> np.ndarray:
    """(N) whole numbers, -1 for none, of what `reset` takes.

    Raises:
        InputError: No seed, or seeds of others.
    """
    if seed is None:
        return np.full(num_envs, -1, dtype=np.int64)
    if isinstance(seed, np.ndarray) and seed.ndim == 0:
        seed = seed.item()
    if isinstance(seed, int | np.integer) and not isinstance(seed, bool):
        given: list[Any] = [int(seed) + i for i in range(num_envs)]
    else:
        text = isinstance(seed, str | bytes | bytearray | memoryview)
        given = list(seed) if isinstance(seed, Sequence | np.ndarray) and not text else [seed]
    good = all(s is None or (isinstance(s, int | np.integer) and not isinstance(s, bool) and s >= 0) for s in given)
    if len(given) != num_envs or not good:
        raise InputError(f"seed is {seed!r}; allowed: a whole number from 0 on, or {num_envs} of them or None")
    return np.array([-1 if s is None else int(s) % 2**32 for s in given], dtype=np.int64)


def read_mask(options: dict[str, Any] | None, num_envs: int) -> np.ndarray | None:
    """(N) bool of the options that `reset` takes, or None for all.

    Raises:
        InputError: An option that is none, or no mask.
    """
    if options is not None and not isinstance(options, Mapping):
        raise InputError(f"options of reset are {options!r}; allowed: {{'reset_mask': …}}, or None")
    for name in options or {}:
        if name not in _OPTIONS:
            raise InputError(f"option {name!r} of reset is unknown; allowed: {', '.join(_OPTIONS)}")
    mask = (options or {}).get("reset_mask")
    if mask is None:
        return None
    try:
        mask = mask.cpu().numpy() if is_tensor(mask) else np.asarray(mask)
    except (TypeError, ValueError):  # rows of unequal length
        mask = np.array(None)
    if mask.shape != (num_envs,) or mask.dtype != bool or not mask.any():
        raise InputError(f"reset_mask is {mask.dtype} of shape {mask.shape} with {np.count_nonzero(mask)} set; "
                         f"allowed: bool of shape ({num_envs},), one of them at least")  # fmt: skip
    return mask
