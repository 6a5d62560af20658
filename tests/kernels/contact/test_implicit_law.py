"""The law of a contact as a function of its opening, against float64."""

import numpy as np
import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.implicit_law import depth_at, first_line, tangent
from tests.kernels.samples import evaluate, on_device
from tests.reference import contact_law

NEAR = 0.01
"""Depths relative to the exact one: what Newton's steps leave after one of a hundredth, and more than that."""

SLOPE = 0.05
"""Slopes relative to the exact one: they are those of the step before the last."""

DIGITS = 0.01
"""Lone contacts relative to the exact one: three of Newton's steps from below."""


@wp.func
def contact_of(law: wp.vec4, give: float, floor: float) -> Contact:
    c = Contact()
    c.overlap = law[0]
    c.hardness = law[1]
    c.wander = law[2]
    c.layer = law[3]
    c.give = give
    c.floor = floor
    c.radius = 1.0
    return c


@wp.kernel(enable_backward=False)
def probe_law(
    law: wp.array(dtype=wp.vec4), give: wp.array(dtype=float), opening: wp.array(dtype=float),
    guess: wp.array(dtype=float), found: wp.array(dtype=wp.vec2), line: wp.array(dtype=wp.vec3),
):  # fmt: skip
    i = wp.tid()
    c = contact_of(law[i], give[i], -0.1)
    d = depth_at(c, opening[i], guess[i])
    found[i] = wp.vec2(d.value, d.slope)
    t = tangent(c, opening[i], guess[i])
    line[i] = wp.vec3(t.load, t.slope, t.depth)


@wp.kernel(enable_backward=False)
def probe_alone(
    law: wp.array(dtype=wp.vec4), give: wp.array(dtype=float), opening: wp.array(dtype=float),
    line: wp.array(dtype=wp.vec3),
):  # fmt: skip
    i = wp.tid()
    first = first_line(contact_of(law[i], give[i], -0.1), opening[i])
    line[i] = wp.vec3(first.load, first.slope, first.depth)


def samples(n: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Laws (n, 4), gives and openings of contacts with κ of about 1 to 10, half of them with a path."""
    rng = np.random.default_rng(3)
    give = rng.uniform(0.01, 0.04, n)
    overlap = rng.uniform(-0.02, 0.02, n)
    opening = rng.uniform(-0.03, 0.03, n)
    wander = np.where(rng.random(n) < 0.5, -8.0 * 4e-3 * give * np.log(rng.random(n)), 0.0)
    law = np.stack([overlap, rng.uniform(300.0, 2000.0, n), wander, rng.uniform(2e-3, 1e-2, n)], axis=1)
    return law.astype(np.float32).astype(float), give.astype(np.float32), opening.astype(np.float32)


def test_depth_and_slope(device):
    """Both branches: where Hertz's law asks for more, and where the path does."""
    law, give, opening = samples()
    exact = np.array(
        [contact_law.depth(s, o, k, g, w, y) for s, (o, k, w, y), g in zip(opening, law, give, strict=True)]
    )
    step = 1e-6
    ends = [
        np.array(
            [contact_law.depth(s + h, o, k, g, w, y) for s, (o, k, w, y), g in zip(opening, law, give, strict=True)]
        )
        for h in (-step, step)
    ]
    slope = (ends[0] - ends[1]) / (2.0 * step)
    inputs = on_device(device, (law, wp.vec4), (give, float), (opening, float), (1.2 * exact, float))
    found, line = evaluate(probe_law, len(give), inputs, [wp.vec2, wp.vec3], device)
    by_path = exact > np.maximum(law[:, 0] - opening, 0.0) + 1e-7
    assert 0.1 < by_path.mean() < 0.5
    np.testing.assert_allclose(found[:, 0], exact, rtol=NEAR, atol=1e-8)
    clear = np.abs(law[:, 0] - opening) > 2.0 * step
    np.testing.assert_allclose(found[clear, 1], slope[clear], rtol=SLOPE, atol=2e-3)
    # load and its slope follow from the depth and its own
    deep, hardness = found[:, 0], law[:, 1]
    np.testing.assert_allclose(line[:, 0], -0.1 + hardness * deep**1.5, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(line[:, 1], 1.5 * hardness * np.sqrt(deep) * found[:, 1], rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(line[:, 2], deep)


def test_a_lone_contact_is_solved_at_once(device):
    """λ of the first line, where it ends by itself, is the law's there, and so is its slope."""
    law, give, opening = samples()
    inputs = on_device(device, (law, wp.vec4), (give, float), (opening, float))
    (line,) = evaluate(probe_alone, len(give), inputs, [wp.vec3], device)
    floor = np.full(len(give), -0.1)
    # where the line meets the gap's own answer, which opens it by give·load
    load = line[:, 0] / (1.0 + give * line[:, 1])
    s = opening + give * load
    expected = contact_law.loads(s, floor, law, give)
    np.testing.assert_allclose(load, expected, rtol=DIGITS, atol=DIGITS * np.abs(expected).max())
    assert np.mean(line[:, 2] > 0.0) > 0.3
    step = 1e-6
    ends = [contact_law.loads(s + h, floor, law, give) for h in (-step, step)]
    pressed = line[:, 2] > 1e-4
    slope = (ends[0] - ends[1]) / (2.0 * step)
    np.testing.assert_allclose(line[pressed, 1], slope[pressed], rtol=SLOPE)
