"""Virtual coupling: a spring and a damper in series between the hand and what moves the traps."""

from __future__ import annotations

from otwarp.haptics.core.config import CouplingConfig
from otwarp.haptics.core.types import Vec3


class VirtualCoupling:
    """A massless proxy drawn by the hand through k_c and b_c, and by the force of the scene.

    0 = k_c(h − p) + b_c(ḣ − ṗ) + F(p). The proxy carries the traps and the hand feels F(p), which the coupling passes
    on: a stiffness k and the coupling in series, k·k_c/(k + k_c) at rest. The coupling's own spring is solved
    implicitly; F is that of the last period.

    Source: Colgate, Stanley and Brown 1995, "Issues in the haptic display of tool use", IROS.

    Args:
        config: k_c [N/m] and b_c [N·s/m].
        rate: Servo rate [Hz].
    """

    __slots__ = ("_damping", "_hand", "_stiffness", "proxy")

    def __init__(self, config: CouplingConfig, rate: float) -> None:
        self._stiffness = config.stiffness
        self._damping = config.damping * rate
        self._hand: Vec3 | None = None
        self.proxy: Vec3 = (0.0, 0.0, 0.0)

    def reset(self) -> None:
        """The next step puts the proxy at the hand."""
        self._hand = None

    def step(self, x: float, y: float, z: float, force: Vec3) -> Vec3:
        """Proxy [m] for the hand at x, y, z [m] and the force that the hand was last given by the scene [N]."""
        if self._hand is None:
            self._hand = self.proxy = (x, y, z)
        k, b = self._stiffness, self._damping
        (u, v, w), (p, q, r), (fx, fy, fz) = self._hand, self.proxy, force
        s = 1.0 / (k + b)
        p = s * (b * (p + x - u) + k * x + fx)
        q = s * (b * (q + y - v) + k * y + fy)
        r = s * (b * (r + z - w) + k * z + fz)
        self._hand, self.proxy = (x, y, z), (p, q, r)
        return self.proxy
