"""The controller in a MuJoCo loop: state over, torque back, contacts as MuJoCo sees them.

The order of the joints is the robot's own, so only the free base needs translation: MuJoCo's
quaternion starts with w and its linear velocity is in world axes (see `MujocoPlant.motion`).
"""

from __future__ import annotations

import numpy as np

from sims.legged import CenterOfMass, com_reference, controller, squat
from wbc import load_robot

TICK = 1e-3  # [s]


def main(duration: float = 1.0) -> dict[str, float]:
    """Squat for `duration` seconds; return what happened."""
    from sims.mujoco_plant import MujocoPlant  # MuJoCo is not a dependency of the library

    robot = load_robot("solo12")
    control = controller(robot, robot)
    plant = MujocoPlant(robot, np.array(robot.poses["standing"]))
    com, play = CenterOfMass(robot), squat(depth=0.03, rate=1.0)
    start, worst, refused, lifted = com(plant.motion), 0.0, 0, 0
    for tick in range(round(duration / TICK)):
        height, push = play(tick * TICK)
        motion = plant.motion
        standing = plant.touching()
        lifted += len(standing) < len(robot.contacts)
        target, wanted = com_reference(start, height)
        command = control.step(motion, {"center_of_mass": wanted}, dict.fromkeys(standing, np.inf))
        refused += not command.status.usable
        worst = max(worst, float(np.linalg.norm(com(motion) - target)))
        plant.advance(command.rotor_torque, push, TICK)
    return {
        "largest error of the centre of mass [mm]": 1e3 * worst,
        "refused ticks": refused,
        "ticks with a foot in the air": lifted,
    }


if __name__ == "__main__":
    for name, figure in main().items():
        print(f"{name}: {figure:.3g}")
