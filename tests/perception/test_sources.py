"""Templates that are kept are those that were made, with what they err."""

from __future__ import annotations

import numpy as np

from otwarp.perception.sources import templates_of
from tests.perception.scenes import PIECE, QUICKLY, seen_bead


def test_templates_come_back_from_the_cache(tmp_path, monkeypatch):
    """The second time nothing is rendered, and poses and errors are the same."""
    monkeypatch.setenv("OTWARP_CACHE", str(tmp_path))
    rendered: list[int] = []
    one, other = (
        templates_of(seen_bead(), 0, PIECE, rendering=QUICKLY, device="cpu", progress=lambda n, _: rendered.append(n))
        for _ in range(2)
    )
    assert len(rendered) == len(set(rendered)), "rendered twice"
    for name, values in vars(one.matcher.errors).items():
        assert np.array_equal(values, getattr(other.matcher.errors, name)), name
    assert np.any(one.matcher.errors.squares > 0.0)
    assert np.array_equal(one.matcher.templates.splines, other.matcher.templates.splines)
