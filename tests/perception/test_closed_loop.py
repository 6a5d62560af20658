"""A twin that is fed by images: where it is, what is felt of it, and what happens when nothing is seen."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from otwarp.perception.camera import CameraLost, Piece
from otwarp.perception.estimator import BodyLook, Estimator
from otwarp.perception.followed import LostRule
from otwarp.perception.plant import PlantOptions
from otwarp.teleop.operators.hands import cause_of
from otwarp.teleop.operators.servo import LinkedClock
from otwarp.vision.networks.estimate import Estimate
from otwarp.vision.tracking.measurement import Measurement
from tests.perception.scenes import SIZE, TOP, Lab, estimator, seen_bead

STILL = "virtual:hold,at=0/0/0"
FALLS_WITHIN = 0.1
"""The watchdog's time of the presets [s]."""


@pytest.fixture
def lab(request):
    made = []

    def make(**options) -> Lab:
        made.append(Lab(**options))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.mark.quick
def test_the_twin_is_where_the_plant_has_the_bead(lab):
    """Late images lead to where the bead is now: 0.03 s at 2.5 µm/s would be 0.075 µm."""
    one = lab(delay=0.03)
    one.run(12)
    twin, truth, _ = one.run(90)
    error = twin - truth
    # in this trap a bead scatters by 0.020 µm about where it is drawn to, which 0.03 s later nothing is known of
    spread = math.sqrt(0.00411 / 10.0)
    assert np.abs(error.mean(axis=0)).max() < 5.0 * spread / math.sqrt(15.0)
    assert np.sqrt((error**2).mean(axis=0)).max() < 2.0 * spread
    assert twin[-1, 0] - twin[0, 0] == pytest.approx(2.5 * 89 / 120, abs=0.03)
    body = one.perception.now().bodies[0]
    assert not body.why and body.deviation is not None and 0.5 * spread < body.deviation[0] < 3.0 * spread


def test_a_hand_feels_what_only_images_can_say(lab):
    """The plant is ten times as viscous as the twin believes: images show the lag, and that is felt."""
    means = []
    for factor in (1.0, 10.0):
        one = lab(delay=0.01, plant=PlantOptions(seed=5, viscosity=factor))
        one.run(70)
        _, _, force = one.run(60)
        means.append(-force[:, 0].mean())
    drag = 0.02 * 6.0 * math.pi * 0.00089 * 2.5
    # the mean of half a second of thermal scatter has a standard error of 0.7 of that drag
    assert abs(means[0] - drag) < 5.0 * 0.7 * drag
    assert means[1] - means[0] == pytest.approx(9.0 * drag, abs=5.0 * math.sqrt(2.0) * 0.7 * drag)


def test_the_same_seed_gives_the_same_bits(lab):
    first, again = lab().run(30), lab().run(30)
    for a, b in zip(first, again, strict=True):
        assert a.tobytes() == b.tobytes()
    other, _, _ = lab(plant=PlantOptions(seed=6)).run(30)
    assert other.tobytes() != first[0].tobytes()


class Broken:
    """A camera that does what it is told to with the frames of another."""

    def __init__(self, camera, change):
        self._camera, self._change = camera, change
        self.frames = 0

    def __getattr__(self, name):
        return getattr(self._camera, name)

    def command(self, *told):
        self._camera.command(*told)

    def restart(self):
        self._camera.restart()

    def read(self, now):
        frame = self._camera.read(now)
        if frame is None:
            return None
        self.frames += 1
        return self._change(self.frames, frame)


def unchanged(n, frame):
    return frame


def ends(n, frame):
    if n > 30:
        raise CameraLost("camera top has ended after 30 images")
    return frame


def jumps(n, frame):
    return replace(frame, time=frame.time - (10.0 if n > 30 else 0.0))


def is_early(n, frame):
    return replace(frame, time=frame.time + (0.2 if n > 30 else 0.0))


def goes_dark(n, frame):
    if n <= 30:
        return frame
    return replace(frame, pieces=tuple(replace(p, levels=np.full_like(p.levels, 89)) for p in frame.pieces))


def goes_back(n, frame):
    return replace(frame, time=frame.time - (0.5 if n > 30 else 0.0))


NAN: dict[str, Any] = {"x": math.nan}
SAID: dict[str, Any] = {"x": 0.0, "y": 0.0, "depth": 0.0, "tilt": 0.0, "yaw": 0.0, "covariance": 1e-4 * np.eye(5)}


class Blinking:
    """Templates that say something else now and then."""

    def __init__(self, when: range, **said):
        self._when, self._said, self._looks = when, said or NAN, 0
        self._source = estimator().sources[0]

    def look(self, image, guess):
        self._looks += 1
        if self._looks in self._when:
            return Estimate(**(SAID | self._said)), 0.0
        return self._source.look(image, guess)


@pytest.mark.parametrize(
    ("change", "wrong", "waited", "said"),
    [
        (ends, None, False, "camera top has ended after 30 images"),
        (jumps, None, False, "stamps of the camera are 10 s behind the clock, allowed up to 2 s behind"),
        (goes_back, None, False, "s after its light, allowed up to 0.3 s"),
        (is_early, None, False, "s ahead of the clock, allowed up to 0.005 s ahead"),
        (unchanged, NAN, False, "the estimator fails: it says nan"),
        (unchanged, {"x": 1e12}, False, "it says 1e+12, 0, 0 µm from the middle of its piece; allowed: up to 4.16, "),
        (unchanged, {"covariance": math.nan * np.eye(5)}, False, "covariance of a measurement is not finite"),
        (unchanged, {"covariance": 1e300 * np.eye(5)}, True, "the image does not show it"),
        (unchanged, {"covariance": 5.0**2 * np.eye(5)}, True, "the image does not show it"),  # the piece has 4.16 µm
        (goes_dark, None, True, "the image does not show it"),
    ],
)
def test_what_is_not_seen_is_not_felt(lab, change, wrong, waited, said):
    """Its force falls within the watchdog's time of the first such frame, and one line says why.

    Images that do not show it are waited out first.
    """
    rule = LostRule()
    look = Estimator(TOP, SIZE, {0: Blinking(range(31, 10**6), **wrong)}) if wrong else None
    one = lab(wrap=lambda camera: Broken(camera, change), look=look, rule=rule)
    one.run(36)  # 30 frames
    before = one.state
    assert before == "armed"
    wait = rule.after if waited else 0.0
    # the next frame is there within 0.03 s, and is dealt with in the next turn of the loop
    _, _, force = one.run(math.ceil((wait + 0.03 + FALLS_WITHIN) * 120) + 1)
    assert one.state == "disarmed" and not np.any(force[-1])
    (line,) = (w for w in one.stage.watcher.frames[-1].warnings if "nothing is felt of" in w)
    assert said in line and "\n" not in line
    assert bool(one.perception.now().ended) is (change is ends)
    # who has no page reads it as news of the hand, once, and not that its watchdog disarmed it
    first, news = one.stage.news
    assert "is lost: not seen yet" in first and said in news
    assert news.startswith("right hand: feels nothing until it is seen again: /World/bead_right is lost: ")


def test_a_stamp_that_is_refused_is_no_latency(lab, monkeypatch):
    """One image that claims to be of a second later is not among those that say how long light takes to a state."""
    monkeypatch.setattr("otwarp.perception.closed_loop.RealClock", LinkedClock)
    one = lab(
        wrap=lambda camera: Broken(camera, lambda n, frame: replace(frame, time=frame.time + (n == 10))),
        rule=LostRule(after=1.0),
    )
    one.run(36)
    perception = one.perception
    assert perception.bodies[0].refused == 1 and len(perception.latency) == perception.frames - 1


def test_a_slow_laboratory_hides_nothing(lab):
    """Three images a second, half a second old: light is up to 1/3 s + 0.5 s old when the next comes."""
    one = lab(delay=0.5, rate=3.0, rule=LostRule(patience=2.0, uncertain=100.0))
    one.run(180)
    # before the first image, 1/3 s and its delay, nothing is known
    lost = one.perception.summary()["bodies"][0]["lost"]
    assert lost == pytest.approx((1.0 / 3.0 + 0.5) / (180 / 120), abs=0.03)
    rule = LostRule(patience=2.0)
    assert [rule.within(age) for age in (0.0, 0.1, 0.5, 5.0)] == [rule.after, rule.after, 1.0, rule.lag]
    assert LostRule().within(5.0) == LostRule().after


def test_a_laboratory_that_is_too_slow_is_named(lab):
    """An image of it comes after the last moment at which its stamp would count: no clock is at fault."""
    one = lab(delay=2.2, rate=3.0, rule=LostRule(patience=2.0))
    one.run(330)
    assert "this machine takes 2.2 s for an image, allowed up to 2 s; --follow fewer bodies" in one.stage.news[-1]


def test_what_is_seen_again_comes_back_by_the_ramp(lab):
    """An estimator that says nan for a while: the force falls, and ramps in again without anybody arming."""
    one = lab(look=Estimator(TOP, SIZE, {0: Blinking(range(40, 60))}))
    states, said = [], set()
    for _ in range(140):
        one.run(1)
        states.append(one.state)
        said |= {w for w in one.stage.watcher.frames[-1].warnings if "is lost" in w}
    changes = [s for s, before in zip(states, ["", *states], strict=False) if s != before]
    assert changes == ["disarmed", "ramping", "armed", "decaying", "disarmed", "ramping", "armed"]
    assert any("it says nan" in line for line in said)


@pytest.mark.parametrize("every", [2, 10])
def test_a_bad_image_now_and_then_gives_no_pulses(lab, every):
    """Good ones between do not bring the force back before it is gone, nor after."""
    one = lab(look=Estimator(TOP, SIZE, {0: Blinking(range(31, 10**6, every))}))
    one.run(36)
    assert one.state == "armed"
    _, _, force = one.run(90)
    # the first of them is dealt with within 0.03 s
    assert not np.any(force[math.ceil((0.03 + FALLS_WITHIN) * 120) + 1 :])


class Stumbling:
    """Fails at every image, by turns in two ways."""

    def __init__(self):
        self._looks = 0

    def look(self, image, guess):
        self._looks += 1
        raise ValueError("Singular matrix" if self._looks % 2 else "no eigenvalues above 0")


def test_causes_that_take_turns_are_said_once_each(lab):
    """Else there were a line for every image."""
    one = lab(look=Estimator(TOP, SIZE, {0: Stumbling()}))
    one.run(60)
    assert one.perception.frames > 20
    said = [line.partition("is lost: ")[2] for line in one.stage.news]
    assert said == [
        "not seen yet",
        "the estimator fails: Singular matrix",
        "the estimator fails: no eigenvalues above 0",
    ]


class Raving:
    """Says places of any size and sign, none of them believable."""

    def __init__(self):
        self._looks = 0

    def look(self, image, guess):
        self._looks += 1
        sizes = 10.0 ** (self._looks % 9 + np.array([-3.0, 1.0, 4.0]))
        x, y, depth = SIGNS[self._looks % 8] * sizes
        return Estimate(**(SAID | {"x": x, "y": y, "depth": depth})), 0.0


SIGNS = np.array(list(itertools.product((1.0, -1.0), repeat=3)))


def test_a_cause_whose_numbers_change_is_said_once(lab):
    """Numbers have signs and exponents, which are no other cause."""
    one = lab(look=Estimator(TOP, SIZE, {0: Raving()}))
    one.run(60)
    assert one.perception.frames > 20
    first, news = one.stage.news
    assert "not seen yet" in first and "the estimator fails: it says " in news
    assert cause_of("/World/bead_2: -1e+09, inf, nan") == cause_of("/World/bead_2: 2.5e-3, -inf, 3")
    assert cause_of("/World/bead_2: 3") != cause_of("/World/bead_1: 3")


def test_a_first_stamp_that_is_a_little_ahead_waits_for_its_time(lab):
    """As cameras whose clock is 4 ms ahead give: nothing is known before it."""
    one = lab()
    (body,) = one.perception.bodies
    now, trap = one.clock.now(), np.array(seen_bead().traps[0].position.at(0.0))
    piece = Piece(0, 0, np.zeros((0, 0), dtype=np.uint8))
    for n, x in enumerate((0.0, 0.02), 1):
        seen = Measurement(time=now + 0.004, position=trap + x * np.eye(3)[0], covariance=1e-4 * np.eye(3))
        body.take(BodyLook(body=0, piece=piece, guess=None, seen=seen), now)
        body.move(now)
        assert body.accepted == n and body.why == ("not seen yet" if n == 1 else "")
        now += 0.005
        body.move(now)
        assert body.seen and body.pose is not None
        np.testing.assert_array_equal(body.pose.position, body.tracker.predict(now).position)


def test_who_is_disarmed_while_lost_stays_so(lab):
    one = lab(look=Estimator(TOP, SIZE, {0: Blinking(range(40, 60))}), device=STILL)
    one.run(66)
    assert one.state == "disarmed" and one.perception.warnings
    one.stage.loop.hands.arm(None, on=False)
    one.run(60)
    assert one.state == "disarmed" and not one.perception.warnings


def test_what_is_lost_twice_in_a_row_comes_back(lab):
    """A body that is lost again before the servo has told what it made of the last order."""
    one = lab()
    one.run(40)
    hands = one.stage.loop.hands
    assert one.state == "armed"
    for orders in (1, 2):  # the latter within a turn of the loop
        for traps in ({0: "lost"}, {}) * orders:
            hands.withhold(traps)
        states = [one.state for _ in range(30) if one.run(1)]
        assert "decaying" in states and states[-1] == "armed"


def test_a_stamp_that_is_wrong_from_the_start_is_said(lab):
    """The hand is let go before anything is known, and then says why nothing is."""
    one = lab(wrap=lambda camera: Broken(camera, lambda n, frame: replace(frame, time=frame.time + 1.0)))
    one.run(20)
    first, news = one.stage.news
    assert "not seen yet" in first and "s ahead of the clock" in news


def test_frames_out_of_order_are_put_in_at_their_time(lab):
    """Neighbours are swapped: each odd frame comes after the one that was taken after it."""
    held = []

    def swapped(n, frame):
        if n % 2 == 0:
            return frame
        held.append(frame)
        return held.pop(0) if n > 1 else None

    one = lab(delay=0.0, wrap=lambda camera: Broken(camera, swapped))
    one.run(20)
    twin, truth, _ = one.run(60)
    assert one.perception.disordered > 25 and not one.perception.warnings
    assert one.perception.bodies[0].refused == 0
    assert np.sqrt(((twin - truth) ** 2).mean(axis=0)).max() < 0.03


def test_a_reset_begins_with_the_plant_as_well(lab):
    one = lab()
    one.run(60)
    one.stage.loop._reset()
    assert one.perception.warnings
    twin, truth, _ = one.run(20)
    assert one.plant.sim.time < 0.2 and not one.perception.warnings
    assert np.abs(twin[-1] - truth[-1]).max() < 0.12


def test_a_turn_waits_for_an_image_that_is_due(lab, monkeypatch):
    """By the pace of late: 100 a second here, each looked at in a turn of its own."""
    one, asked = lab(rate=100.0), []
    loop = one.perception
    monkeypatch.setattr(loop._looker, "await_look", lambda until: asked.append(until) or True)
    assert loop.await_news(one.clock.now() + 0.004)
    assert asked == [one.clock.now()]  # nothing came so far: it looks, and does not wait
    one.run(120)
    # as if the last one had come now: the run has gone on for a turn since
    last = one.clock.now()
    loop._times = [time + last - loop._times[-1] for time in loop._times]
    for away, waits in ((0.002, False), (0.007, True), (0.012, True), (0.02, False)):
        one.clock.sleep_until(last + away)
        assert loop.await_news(last + away + 0.004)
        assert asked[-1] == pytest.approx(last + away + (0.004 if waits else 0.0), abs=1e-9)
