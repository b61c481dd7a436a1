"""The leg that most effects are tried on."""

import pytest

from wbc import Robot, load_robot


@pytest.fixture(scope="session")
def leg() -> Robot:
    return load_robot("planar_leg_fixed").lossless()
