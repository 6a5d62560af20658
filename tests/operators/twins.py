"""A batch of chains and the servo's own, given the same hands and states, period by period, and compared."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from otwarp.haptics.chain.chain import make_chain
from otwarp.haptics.core import STATES, DeviceInfo, DeviceSample, SceneFrame, SphereFrame, TrapFrame, Vec3
from otwarp.operators.chain import ChainBatch
from otwarp.operators.kernels.chain_data import CAUSES
from otwarp.teleop.operators import HandPlan, LocalScene

ROUNDING = 1e-12
"""Largest difference of the twins, of a number and what is usual of its kind (`SCALES`).

Operations and their order are the servo's, and so are the bits, but for `math.dist` and `math.hypot` of Python, whose
last bit is better than that of a root of a sum of squares: it makes energies differ by 1e-16 of themselves each period.
"""

ON_DEVICES = 1e-6
"""The same of a GPU, which contracts products and sums, and has other roots and exponentials: what was promised."""

SCALES = {"force": 0.1, "asked": 0.1, "energy": 1e-6, "commanded": 1.0}
"""Newtons, joules (a hundredth of the reserve) and micrometres to which differences of small numbers are compared."""

INFO = DeviceInfo(name="weaker than the configuration", kind="virtual", force=3.0, continuous_force=0.7)


def vec(row: np.ndarray) -> Vec3:
    x, y, z = row.tolist()
    return x, y, z


class Twins:
    """W worlds of hands in `ChainBatch`, and each of them in a `Chain`.

    Attributes:
        batch, chains: The two; chains by world and hand.
        hand, fresh, buttons, elapsed, gain, sphere, body, trap, power: What the next period or state gives to both.
        worst: Largest difference of each output so far, of its value and `SCALES`.
        seen: Phases and complaints.
    """

    def __init__(self, plans: Sequence[HandPlan], local: LocalScene, worlds: int, traps: int, device: str = "cpu"):
        self.plans, self.local, self.worlds = plans, local, worlds
        self.batch = ChainBatch(plans, local, worlds, device=device, infos=[INFO] * len(plans), traps=traps)
        self.chains = [[self.fresh_chain(h) for h in range(len(plans))] for _ in range(worlds)]
        shape = (worlds, len(plans))
        self.hand, self.fresh = np.zeros((*shape, 3)), np.ones(shape, dtype=np.int32)
        self.buttons = np.ones(shape, dtype=np.int32)
        self.gain = self.batch.force_gain.numpy().copy()
        self._gain = self.gain.copy()
        self.elapsed = self.batch.elapsed.numpy().copy()
        self.sphere = np.zeros((worlds, len(local.kinds), 3))
        self.body = self.batch.body.numpy().copy()
        self.trap, self.power = np.zeros((worlds, traps, 3)), np.full((worlds, traps), 20.0)
        self.time = np.zeros(worlds)
        self._clock = np.zeros(worlds)
        self._frames: list[SceneFrame | None] = [None] * worlds
        self._beat = 0
        self.worst: dict[str, float] = dict.fromkeys(SCALES, 0.0)
        self.seen: set[tuple[str, str]] = set()

    def fresh_chain(self, hand: int):
        """The servo's chain of a hand."""
        config = self.plans[hand].config
        return make_chain(config, {t: self.local.laws[t] for t in config.traps}, self.local.kinds, INFO)

    def flags(self, worlds: np.ndarray) -> wp.array:
        return wp.array(worlds, dtype=wp.bool, device=self.batch.device)

    def arm(self, worlds: np.ndarray, *, armed: bool = True) -> None:
        """Arm or disarm some worlds of both."""
        (self.batch.arm if armed else self.batch.disarm)(self.flags(worlds))
        for w in np.flatnonzero(worlds):
            for chain in self.chains[w]:
                chain.arm() if armed else chain.disarm()

    def reset(self, worlds: np.ndarray) -> None:
        """Worlds anew: chains as made, which know neither time nor state."""
        self.batch.reset(self.flags(worlds))
        for w in np.flatnonzero(worlds):
            self.chains[w] = [self.fresh_chain(h) for h in range(len(self.plans))]
            self._clock[w], self._gain[w] = 0.0, [plan.config.force_gain for plan in self.plans]

    def publish(self, worlds: np.ndarray) -> None:
        """The state in `sphere`, `body`, `trap`, `power` and `time`, in some worlds."""
        batch = self.batch
        for name in ("sphere", "body", "trap", "power", "time"):
            getattr(batch, name).assign(getattr(self, name))
        batch.refresh(worlds=self.flags(worlds))
        self._beat += 1
        for w in np.flatnonzero(worlds):
            spheres = (SphereFrame(vec(p), int(b)) for p, b in zip(self.sphere[w], self.body[w], strict=True))
            traps = (TrapFrame(t, vec(p), float(self.power[w, t])) for t, p in enumerate(self.trap[w]))
            self._frames[w] = SceneFrame(self._beat, float(self.time[w]), tuple(spheres), tuple(traps))

    def period(self) -> None:
        """One servo period of both, compared."""
        batch = self.batch
        for name in ("hand", "fresh", "buttons", "elapsed"):
            getattr(batch, name).assign(getattr(self, name))
        batch.force_gain.assign(self.gain)
        batch.step()
        out = {name: getattr(batch, name).numpy() for name in ("force", "asked", "energy", "commanded")}
        phase, cause, holds = batch.phase.numpy(), batch.cause.numpy(), batch.holds.numpy()
        for w, chains in enumerate(self.chains):
            time = float(self._clock[w] + self.elapsed[w])
            if np.isfinite(time):
                self._clock[w] = time
            frame = self._frames[w]
            assert frame is not None
            for h, chain in enumerate(chains):
                if self.gain[w, h] != self._gain[w, h]:
                    chain.set_gains(force_gain=float(self.gain[w, h]))
                sample = DeviceSample(time, vec(self.hand[w, h]), int(self.buttons[w, h]), bool(self.fresh[w, h]))
                now = chain.step(sample, frame)
                causes = f"{CAUSES[cause[w, h]]!r} for {chain.complaint!r}"
                where = f"world {w}, hand {h}, tick {now.tick}, {causes}"
                assert STATES[phase[w, h]] == now.state, f"{where}: {STATES[phase[w, h]]} for {now.state}"
                assert chain.complaint.startswith(CAUSES[cause[w, h]]), where
                assert bool(chain.complaint) == bool(cause[w, h]), where
                assert bool(now.traps) == bool(holds[w, h]), where
                self.seen.add((now.state, chain.complaint))
                self._compare("force", now.force, out["force"][w, h])
                self._compare("asked", chain.asked, out["asked"][w, h])
                self._compare("energy", (now.energy,), out["energy"][w, h])
                for trap, place in now.traps:
                    self._compare("commanded", place, out["commanded"][w, trap])
        self._gain[:] = self.gain

    def _compare(self, name: str, servo: Sequence[float], batch: np.ndarray) -> None:
        there = np.array(servo)
        difference = float(np.max(np.abs(there - batch) / (np.abs(there) + SCALES[name])))
        assert not np.isnan(difference), name
        self.worst[name] = max(self.worst[name], difference)
