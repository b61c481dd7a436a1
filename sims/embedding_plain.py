"""The controller in a loop of your own: read the state, take a step, look at the status, send.

The plant stands where the drives of a robot would be.
"""

from __future__ import annotations

import numpy as np

from sims.legged import CenterOfMass, com_reference, controller, squat
from wbc import load_robot
from wbc.sim import Plant

TICK = 1e-3  # [s]


def main(duration: float = 1.0) -> dict[str, float]:
    """Squat for `duration` seconds; return what happened."""
    robot = load_robot("solo12")
    control = controller(robot, robot)
    plant = Plant(robot)
    state = plant.state(np.array(robot.poses["standing"]))
    com, play = CenterOfMass(robot), squat(depth=0.03, rate=1.0)
    start, worst, refused = com(state), 0.0, 0
    for tick in range(round(duration / TICK)):
        height, _ = play(tick * TICK)
        target, wanted = com_reference(start, height)
        command = control.step(state, {"center_of_mass": wanted})
        if not command.status.usable:
            refused += 1  # the torque is the safety policy's: send it all the same
            print(f"{tick * TICK:.3f} s: {command.status.value}: {command.message}")
        worst = max(worst, float(np.linalg.norm(com(state) - target)))
        state = plant.step(state, command.rotor_torque, TICK).state
    return {"largest error of the centre of mass [mm]": 1e3 * worst, "refused ticks": refused}


if __name__ == "__main__":
    for name, figure in main().items():
        print(f"{name}: {figure:.3g}")
