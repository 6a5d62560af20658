"""Haptic chains of many hands at once: `ChainBatch`, the twin of `otwarp.haptics.chain` on a device of Warp."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from otwarp.device import empty, pick_device
from otwarp.errors import InputError
from otwarp.haptics.chain.chain import DEAD_MAN
from otwarp.haptics.chain.motion import LONGEST_WINDOW
from otwarp.haptics.core import DeviceInfo
from otwarp.operators import constants as packing
from otwarp.operators.kernels import chain_data as twin
from otwarp.operators.kernels import local_model, orders
from otwarp.operators.kernels.chain import step_kernel
from otwarp.operators.kernels.features import ChainFeatures
from otwarp.teleop.operators import HandPlan, LocalScene


class ChainBatch:
    """The chains of H hands in each of W worlds, stepped together in float64.

    All arrays are written and read in place, between steps. Every hand starts disarmed.

    Args:
        plans: The H hands of a world, as `otwarp.teleop.operators.plan_hands` gives them; the same in all worlds.
        local: What they feel: laws, and S slots of spheres.
        worlds: W.
        device: Of Warp; None for the first GPU, else the CPU.
        infos: What each hand's device can do, whose limits then count where they are lower; None for as configured.
        traps: Traps of the scene, T in all; None for as many as the hands' indices need.

    Attributes:
        hand: In: (W, H) vec3d, where the device is [m].
        fresh: In: (W, H) int32, whether the device has spoken since the last period; 1 at first.
        buttons: In: (W, H) int32, bits as `DeviceSample.buttons`; at first the dead-man switch is held.
        elapsed: In: (W) float64, time on the servo's clock since the last period [s]; one period at first.
        force_gain: In: (W, H) float64, of the paper's G_hand [N/pN]; as configured at first, 0 for no haptics.
        sphere: In: (W, S) vec3d, spheres in the newest state [µm].
        body: In: (W, S) int32, whose sphere is in each slot, as `SphereFrame.body`.
        trap, power: In: (W, T) vec3d and float64, traps in the newest state [µm, mW].
        time: In: (W) float64, simulated time of the newest state [s].
        force, asked: Out: (W, H) vec3d, sent to the device, and asked of safety [N].
        commanded: Out: (W, T) vec3d, where hands command their traps; others as in the newest state [µm].
        energy: Out: (W, H) float64, as `ServoFrame.energy` [J].
        phase: Out: (W, H) int32, index into `otwarp.haptics.core.STATES`.
        holds: Out: (W, H) int32, whether the hand has hold of its traps.
        motion: In and out: (W·H) `MotionState`, how far hands have carried their traps [µm].
        cause: Out: (W, H) int32, index into `kernels.chain_data.CAUSES`: why it has disarmed by itself.

    Raises:
        InputError: No hand, worlds not a whole number from 1 on, a trap without a law, a law that no operator can feel,
            paper mode with a table, a trap that is not there.
    """

    def __init__(
        self,
        plans: Sequence[HandPlan],
        local: LocalScene,
        worlds: int,
        *,
        device: str | wp.Device | None = None,
        infos: Sequence[DeviceInfo | None] | None = None,
        traps: int | None = None,
    ) -> None:
        configs = packing.limited_configs(plans, infos)
        if isinstance(worlds, bool) or not isinstance(worlds, int) or worlds < 1:
            raise InputError(f"worlds is {worlds!r}; allowed: whole numbers from 1 on")
        self.worlds, self.hands, self.device = worlds, len(configs), pick_device(device)
        self.configs = configs
        scene = packing.felt_by(configs, local, traps)
        features = [ChainFeatures.of(config, scene.models) for config in configs]
        self._data = twin.ChainData()
        packing.put_constants(self._data, configs, scene, self.device)
        self._put_ports(scene)
        self._put_states(scene, features)
        self._owner = wp.array(scene.owner, dtype=wp.int32, device=self.device)
        self._launches = [
            self._recorded(step_kernel(one), [n for n, f in enumerate(features) if f == one])
            for one in dict.fromkeys(features)
        ]
        self.reset()

    def step(self) -> None:
        """One servo period of all hands of all worlds; one launch, or one for each kind of chain among the hands."""
        for launch in self._launches:
            launch.launch()

    def refresh(self, time: float | wp.array | None = None, worlds: wp.array | None = None) -> None:
        """A new state was published: the next step takes in `sphere`, `body`, `trap` and `power`.

        Args:
            time: Simulated, of that state [s]: of all worlds, or (W) float64; None for what is in the array `time`.
            worlds: (W) bool, which worlds; None for all.
        """
        if isinstance(time, wp.array):
            wp.copy(self.time, time)
        elif time is not None:
            self.time.fill_(float(time))
        self._tell(orders.publish, self._owner, worlds, over=len(self._owner))

    def arm(self, worlds: wp.array | None = None) -> None:
        """Allow force in these worlds, (W) bool, None for all: from zero by the ramp; clears a fault."""
        self._tell(orders.order, 1, worlds)

    def disarm(self, worlds: wp.array | None = None) -> None:
        """Let the force fall to zero in these worlds, (W) bool, None for all."""
        self._tell(orders.order, 0, worlds)

    def reset(self, worlds: wp.array | None = None) -> None:
        """Chains of these worlds as they are made, (W) bool, None for all: disarmed, with nothing remembered.

        What comes in stays as it is: gains, and a state that was published, which the next step takes in.
        """
        self._tell(orders.begin, worlds)

    def _tell(self, kernel: Any, *inputs: Any, over: int | None = None) -> None:
        dim = (self.worlds, over or self.hands)
        wp.launch(kernel, dim=dim, inputs=[self._data, *inputs], device=self.device)

    def _recorded(self, kernel: wp.Kernel, hands: list[int]) -> Any:
        """The launch of a kernel for some hands, packed once."""
        chosen = wp.array(hands, dtype=wp.int32, device=self.device)
        inputs = [self._data, chosen]
        return wp.launch(kernel, dim=(self.worlds, len(hands)), inputs=inputs, device=self.device, record_cmd=True)

    def _put_ports(self, scene: packing.FeltScene) -> None:
        """Arrays by which callers and chains meet."""
        data, hands, device = self._data, (self.worlds, self.hands), self.device
        period = 1.0 / self.configs[0].chain.rate
        ports, published = twin.Ports(), local_model.Published()
        self.hand = ports.hand = zeros(hands, wp.vec3d, device)
        self.fresh = ports.fresh = wp.full(hands, 1, dtype=wp.int32, device=device)
        self.buttons = ports.buttons = wp.full(hands, DEAD_MAN, dtype=wp.int32, device=device)
        self.elapsed = ports.elapsed = wp.full(self.worlds, period, dtype=wp.float64, device=device)
        gains = np.tile([config.force_gain for config in self.configs], (self.worlds, 1))
        self.force_gain = ports.force_gain = wp.array(gains, dtype=wp.float64, device=device)
        self.force = ports.force = zeros(hands, wp.vec3d, device)
        self.asked = ports.asked = zeros(hands, wp.vec3d, device)
        self.commanded = ports.commanded = zeros((self.worlds, len(scene.owner)), wp.vec3d, device)
        self.energy = ports.energy = zeros(hands, wp.float64, device)
        self.phase = ports.phase = zeros(hands, wp.int32, device)
        self.holds = ports.holds = zeros(hands, wp.int32, device)
        self.cause = ports.cause = zeros(hands, wp.int32, device)
        self.sphere = published.sphere = zeros((self.worlds, len(scene.kinds)), wp.vec3d, device)
        bodies = np.tile(scene.bodies, (self.worlds, 1))
        self.body = published.body = wp.array(bodies, dtype=wp.int32, device=device)
        self.trap = published.trap = zeros((self.worlds, len(scene.owner)), wp.vec3d, device)
        self.power = published.power = zeros((self.worlds, len(scene.owner)), wp.float64, device)
        self.time = published.time = zeros((self.worlds,), wp.float64, device)
        published.beat = zeros((self.worlds,), wp.int32, device)
        data.ports, data.published = ports, published

    def _put_states(self, scene: packing.FeltScene, features: Sequence[ChainFeatures]) -> None:
        """What chains remember; empty for parts that no hand has."""
        data, device, n = self._data, self.device, self.worlds * self.hands
        glides, predicts = any(f.glides for f in features), any(f.predicts for f in features)
        spheres, per_sphere = local_model.Spheres(), (n, len(scene.kinds))
        per_trap = (n, scene.trap.shape[1])
        spheres.target = zeros(per_sphere, wp.vec3d, device)
        spheres.body = zeros(per_sphere, wp.int32, device)
        spheres.place = zeros(per_sphere if glides else (0, 0), wp.vec3d, device)
        spheres.went = zeros(per_sphere if predicts else (0, 0), wp.float64, device)
        spheres.share = zeros(per_sphere if predicts else (0, 0), wp.float64, device)
        spheres.anchor = zeros(per_trap, wp.vec3d, device)
        spheres.power = zeros(per_trap, wp.float64, device)
        data.spheres = spheres
        moves = [f.windowed for f in features if f.velocity]
        length = (LONGEST_WINDOW if any(moves) else 1) if moves else 0
        window = twin.Window()
        window.place = zeros((n if length else 0, length), wp.vec3d, device)
        window.age = zeros((n if length else 0, length), wp.float64, device)
        data.window = window
        data.state = zeros((n,), twin.ChainState, device)
        self.motion = data.motion = zeros((n,), twin.MotionState, device)
        data.velocity = zeros((n,), twin.VelocityState, device)
        data.model = zeros((n,), twin.ModelState, device)
        data.passivity = zeros((n,), twin.PassivityState, device)
        data.safety = zeros((n,), twin.SafetyState, device)
        data.paper = zeros((n,), twin.PaperState, device)


def zeros(shape: tuple[int, ...], dtype: Any, device: wp.Device) -> wp.array:
    """Zeros of any type of Warp, structs as well."""
    out = empty(shape, dtype, device)
    out.zero_()
    return out
