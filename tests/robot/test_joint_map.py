"""Joint orders of MuJoCo, of a URDF and of a ROS message: the same state, the same torques."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from wbc.effects import load_robot
from wbc.errors import RobotError
from wbc.robot import BaseState, JointMap, Robot
from wbc.transmission import Transmission

SOLO = load_robot("solo12")


@pytest.mark.parametrize("name", ["solo12", "parallelogram_leg"])
def test_torques_go_back_by_name_and_duality(name):
    """Power at the joints is power at the motors, whatever couples them."""
    robot = load_robot(name)
    gears = robot.transmission
    others = [joint for joint in robot.single_joints if joint not in gears.joints]
    rotor = np.random.default_rng(0).normal(size=gears.size)
    torque = JointMap.of(robot, [*others, "gripper", *gears.joints[::-1]]).torques(rotor)
    np.testing.assert_array_equal(torque[: -gears.size], 0.0)
    # A column each for one joint that turns at 1 rad/s.
    motors = gears.gear_ratio * rotor @ gears.motor_from_joint
    np.testing.assert_allclose(torque[: -gears.size - 1 : -1], motors)


def test_mistakes_are_named():
    # It is known to the robot: "unknown joint of solo12" would send the reader astray.
    with pytest.raises(RobotError, match=r"'FL_HAA' .*missing among the names"):
        JointMap.of(SOLO, [n for n in SOLO.transmission.joints if n != "FL_HAA"])
    with pytest.raises(RobotError, match="2 times"):
        JointMap.of(SOLO, [*SOLO.transmission.joints, "FL_HAA"])
    with pytest.raises(RobotError, match="no length"):
        BaseState.of([0, 0, 0], [0, 0, 0, 0], [0, 0, 0], [0, 0, 0])
    leg = load_robot("planar_leg_fixed")
    base = BaseState.of([0, 0, 0], [0, 0, 0, 1], [0, 0, 0], [0, 0, 0])
    with pytest.raises(RobotError, match="free base"):
        JointMap.of(leg, leg.single_joints).motion([0, 0], [0, 0], base)


MJCF = """
<mujoco><worldbody>
  <body name="trunk"><freejoint name="root"/>
    <geom type="box" size=".2 .1 .05" mass="3"/>
    <body name="b" pos=".2 0 0"><joint name="{0}" axis="0 1 0"/>
      <geom type="capsule" size=".02" fromto="0 0 0 0 0 -.3" mass="1"/>
      <body name="c" pos="0 0 -.3"><joint name="{1}" axis="1 0 0"/>
        <geom type="capsule" size=".02" fromto="0 0 0 .1 0 -.2" mass=".5"/></body></body>
  </body>
</worldbody></mujoco>
"""


def test_mujoco_and_pinocchio_move_alike(tmp_path):
    """Place and velocity of the last body from the mapped state are MuJoCo's own."""
    path = tmp_path / "robot.xml"
    path.write_text(MJCF.format("hip", "knee"))
    theirs = mujoco.MjModel.from_xml_path(str(path))
    model = pin.buildModelFromMJCF(str(path))
    model.armature = np.zeros(model.nv)
    gears = Transmission(joints=("knee", "hip"), gear_ratio=[2.0, 3.0], rotor_inertia=[0.0, 0.0])
    robot = Robot("two", model, gears)
    names = [theirs.joint(i).name for i in range(1, theirs.njnt)]
    joints = JointMap.of(robot, names)
    data, generator = mujoco.MjData(theirs), np.random.default_rng(0)
    data.qpos[:] = generator.normal(size=9)
    data.qpos[3:7] /= np.linalg.norm(data.qpos[3:7])
    data.qvel[:] = generator.normal(size=8)
    mujoco.mj_forward(theirs, data)
    turn = data.qpos[[4, 5, 6, 3]]
    trunk = BaseState.of(data.qpos[:3], turn, data.qvel[:3], data.qvel[3:6])
    motion = joints.motion(data.qpos[7:], data.qvel[6:], trunk)
    own, frame, moving = model.createData(), model.getFrameId("c"), np.zeros(6)
    pin.forwardKinematics(model, own, motion.position, motion.velocity)
    place = pin.updateFramePlacement(model, own, frame)
    np.testing.assert_allclose(place.translation, data.body("c").xpos, atol=1e-9)
    speed = pin.getFrameVelocity(model, own, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    body = mujoco.mjtObj.mjOBJ_XBODY
    mujoco.mj_objectVelocity(theirs, data, body, theirs.body("c").id, moving, 0)
    np.testing.assert_allclose(speed.vector, np.r_[moving[3:], moving[:3]], atol=1e-9)
    torque = joints.torques([1.0, 10.0])
    assert torque[names.index("knee")] == pytest.approx(2.0)
    assert torque[names.index("hip")] == pytest.approx(30.0)
