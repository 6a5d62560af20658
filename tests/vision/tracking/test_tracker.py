"""Late, missing and wrong measurements, two signs of a tilt, and what is refused."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.vision.tracking.commands import Commands
from otwarp.vision.tracking.measurement import Measurement
from otwarp.vision.tracking.mobile import MobileBody
from otwarp.vision.tracking.rotations import exponential, product
from otwarp.vision.tracking.shape import Shape
from otwarp.vision.tracking.tracker import Tracker

BEAD = Scene.load("scenes/single_bead.usda")


@pytest.fixture(scope="module")
def bead() -> MobileBody:
    return MobileBody(BEAD, BEAD.bodies[0].name)


@pytest.fixture(scope="module")
def dimer() -> tuple[Scene, MobileBody]:
    scene = Scene.load("scenes/two_trap_dimer.usda")
    return scene, MobileBody(scene, scene.bodies[0].name)


def tracker(body: MobileBody, scene: Scene = BEAD, **options: float) -> Tracker:
    return Tracker(body, Shape.of(scene, scene.bodies[0].name, body.reference), Commands.of_scene(scene), **options)  # type: ignore[arg-type]


def looks(body: MobileBody, count: int = 40, seed: int = 1) -> list[Measurement]:
    rng = np.random.default_rng(seed)
    centre = body.start[0]
    return [
        Measurement(
            time=0.02 * n, position=centre + 0.05 * rng.standard_normal(3), covariance=np.diag([2e-3, 2e-3, 4e-3])
        )
        for n in range(count)
    ]


@pytest.mark.quick
def test_late_measurements_give_what_they_give_in_order(bead: MobileBody) -> None:
    """To the last bit, commands that come late and predictions in between included."""
    seen = looks(bead)
    ordered, shuffled = tracker(bead), tracker(bead)
    for n, one in enumerate(seen):
        if n == 20:
            ordered.command(0.39, position=np.array([[0.3, 0.1, 5.0]]))
        ordered.add(one)
    arrival = [t + late for t, late in zip(range(40), np.random.default_rng(3).integers(0, 8, 40), strict=True)]
    replayed = 0
    for n in np.argsort(arrival, kind="stable"):
        replayed += shuffled.add(seen[n]).replayed
        shuffled.predict(seen[n].time + 0.013)
    shuffled.command(0.39, position=np.array([[0.3, 0.1, 5.0]]))
    assert replayed > 20
    a, b = ordered.predict(0.8), shuffled.predict(0.8)
    np.testing.assert_array_equal(a.position, b.position)
    np.testing.assert_array_equal(a.covariance, b.covariance)
    assert abs(a.position[0] - 0.3) < 0.1


@pytest.mark.quick
def test_prediction_goes_on_between_frames_and_changes_nothing(bead: MobileBody, monkeypatch) -> None:
    one = tracker(bead)
    for seen in looks(bead, 5):
        one.add(seen)
    before = one.predict(0.1)
    spread = [float(np.trace(one.predict(0.08 + 0.001 * n).covariance)) for n in range(50)]
    assert all(b >= a for a, b in itertools.pairwise(spread))
    np.testing.assert_array_equal(one.predict(0.1).position, before.position)
    # behind a first measurement the motion is expanded once for all predictions
    expand, asked = bead.expansion, []
    monkeypatch.setattr(bead, "expansion", lambda *words: asked.append(1) or expand(*words))
    first = tracker(bead)
    first.add(looks(bead, 1)[0])
    for n in range(10):
        first.predict(0.001 * n)
    assert len(asked) == 1
    # far on, what is left is the spread in the trap: kT over its stiffness
    late = one.predict(30.0).covariance
    rates = np.linalg.eigvals(bead.expansion(*bead.start, Commands.of_scene(BEAD).at(0.0)).rate[:3, :3])
    diffusion = bead.expansion(*bead.start, Commands.of_scene(BEAD).at(0.0)).diffusion[0, 0]
    np.testing.assert_allclose(np.sort(np.diag(late)[:3]), np.sort(diffusion / -rates.real), rtol=1e-3)


@pytest.mark.quick
def test_outliers_are_refused_and_a_lost_track_begins_anew(bead: MobileBody) -> None:
    one = tracker(bead, patience=4)
    for seen in looks(bead, 10):
        assert one.add(seen).accepted
    far = looks(bead, 20)[10:]
    for n, seen in enumerate(far[:4]):
        update = one.add(dataclasses.replace(seen, position=seen.position + np.array([3.0, 0.0, 0.0])))
        assert not update.accepted
        assert abs(one.predict(seen.time).position[0] - (3.0 if n == 3 else 0.0)) < 0.3


def test_the_sign_of_a_tilt_is_found_by_how_the_body_moves(dimer: tuple[Scene, MobileBody]) -> None:
    """A dimer that leans by an unknown sign: its traps bring it back to the focal plane either way. One that leans for
    good, because its traps do, is followed by looks whose sign means nothing."""
    scene, body = dimer
    one = tracker(body, scene)
    shape, (place, turn) = one.shape, body.start
    leaning = product(exponential([0.0, -0.3, 0.0]), turn)
    level = np.diag([1e-3, 1e-3, 2e-3, 4e-4, 4e-4])
    from otwarp.scene.transforms import rotation_matrix

    axis = rotation_matrix(leaning) @ shape.axis
    one.add(Measurement(time=0.0, position=place, axis=axis, covariance=level, mirror=0.5))
    assert len(one.hypotheses) == 2
    assert one.predict(0.0).probability == pytest.approx(0.5)
    # both come back to the focal plane, where they are one
    at_rest = rotation_matrix(turn) @ shape.axis
    for n in range(1, 4):
        one.add(Measurement(time=0.05 * n, position=place, axis=at_rest, covariance=level, mirror=0.5))
    assert len(one.hypotheses) == 1
    # traps that part in height hold the body at an angle: looks of no sign agree with one hypothesis alone
    tilted = Commands.of_scene(scene).at(0.0)[:6].reshape(2, 3).copy()
    tilted[:, 2] += [0.5, -0.5]
    one.command(0.16, position=tilted)
    held = one.predict(0.3)
    seen = rotation_matrix(held.orientation) @ shape.axis
    assert abs(math.degrees(math.asin(seen[2]))) > 8.0
    for n in range(4, 12):
        shown = seen * [1.0, 1.0, -1.0] if n % 2 else seen
        update = one.add(Measurement(time=0.1 * n, position=place, axis=shown, covariance=level, mirror=0.5))
        assert update.accepted
        now = rotation_matrix(one.predict(0.1 * n).orientation) @ shape.axis
        assert now @ seen > 0.99


def test_ends_of_a_dimer_are_not_told_apart(dimer: tuple[Scene, MobileBody]) -> None:
    scene, body = dimer
    one = tracker(body, scene)
    place, turn = body.start
    shape = one.shape
    assert shape.reversible
    assert shape.revolves
    from otwarp.scene.transforms import rotation_matrix

    axis = rotation_matrix(turn) @ shape.axis
    level = np.diag([1e-3, 1e-3, 2e-3, 4e-4, 4e-4])
    for n in range(6):
        assert one.add(Measurement(time=0.02 * n, position=place, axis=axis * (-1.0) ** n, covariance=level)).accepted
    assert np.linalg.norm(one.predict(0.12).position - place) < 0.1


@pytest.mark.quick
def test_what_cannot_be_is_refused(bead: MobileBody) -> None:
    one = tracker(bead, lag=0.1)
    good = np.diag([1e-3, 1e-3, 1e-3])
    with pytest.raises(InputError, match="nothing was measured yet"):
        one.predict(0.0)
    for seen in looks(bead, 20):
        one.add(seen)
    with pytest.raises(InputError, match=r"time of a measurement is 0.1 s; allowed: from 0.28 s on"):
        one.add(looks(bead)[5])
    with pytest.raises(InputError, match=r"time of a command is 0\.1 s"):
        one.command(0.1, power=np.array([1.0]))
    with pytest.raises(InputError, match="position of the traps has shape"):
        one.command(0.4, position=np.zeros((2, 3)))
    with pytest.raises(InputError, match="body is /World/none; allowed: /World/bead"):
        MobileBody(BEAD, "/World/none")
    for matrix, what in (
        (-good, "variance -0.001"),
        (np.zeros((3, 3)), "variance 0"),
        (good[:2, :2], "shape"),
        (good * np.nan, "not finite"),
        (np.full((3, 3), 1e-3), "not positive definite"),
    ):
        with pytest.raises(InputError, match=what):
            Measurement(time=0.0, position=np.zeros(3), covariance=matrix)
    with pytest.raises(InputError, match="position of a measurement"):
        Measurement(time=0.0, position=np.array([0.0, np.nan, 0.0]), covariance=good)
    with pytest.raises(InputError, match="time of a measurement is nan"):
        Measurement(time=math.nan, position=np.zeros(3), covariance=good)
    with pytest.raises(InputError, match="lag of a tracker is -1"):
        tracker(bead, lag=-1.0)


@pytest.mark.quick
def test_a_measurement_that_fails_takes_no_other_away(bead: MobileBody, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that comes late and is behind what a matrix can bear: those after it stay."""
    one, seen = tracker(bead), looks(bead, 10)
    for look in (*seen[:4], *seen[5:]):
        one.add(look)
    before = one.predict(0.2).position

    def fails(*_: object) -> None:
        raise np.linalg.LinAlgError("Matrix is not positive definite")

    with monkeypatch.context() as patch:
        patch.setattr("otwarp.vision.tracking.tracker.correct", fails)
        with pytest.raises(np.linalg.LinAlgError):
            one.add(seen[4])
    assert one.time == seen[-1].time and np.array_equal(one.predict(0.2).position, before)


@pytest.mark.quick
def test_what_is_not_measured_does_not_count(bead: MobileBody) -> None:
    """Depth of infinite variance leaves the depth to the trap."""
    one, two = tracker(bead), tracker(bead)
    for n, seen in enumerate(looks(bead, 10)):
        flat = np.diag([2e-3, 2e-3, np.inf])
        update = one.add(dataclasses.replace(seen, covariance=flat))
        two.add(dataclasses.replace(seen, covariance=flat, position=seen.position * [1.0, 1.0, 0.0]))
        assert update.degrees == 2 or n == 0
    np.testing.assert_array_equal(one.predict(0.2).position, two.predict(0.2).position)


@pytest.mark.quick
def test_a_ball_has_no_axis_whatever_is_said_of_one(bead: MobileBody) -> None:
    """As a network of another robot does, which --any-robot lets look at it."""
    one, two = tracker(bead), tracker(bead)
    for seen in looks(bead, 10):
        wide = np.zeros((5, 5))
        wide[:3, :3], wide[3:, 3:] = seen.covariance, 1e-4 * np.eye(2)
        assert one.add(dataclasses.replace(seen, covariance=wide, axis=np.array([0.0, 0.6, 0.8]))).accepted
        two.add(seen)
    np.testing.assert_array_equal(one.predict(0.2).position, two.predict(0.2).position)


@pytest.mark.quick
def test_commands_on_a_line_are_kept_as_its_ends() -> None:
    """A circle in steps of 1/120 s is a few straight lines, none of them off by more than was allowed."""
    told = Commands(np.zeros(1), np.array([[1.0, 0.0, 0.0, 5.0]]))
    times = np.arange(1, 241) / 120.0
    places = np.stack([np.cos(times), np.sin(times), np.zeros(240)], axis=1)
    for time, place in zip(times, places, strict=True):
        told.reach(time, position=place[None], tolerance=2e-3)
        assert np.array_equal(told.at(time)[:3], place)
    off = np.abs(np.array([told.at(t)[:3] for t in times]) - places).max()
    assert off <= 2e-3 and 8 <= len(told.times) < 40
    for time in 2.0 + times[:100]:
        told.reach(time, position=places[-1:])
    assert len(told.times) < 45 and told.times[-1] == 2.0 + times[99]
    told.reach(1.0, position=places[:1])  # what was told for later is forgotten
    assert told.times[-1] == 1.0 and np.array_equal(told.at(5.0)[:3], places[0])
    told.forget(0.5)
    assert told.times[0] <= 0.5 and np.allclose(told.at(0.5)[:3], places[59], atol=2e-3)
