"""Robots go to other processes and are copied, whole and as read-only as before."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pinocchio as pin
import pytest

from wbc.effects import CoulombFriction, load_robot
from wbc.robot import robot_names


@pytest.mark.parametrize("how", [copy.deepcopy, copy.copy, lambda r: pickle.loads(pickle.dumps(r))])
@pytest.mark.parametrize("name", robot_names())
def test_a_copy_is_the_robot(name, how):
    robot = load_robot(name)
    robot = robot.with_effect(CoulombFriction(robot.transmission.joints[0], level=0.1))
    found = how(robot)
    q, v = robot.neutral(), np.ones(robot.model.nv)
    one, two = (pin.rnea(r.model, r.model.createData(), q, v, v).copy() for r in (robot, found))
    np.testing.assert_array_equal(one, two)
    assert found.joints == robot.joints
    assert found.contacts == robot.contacts or [c.name for c in found.contacts] == [
        c.name for c in robot.contacts
    ]
    assert found.effects[0].level == 0.1
    assert list(found.poses) == list(robot.poses)
    for array in (
        found.transmission.gear_ratio,
        found.actuated,
        *found.poses.values(),
        *(c.offset for c in found.contacts),
    ):
        assert not array.flags.writeable
    assert found.source == robot.source
