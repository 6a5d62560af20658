"""The paper's contract: names by pairing, units and axes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from otwarp.errors import InputError
from otwarp.haptics.core.config import FACING_USER, IDENTITY
from otwarp.haptics.core.fields import from_dict, to_dict
from otwarp.ros.contract import SIMULATOR_TOPICS, Axes, ContractConfig, product, quaternion

EXACT = 1e-12
"""Relative: a dozen products of float64."""

ROTATIONS = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: math.hypot(*q) > 0.1)


def matrix(rotation: Rotation):
    a = rotation.as_matrix()
    return tuple(tuple(float(x) for x in row) for row in a)


def test_topics_of_the_simulator():
    assert (
        *("/firstOTposition", "/secondOTposition", "/robot01", "/robot02", "/xform"),
        *("/DynaOb01", "/DynaOb02", "/DynaOb03", "/DynaOb04"),
    ) == SIMULATOR_TOPICS


def test_the_release_pairs_left_with_the_first():
    left, right = ContractConfig().hands()
    assert (left.hand, left.group, left.smoothed_twist) == ("left", 0, "/GeomagicLeft/smoothed_twist")
    assert (right.hand, right.group, right.smoothed_twist) == ("right", 1, "/GeomagicRight/smoothed_twist")
    assert left.topic("force_feedback") == "/GeomagicLeft/force_feedback"
    assert left.topic("smoothed_twist") == left.smoothed_twist


def test_the_older_release_pairs_them_the_other_way_round():
    left, right = ContractConfig(pairing="older").hands()
    assert (left.group, left.smoothed_twist) == (1, "/Geomagic/smoothedTwist")
    assert (right.group, right.smoothed_twist) == (0, "/Geomagic2/smoothedTwist")


def test_namespaces_are_configuration():
    left, right = ContractConfig(namespaces=("lab/a", "/b/")).hands()
    assert (left.namespace, right.namespace) == ("/lab/a", "/b")


def test_configuration_goes_through_json():
    config = ContractConfig(pairing="older", scene_unit=20.0, namespaces=("a", "b"), axis_map=IDENTITY)
    assert from_dict(ContractConfig, to_dict(config)) == config


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"pairing": "newer"}, "contract.pairing is 'newer'; allowed: release, older"),
        ({"rate": 0.0}, "contract.rate is 0.0; allowed: 1 to 1000 Hz"),
        ({"scene_unit": 0.0}, "contract.scene_unit is 0.0; allowed: above 0"),
        ({"scene_unit": math.nan}, "contract.scene_unit is nan"),
        ({"motion_gain": -1.0}, "contract.motion_gain is -1.0"),
        ({"twist_timeout": math.inf}, "contract.twist_timeout is inf"),
        ({"namespaces": ("a",)}, "namespaces is 'a'; allowed: none, or two different ones"),
        ({"namespaces": ("a", "/a")}, "two different ones"),
        ({"namespaces": ("a", "/")}, "two different ones"),
        ({"axis_map": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))}, "rotation without reflection"),
        ({"axis_map": ((2.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))}, "axis_map"),
    ],
)
def test_bad_configuration_is_one_line(changed, says):
    with pytest.raises(InputError) as error:
        replace(ContractConfig(), **changed)
    assert says in str(error.value) and "\n" not in str(error.value)


@given(ROTATIONS)
@settings(deadline=None)
def test_quaternion_of_a_matrix(components):
    rotation = Rotation.from_quat(components)
    ours = Rotation.from_quat(quaternion(matrix(rotation)))
    assert (ours * rotation.inv()).magnitude() < 1e-7  # arccos near 1 doubles the digits that rounding costs


@given(ROTATIONS, ROTATIONS)
@settings(deadline=None)
def test_poses_turn_with_the_axes(axes, body):
    """A point fixed to the body is published at the same place whether pose or point is turned."""
    a, q = Rotation.from_quat(axes), Rotation.from_quat(body)
    bridge = Axes(ContractConfig(axis_map=matrix(a), scene_unit=20.0))
    centre, arm = np.array([3.0, -40.0, 5.0]), np.array([1.0, 2.0, -3.0])
    position, orientation = bridge.pose((centre, q.as_quat()))
    published = np.array(position) + Rotation.from_quat(orientation).apply(arm) / 20.0
    np.testing.assert_allclose(published, bridge.point(centre + q.apply(arm)), rtol=0, atol=1e-9)
    np.testing.assert_allclose(published, a.inv().apply(centre + q.apply(arm)) / 20.0, rtol=0, atol=1e-9)


def test_a_push_is_felt_where_it_comes_from():
    """A robot above the trap (scene z) is above it for the device (its y): the release's force needs no map."""
    axes = Axes(ContractConfig(scene_unit=25.0))
    trap, robot = axes.point((0.0, 0.0, 0.0)), axes.point((0.0, 0.0, 2.5))
    np.testing.assert_allclose(np.subtract(robot, trap), (0.0, 0.1, 0.0), atol=EXACT)
    # and the hand that goes up moves the trap up, by gain times unit
    np.testing.assert_allclose(axes.motion((0.0, 10.0, 0.0)), (0.0, 0.0, 10.0 * 0.004 * 25.0), atol=EXACT)


def test_default_gain_is_that_of_a_hand():
    """100 µm per metre of `HandConfig`, 0.1 µm per mm."""
    from otwarp.haptics.core.config import HandConfig

    moved = Axes(ContractConfig(axis_map=IDENTITY)).motion((1000.0, 0.0, 0.0))
    assert moved[0] == pytest.approx(HandConfig().motion_gain, rel=EXACT)


def test_product_of_quaternions():
    p, q = Rotation.from_euler("xyz", (0.3, -1.0, 2.0)), Rotation.from_euler("xyz", (1.3, 0.4, -0.2))
    ours = product(tuple(p.as_quat()), tuple(q.as_quat()))
    np.testing.assert_allclose(Rotation.from_quat(ours).as_matrix(), (p * q).as_matrix(), atol=EXACT)
    assert FACING_USER != IDENTITY
    np.testing.assert_allclose(Rotation.from_quat(quaternion(FACING_USER)).as_matrix(), FACING_USER, atol=EXACT)
