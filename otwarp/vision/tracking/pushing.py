"""What pushes a body besides the forces that are known: contacts, flows, a liquid of another viscosity.

The push is a velocity b [µm/s, rad/s] that comes and goes, an Ornstein–Uhlenbeck process: db = −b dt/τ + √(2 S/τ) dW,
with the variance S of a force and torque of given size through the body's mobility. It is followed with the pose, as
one state of twelve numbers; without it a late measurement says nothing of where a body is that relaxes faster than
images come.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError


@dataclass(frozen=True)
class PushLaw:
    """How large pushes are, and how long they stay.

    Attributes:
        force: Standard deviation along each axis [pN].
        arm: At which it acts, for the torque [µm].
        time: Of their correlation [s].

    Raises:
        InputError: A number out of range.
    """

    force: float = 2.0
    arm: float = 2.0
    time: float = 1.0

    def __post_init__(self) -> None:
        for name, high in (("force", 1e3), ("arm", 1e3), ("time", 1e3)):
            if not 1e-6 <= getattr(self, name) <= high:
                raise InputError(f"{name} of a push is {getattr(self, name):g}; allowed: 1e-06 to {high:g}")

    def variance(self, mobility: np.ndarray) -> np.ndarray:
        """(6, 6) S of the velocities that such forces and torques give a body.

        Args:
            mobility: (6, 6) in the axes of the world, velocity over force [µm/(s pN)] and the like.
        """
        size = np.array([self.force] * 3 + [self.force * self.arm] * 3) ** 2
        return mobility @ np.diag(size) @ mobility.T


@dataclass(frozen=True, eq=False)
class Pushed:
    """What is believed of a push.

    Attributes:
        law: Of pushes.
        velocity: (6) mean of b [µm/s, rad/s].
        joint: (12, 12) covariance of the pose's error and of b.
    """

    law: PushLaw
    velocity: np.ndarray
    joint: np.ndarray

    @classmethod
    def unknown(cls, law: PushLaw, mobility: np.ndarray, covariance: np.ndarray) -> Pushed:
        """Nothing is known of it yet.

        Args:
            law: Of pushes.
            mobility: (6, 6) in the axes of the world.
            covariance: (6, 6) of the pose.
        """
        joint = np.zeros((12, 12))
        joint[:6, :6], joint[6:, 6:] = covariance, law.variance(mobility)
        return cls(law, np.zeros(6), joint)


def with_pushes(
    rate: np.ndarray, diffusion: np.ndarray, mobility: np.ndarray, law: PushLaw
) -> tuple[np.ndarray, np.ndarray]:
    """(12, 12) rate and diffusion of pose and push together.

    Args:
        rate: (6, 6) A of the pose [1/s].
        diffusion: (6, 6) D of the pose.
        mobility: (6, 6) in the axes of the world.
        law: Of pushes.
    """
    whole, spread = np.zeros((12, 12)), np.zeros((12, 12))
    whole[:6, :6], whole[:6, 6:], whole[6:, 6:] = rate, np.eye(6), -np.eye(6) / law.time
    spread[:6, :6], spread[6:, 6:] = diffusion, law.variance(mobility) / law.time
    return whole, spread


def widened(part: np.ndarray) -> np.ndarray:
    """(12, 12) that does `part` (6, 6) to the pose and nothing to the push."""
    out = np.eye(12)
    out[:6, :6] = part
    return out
