"""One hypothesis about a body: a Gaussian around a pose, led on through time and corrected by measurements."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np

from otwarp.scene.transforms import rotation_matrix
from otwarp.vision.tracking.commands import Commands
from otwarp.vision.tracking.measurement import Measurement
from otwarp.vision.tracking.mobile import MobileBody
from otwarp.vision.tracking.motion import Expansion
from otwarp.vision.tracking.pushing import Pushed, widened
from otwarp.vision.tracking.rotations import cross_matrix, difference, exponential, jacobian, product
from otwarp.vision.tracking.shape import Shape

NEAR = np.array([0.1, 0.1, 0.1, 0.05, 0.05, 0.05])
"""Distances [µm] and turns [rad] from where the motion was expanded, beyond which it is expanded anew."""

MOVED = 0.1
"""Distance of a trap [µm], and relative power, from what the motion was expanded for, likewise."""

GROWN = (0.02, 1.0)
"""Exponents by which displacements may grow in one step: where it leads beyond `NEAR`, and anyway. On the falling side
of a trap's force they grow without end in the expansion, in truth only as long as the body is there; so the motion is
expanded anew on the way."""


@dataclass(frozen=True, eq=False)
class Belief:
    """Where a body is, as one hypothesis has it.

    Attributes:
        position: (3) centre of diffusion [µm].
        orientation: (4) quaternion of the prim.
        covariance: (6, 6) of position and turn in the axes of the world [µm², rad²].
        weight: Logarithm of its probability, up to a constant that all hypotheses share.
        expansion: Of the motion, near the pose.
        pushed: What is believed of a push, where one is followed.
    """

    position: np.ndarray
    orientation: np.ndarray
    covariance: np.ndarray
    weight: float = 0.0
    expansion: Expansion | None = None
    pushed: Pushed | None = None


@dataclass(frozen=True, eq=False)
class Correction:
    """What a measurement does to a hypothesis.

    Attributes:
        belief: Afterwards.
        nis: Squared innovation over its covariance, which is χ² distributed with `degrees` degrees of freedom.
        degrees: Of freedom.
        likelihood: Logarithm of the density of the measurement.
    """

    belief: Belief
    nis: float
    degrees: int
    likelihood: float


def advance(belief: Belief, body: MobileBody, commands: Commands, start: float, end: float) -> Belief:
    """The hypothesis after a time, by the body's own mobility in the traps as they move.

    Args:
        belief: At `start`.
        body: Whose motion it is.
        commands: What the traps are told.
        start, end: [s], end not before start.
    """
    times = [start, *commands.corners(start, end), end]
    for first, last in itertools.pairwise(times):
        if last <= first:
            continue
        a, b = commands.at(first), commands.before(last)
        parts = _parts(a, b)
        for n in range(parts):
            low, high = (a + (b - a) * share for share in (n / parts, (n + 1) / parts))
            belief = _moved(belief, body, low, high, (last - first) / parts)
    return belief


def _parts(first: np.ndarray, last: np.ndarray) -> int:
    """Into how many a time is divided, so that traps move little in each."""
    places = 3 * len(first) // 4
    return max(1, math.ceil(float(np.abs(last - first)[:places].max(initial=0.0)) / MOVED))


def _moved(belief: Belief, body: MobileBody, first: np.ndarray, last: np.ndarray, time: float) -> Belief:
    expansion = near(belief, body, first)
    offset = expansion.offset(belief.position, belief.orientation)
    pushed = belief.pushed
    law = None if pushed is None else pushed.law
    state = offset if pushed is None else np.concatenate([offset, pushed.velocity])
    grown = expansion.growth * time
    moved = expansion.drifted(state, time, first, last, law) if grown <= GROWN[1] else None
    if moved is None or (grown > GROWN[0] and (np.abs(moved[:6] - offset) > NEAR).any()):
        middle = 0.5 * (first + last)
        half = _moved(replace(belief, expansion=expansion), body, first, middle, 0.5 * time)
        return _moved(half, body, middle, last, 0.5 * time)
    position, orientation = expansion.pose(moved[:6])
    step = expansion.step(time, law)
    # errors are turns from the pose, the expansion counts in rotation vectors from where it was made
    after, before = _turned(moved[3:6]), np.linalg.inv(_turned(offset[3:]))
    if pushed is not None:
        after, before = widened(after), widened(before)
    change = after @ step.decay @ before
    known = belief.covariance if pushed is None else pushed.joint
    covariance = change @ known @ change.T + step.noise
    covariance = 0.5 * (covariance + covariance.T)
    if pushed is not None:
        pushed = replace(pushed, velocity=moved[6:], joint=covariance)
    return replace(
        belief, position=position, orientation=orientation, covariance=covariance[:6, :6], expansion=expansion,
        pushed=pushed,
    )  # fmt: skip


def near(belief: Belief, body: MobileBody, command: np.ndarray) -> Expansion:
    """The belief's own expansion of the motion, or a new one where that is too far away.

    Args:
        belief: Of the body.
        body: Whose motion it is.
        command: (4 T) positions and powers of the traps.
    """
    expansion = belief.expansion
    if expansion is None or _far(expansion, expansion.offset(belief.position, belief.orientation), command):
        return body.expansion(belief.position, belief.orientation, command)
    return expansion


def _far(expansion: Expansion, offset: np.ndarray, command: np.ndarray) -> bool:
    if (np.abs(offset) > NEAR).any():
        return True
    change, places = np.abs(command - expansion.command), 3 * len(command) // 4
    power = change[places:] / np.maximum(np.abs(expansion.command[places:]), 1e-9)
    return bool(change[:places].max(initial=0.0) > MOVED or power.max(initial=0.0) > MOVED)


def _turned(turn: np.ndarray) -> np.ndarray:
    """(6, 6) from displacements and rotation vectors near `turn` to displacements and turns from there."""
    out = np.eye(6)
    out[3:, 3:] = jacobian(turn)
    return out


def correct(belief: Belief, seen: Measurement, shape: Shape) -> Correction:
    """The hypothesis after a measurement of its time, by Kalman's gain in Joseph's form."""
    residual, slope, noise = seen.innovation(shape, belief.position, belief.orientation)
    pushed, known = belief.pushed, belief.covariance
    if pushed is not None:
        known, slope = pushed.joint, np.hstack([slope, np.zeros_like(slope)])
    spread = slope @ known @ slope.T + noise
    factor = np.linalg.cholesky(0.5 * (spread + spread.T))
    whitened = np.linalg.solve(factor, np.hstack([residual[:, None], slope @ known]))
    white = whitened[:, 0]
    nis = float(white @ white)
    gain = np.linalg.solve(factor.T, whitened[:, 1:]).T
    change = gain @ residual
    left = np.eye(len(known)) - gain @ slope
    covariance = left @ known @ left.T + gain @ noise @ gain.T
    reset = shape.without_roll(belief.orientation) @ _turned(change[3:6])
    if pushed is not None:
        reset = widened(reset)
    covariance = reset @ covariance @ reset.T
    covariance = 0.5 * (covariance + covariance.T)
    if pushed is not None:
        pushed = replace(pushed, velocity=pushed.velocity + change[6:], joint=covariance)
    degrees = len(residual)
    likelihood = -0.5 * (nis + degrees * math.log(2.0 * math.pi)) - float(np.log(np.diag(factor)).sum())
    after = replace(
        belief,
        position=belief.position + change[:3],
        orientation=product(exponential(change[3:6]), belief.orientation),
        covariance=covariance[:6, :6],
        pushed=pushed,
    )
    return Correction(after, nis, degrees, likelihood)


def begin(seen: Measurement, shape: Shape, place: np.ndarray, turn: np.ndarray, spread: tuple[float, float]) -> Belief:
    """A hypothesis from a first measurement, and from a guess for what it does not say.

    Args:
        seen: The measurement.
        shape: The body.
        place: (3) guess of the centre of diffusion [µm].
        turn: (4) guess of the orientation, which says how the body is turned about a measured axis.
        spread: Standard deviations of the guess [µm], [rad].
    """
    if seen.orientation is not None:
        turn = shape.nearest(seen.orientation, turn)
    elif seen.axis is not None and seen.sees_axis and np.any(shape.axis):
        axis = rotation_matrix(turn) @ shape.axis
        target = -seen.axis if shape.reversible and axis @ seen.axis < 0.0 else seen.axis
        turn = product(exponential(_arc(axis, target)), turn)
    arm = rotation_matrix(turn) @ shape.arm
    measured = seen.frame @ np.where(np.isin(np.arange(3), seen.known), seen.frame.T @ seen.position,
                                     seen.frame.T @ (place + arm))  # fmt: skip
    place = measured - arm
    _, slope, noise = seen.innovation(shape, place, turn)
    guess = np.diag([spread[0] ** -2.0] * 3 + [spread[1] ** -2.0] * 3)
    covariance = np.linalg.inv(guess + slope.T @ np.linalg.solve(noise, slope))
    rolled = shape.without_roll(turn)
    covariance = rolled @ covariance @ rolled.T
    return Belief(place, turn, 0.5 * (covariance + covariance.T))


def _arc(first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """(3) shortest rotation vector that takes one unit vector to another."""
    across, cosine = np.cross(first, last), float(first @ last)
    sine = float(np.linalg.norm(across))
    if sine < 1e-12:
        side = np.cross(first, np.eye(3)[int(np.argmin(np.abs(first)))])
        return np.zeros(3) if cosine > 0.0 else math.pi * side / np.linalg.norm(side)
    return across * (math.atan2(sine, cosine) / sine)


def apart(a: Belief, b: Belief, shape: Shape) -> float:
    """Squared distance of two hypotheses over the covariance of the first, in what can be seen."""
    nearest = shape.nearest(b.orientation, a.orientation)
    rows = shape.visible(a.orientation)
    error = rows @ np.concatenate([b.position - a.position, difference(nearest, a.orientation)])
    return float(error @ np.linalg.solve(rows @ a.covariance @ rows.T, error))


def at_prim(belief: Belief, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """(3) origin of the body's prim [µm], and the (6, 6) covariance of it and of the turn."""
    arm = rotation_matrix(belief.orientation) @ shape.origin
    change = np.eye(6)
    change[:3, 3:] = -cross_matrix(arm)
    return belief.position + arm, change @ belief.covariance @ change.T
