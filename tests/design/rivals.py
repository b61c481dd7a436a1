"""The leg whose causes are to be told apart, and rivals among them."""

import numpy as np

from wbc import Robot, load_robot
from wbc.design.experiment import MotionLimits, Rivals, parse_cause

LEG = load_robot("planar_leg_fixed").lossless()
LIMITS = MotionLimits.of(LEG, span=1.0, speed=6.0)


def rivals(*texts: str, robot: Robot = LEG, noise: float = 0.01, **more) -> Rivals:
    """Return causes as a command names them, at one noise of every motor [N m]."""
    causes = tuple(parse_cause(text, robot) for text in texts)
    return Rivals(robot, causes, np.full(robot.transmission.size, noise), **more)
