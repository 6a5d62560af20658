"""The constant force of `ot:body:externalForce`."""

import numpy as np
import pytest

from otwarp.kernels.body_forces.external import EXTERNAL


def test_its_bounds_follow_from_its_parameter():
    assert [(p.name, p.unit, p.width) for p in EXTERNAL.parameters] == [("force", "pN", 3)]
    assert EXTERNAL.slope == 0.0
    assert EXTERNAL.load(force=np.array([[3.0, 0.0, 4.0], [0.0, 0.0, -2.0]])) == pytest.approx([5.0, 2.0])
