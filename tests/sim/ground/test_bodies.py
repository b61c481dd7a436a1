"""Bodies on the ground: they lie on it, lose energy and come to rest, as they do in MuJoCo."""

from dataclasses import replace
from pathlib import Path

import coal
import mujoco
import numpy as np
import pinocchio as pin
import pytest

from tests.sim.bodies import free, hull_of, placed, solid, watched
from wbc import load_robot
from wbc.effects import PayloadMass, save_robot
from wbc.errors import RobotError
from wbc.robot import FreeBody, body_surfaces
from wbc.sim import Plane, Plant, SimState, Stairs, simulate

_MASS = 2.0  # [kg]
SHAPES = {
    "sphere": (coal.Sphere(0.1), 'type="sphere" size="0.1"'),
    "box": (coal.Box(0.4, 0.3, 0.2), 'type="box" size="0.2 0.15 0.1"'),
    "capsule": (coal.Capsule(0.05, 0.3), 'type="capsule" size="0.05 0.15"'),
    "cylinder": (coal.Cylinder(0.05, 0.4), 'type="cylinder" size="0.05 0.2"'),
    "disc": (coal.Cylinder(0.15, 0.06), 'type="cylinder" size="0.15 0.03"'),
}
ATTITUDES = {"flat": [0.0, 0.0, 0.0], "on a corner": [0.6, 0.7, 0.3]}
STEP = 2e-3  # [s]


def thrown(plant: Plant, attitude: list[float]) -> tuple[np.ndarray, SimState]:
    """Let a body fall from 0.1 m above the ground; return where it starts, and where it rests."""
    q = placed(([0.0, 0.0, 0.0], attitude))
    q[2] += 0.1 - plant.gaps(plant.state(q)).min()
    end, deepest = watched(plant, plant.state(q), 4.0, said=())
    assert deepest > -1e-5
    return q, end


def height_in_mujoco(geom: str, start: np.ndarray) -> float:
    """Return how high the centre of the same body lies in MuJoCo once it rests [m]."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.001"/><worldbody><geom type="plane" size="5 5 1"
        friction="0.7"/><body><freejoint/><geom {geom} mass="{_MASS}" friction="0.7"/></body>
        </worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    data.qpos[:] = start[[0, 1, 2, 6, 3, 4, 5]]
    mujoco.mj_step(model, data, 6000)
    return float(data.qpos[2])


@pytest.mark.parametrize("attitude", ATTITUDES.values(), ids=ATTITUDES)
@pytest.mark.parametrize("name", SHAPES)
def test_a_thrown_body_comes_to_rest_as_high_as_in_mujoco(name: str, attitude: list) -> None:
    shape, geom = SHAPES[name]
    start, end = thrown(solid(shape, Plane(), _MASS), attitude)
    # MuJoCo's ground is soft: it sinks by up to 0.2 mm under 2 kg.
    assert 0.0 <= end.position[2] - height_in_mujoco(geom, start) < 3e-4
    if name in ("box", "disc"):  # round ones roll on
        assert np.abs(end.velocity).max() < 1e-9


def test_a_box_slides_down_a_slope_and_lies_on_a_stair() -> None:
    for terrain in (Plane.slope(0.3), Stairs(edges=np.array([0.6]), heights=np.array([0.0, 0.1]))):
        _, end = thrown(solid(SHAPES["box"][0], terrain), ATTITUDES["on a corner"])
        assert np.abs(end.velocity).max() < 1e-9  # friction 0.7 holds it


def test_a_quadruped_that_is_switched_off_lies_on_its_trunk() -> None:
    """On its feet alone its trunk sank to 0.1 m under the ground, without a word."""
    robot = load_robot("solo12")
    feet = Plant(robot, bodies="feet")
    sunk = simulate(feet, lambda s: np.zeros(12), feet.state(robot.pose(), lifted=True), 1.0)
    assert sunk.state.position[2] < -0.05
    assert {event.kind for event in sunk.events} == {"sunk"}
    plant = Plant(robot)
    end, _ = watched(plant, plant.state(robot.pose(), lifted=True), 1.2, gain=1e-10)
    assert 0.01 < end.position[2] < 0.06
    # Meshes sink between their points by the depth that the robot's description allows.
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, end.position)
    lowest = min(placement.translation[2] for placement in list(data.oMi)[1:])
    assert lowest > -robot.surface.depth


def test_the_points_of_a_mesh_hold_all_of_it_but_the_depth_that_is_asked_for() -> None:
    random = np.random.default_rng(0)
    cloud = random.normal(size=(400, 3)) * [0.2, 0.1, 0.05]
    robot = free(FreeBody("body", hull_of(cloud), 1.0))
    ways = random.normal(size=(2000, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    counts = []
    for depth in (0.1, 0.03, 0.01):
        found, _ = body_surfaces(replace(robot, surface=replace(robot.surface, depth=depth)))
        points = np.array([contact.offset for contact in found])
        out = (cloud @ ways.T).max(axis=0) - (points @ ways.T).max(axis=0)
        assert out.max() < depth + 5e-3  # seen from 400 ways, it is known to 5 mm
        counts.append(len(points))
    assert counts[0] < counts[1] < counts[2] < 60


def test_a_description_says_which_links_touch(tmp_path: Path) -> None:
    (tmp_path / "ball.urdf").write_text(
        """<robot name="ball"><link name="base"><inertial><mass value="1"/><inertia ixx="1" ixy="0"
        ixz="0" iyy="1" iyz="0" izz="1"/></inertial><collision><geometry><sphere radius="0.2"/>
        </geometry></collision></link><link name="arm"><inertial><mass value="1"/><inertia ixx="1"
        ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial><collision><geometry><box
        size="0.1 0.1 0.4"/></geometry></collision></link><joint name="turn" type="revolute">
        <parent link="base"/><child link="arm"/><limit lower="-1" upper="1" effort="1"
        velocity="1"/></joint></robot>"""
    )
    path, head = tmp_path / "robot.toml", 'model = "ball.urdf"\nbase = "free_flyer"\n[bodies]\n'
    for text, count in (
        ("", 9),
        ('links = ["arm"]\nfriction = 0.3\n', 8),
        ('depth = { value = 5.0, unit = "mm" }\n', 9),
    ):
        path.write_text(head + text)
        robot = load_robot(path)
        plant = Plant(robot)
        assert len(plant.contacts) == count
        assert len(replace(plant, restitution=0.5).contacts) == count
        assert plant.contacts[-1].friction == (0.3 if "friction" in text else 0.7)
        assert len(Plant(robot, bodies="feet").contacts) == 0
    for text, message in (
        ('links = ["leg"]', r"body of .* 'leg'"),
        ('pairs = ["arm"]', "lists of two bodies"),
        ('links = "arm"', "names of bodies expected"),
    ):
        path.write_text(head + text)
        with pytest.raises(RobotError, match=message):
            Plant(load_robot(path))


def test_a_robot_that_is_changed_in_code_or_saved_keeps_its_bodies(tmp_path: Path) -> None:
    robot = load_robot("solo12")
    first = save_robot(robot, tmp_path / "first.toml")
    copies = (
        robot.with_gravity([0.0, 0.0, -1.62]),
        robot.with_inertia(2, robot.model.inertias[2] + robot.model.inertias[3]),
        robot.with_transmission(robot.transmission.lossless()),
        robot.with_effect(PayloadMass(robot.bodies[0], 1.0)).lossless(),
        load_robot(first),
        load_robot(save_robot(load_robot(first), tmp_path / "second.toml")),
    )
    all_points = len(Plant(robot).contacts)
    assert all_points > len(robot.contacts)
    assert {len(Plant(changed).contacts) for changed in copies} == {all_points}
    for changed in copies[:4]:
        with pytest.raises(RobotError, match="changed in code"):
            save_robot(changed, tmp_path / "third.toml")


@pytest.mark.parametrize(("name", "at_most"), [("solo12", 2.0), ("talos", 9.0), ("anymal", 18.0)])
def test_a_robot_that_is_switched_off_comes_to_rest(name: str, at_most: float) -> None:
    """TALOS jittered at 0.2 rad/s: most of its steps ended without friction that meets its law."""
    robot = load_robot(name)
    plant, pose = Plant(robot), robot.pose()
    pose[2] += 1.0 - plant.gaps(plant.state(pose)).min()
    pose[2] -= plant.gaps(plant.state(pose)).min()
    state, quiet = plant.state(pose), 0
    made, start = 0.0, plant.mechanical_energy(state)
    while state.time < at_most and quiet < 50:
        result = plant.step(state, np.zeros(robot.transmission.size), STEP)
        state = result.state
        quiet = quiet + 1 if np.abs(state.velocity).max() < 1e-3 else 0
        assert plant.gaps(state).min() > -2e-6
        made += sum(event.size for event in result.events if event.kind == "energy")
    assert quiet == 50
    assert made < 1e-9 * (start - plant.mechanical_energy(state))


def test_a_robot_kneels_on_its_shanks() -> None:
    robot = load_robot("solo12")
    plant, legs, pose = Plant(robot), ("FL", "FR", "HL", "HR"), robot.pose()
    places, rows = robot.actuated_position, robot.actuated
    for leg in legs:
        pose[robot.position_index(f"{leg}_HFE")] = 0.8
        pose[robot.position_index(f"{leg}_KFE")] = -0.8 - np.pi / 2
    state = plant.state(pose, lifted=True)
    for _ in range(1000):
        held = 8.0 * (pose - state.position)[places] - 0.3 * state.velocity[rows]
        result = plant.step(state, held / robot.transmission.gear_ratio, 1e-3)
        state = result.state
        assert not [event for event in result.events if event.kind == "energy"]
    up = result.contact_force[:, 2]
    pressed = {
        contact.frame for contact, push in zip(plant.contacts, up, strict=True) if push > 0.1
    }
    weight = 9.81 * sum(body.mass for body in robot.model.inertias)
    assert np.abs(state.velocity).max() < 1e-6
    assert {f"{leg}_UPPER_LEG" for leg in legs} <= pressed
    np.testing.assert_allclose(up.sum(), weight, rtol=1e-6)
