"""One of many designs as a robot of its own."""

from dataclasses import replace

import numpy as np

from wbc import Robot
from wbc.metrics import Designs


def robot_at(designs: Designs, index: int) -> tuple[Robot, np.ndarray]:
    """Return one design as a robot, and its pose q (nq,)."""

    def pick(values: np.ndarray) -> np.ndarray:
        return values[0 if len(values) == 1 else index]

    gears = {name: pick(values) for name, values in designs.gears.items()}
    one = replace(designs.robot, source=None)
    return one.with_transmission(one.transmission.replace(**gears)), pick(designs.position)
