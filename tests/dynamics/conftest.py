from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

from wbc.arrays import FloatArray
from wbc.robot import Robot

State = tuple[FloatArray, FloatArray]


@pytest.fixture
def random_state() -> Callable[[Robot, int], State]:
    def draw(robot: Robot, seed: int) -> State:
        rng = np.random.default_rng(seed)
        q = pin.integrate(robot.model, robot.neutral(), rng.normal(size=robot.model.nv))
        return q, rng.normal(size=robot.model.nv)

    return draw
