"""Bodies keep apart from obstacles and from each other; coal itself is the judge."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

from sims.legged import feet
from tests.control.scenes import moved_on, still
from wbc import control
from wbc.control.kinematics import Kinematics
from wbc.control.rows.collision import CollisionRows
from wbc.effects import load_robot
from wbc.errors import ControlError

TALOS = load_robot("talos")
HALF, HAND, OTHER = TALOS.pose(), "arm_left_7_link", "arm_right_7_link"


def solid(name, geometry, frame=None, at=(0.0, 0.0, 0.0)):
    """Return a shape in the world, or at a place in a frame."""
    held = {} if frame is None else {"frame": frame}
    place = pin.SE3(np.eye(3), np.array(at))
    return control.Shape(name=name, geometry=geometry, placement=place, **held)


POST = np.array([0.35, 0.3, 0.9])


def hands(**settings):
    shapes = [
        solid("left", coal.Capsule(0.06, 0.1), HAND),
        solid("right", coal.Box(0.1, 0.12, 0.2), OTHER),
        solid("post", coal.Sphere(0.1), at=POST),
    ]
    return control.CollisionLimit(shapes, [("left", "right"), ("left", "post")], **settings)


JUDGE = Kinematics(TALOS)


def apart(limit, q):
    rows = CollisionRows(limit, TALOS.model)
    JUDGE.update(q, np.zeros(TALOS.model.nv))
    rows.fill(JUDGE)
    return rows.distances.copy()


def test_rows_are_the_rates_of_coals_distances():
    limit = hands(influence=3.0, rate=2.0)
    generator = np.random.default_rng(0)
    v = generator.normal(size=TALOS.model.nv)
    rows, kinematics = CollisionRows(limit, TALOS.model), Kinematics(TALOS)
    kinematics.update(HALF, v)
    rows.fill(kinematics)
    h = 1e-5
    ahead, behind = (apart(limit, pin.integrate(TALOS.model, HALF, s * h * v)) for s in (1.0, -1.0))
    np.testing.assert_allclose(rows.rows @ v, (ahead - behind) / (2.0 * h), atol=1e-4)


@pytest.mark.parametrize("pair", ["obstacle", "hands"])
def test_a_hand_that_is_sent_into_something_stops_at_the_margin(pair):
    limit, target, least = hands(margin=0.03), POST, {}
    if pair == "hands":
        data = TALOS.model.createData()
        pin.framesForwardKinematics(TALOS.model, data, HALF)
        target = data.oMf[TALOS.model.getFrameId(OTHER)].translation.copy()
    tasks = [
        control.CenterOfMassTask(weight=10.0),
        control.FrameOrientationTask(name="trunk", frame="torso_2_link"),
        control.PostureTask.of(TALOS, weight=0.01),
        control.FramePositionTask(name="hand", frame=HAND, weight=5.0, stiffness=30.0),
    ]
    for kept in (True, False):
        limits = [control.RotorTorqueLimit(), *([limit] if kept else [])]
        controller = control.Controller(TALOS, tasks, feet(TALOS), limits)
        state, least[kept] = still(TALOS), np.inf
        for _ in range(500):
            command = controller.step(state, {"hand": control.Reference(target)}, dt=2e-3)
            assert command.status is control.Status.SOLVED, command.message
            state = moved_on(TALOS, state, command.acceleration, 2e-3)
            least[kept] = min(least[kept], apart(limit, state.position).min())
    assert least[False] < 0.0
    assert 0.027 < least[True] < 0.05


def mesh(corners):
    """Return a mesh of triangles between corners, as loaders of URDF files make it."""
    corners, found = np.asarray(corners, dtype=np.float64), coal.BVHModelOBBRSS()
    faces = ConvexHull(corners, qhull_options="QJ").simplices if len(corners) > 3 else [[0, 1, 1]]
    found.beginModel(len(faces), 3 * len(faces))
    for face in faces:
        found.addTriangle(*corners[face])
    found.endModel()
    return found


CUBE = np.array(list(product((-0.1, 0.1), repeat=3)))


def test_a_mesh_is_its_convex_hull():
    """Inside a mesh of triangles coal's distance is not negative and points the wrong way."""
    for along in (0.3, 0.12):  # outside, inside
        shapes = [
            solid("mesh", mesh(CUBE), HAND),
            solid("box", coal.Box(0.2, 0.2, 0.2), HAND),
            solid("ball", coal.Sphere(0.05), HAND, at=(along, 0.01, 0.02)),
        ]
        limit = control.CollisionLimit(shapes, [("mesh", "ball"), ("box", "ball")], influence=1.0)
        rows = CollisionRows(limit, TALOS.model)
        JUDGE.update(HALF, np.zeros(TALOS.model.nv))
        rows.fill(JUDGE)
        assert rows.distances == pytest.approx(along - 0.15, abs=1e-6)
        np.testing.assert_allclose(rows.rows[0], rows.rows[1], atol=1e-6)


def test_solids_far_apart_are_found_without_coal():
    """Balls around them tell; a half space, which no ball holds, is always measured."""
    ground = coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.2)
    table = solid("ground", ground)
    ball = solid("ball", coal.Sphere(0.05), HAND)
    long = solid("long", coal.Capsule(0.01, 4.0), OTHER)
    limit = control.CollisionLimit([table, ball, long], [("ground", "ball"), ("ball", "long")])
    near, far = (replace(limit, influence=reach) for reach in (5.0, 0.1))
    data = TALOS.model.createData()
    pin.framesForwardKinematics(TALOS.model, data, HALF)
    height = data.oMf[TALOS.model.getFrameId(HAND)].translation[2]
    exact, rough = apart(near, HALF), apart(far, HALF)
    assert exact[0] == pytest.approx(height - 0.25)
    assert rough[0] == pytest.approx(exact[0])
    assert (rough <= exact + 1e-9).all()


def test_what_is_no_convex_solid_is_named():
    with pytest.raises(ControlError, match=r"'flat'.*thin box"):
        solid("flat", mesh(CUBE[:4]))
    thin = solid("thin", mesh(CUBE * [1.0, 1.0, 1e-7]))
    assert thin.geometry.num_points == 8
    with pytest.raises(ControlError, match=r"'edge'.*four points"):
        solid("edge", mesh(CUBE[:2]))
    with pytest.raises(ControlError, match=r"'hand'.*str"):
        solid("hand", "hand.stl")


def test_a_frame_that_there_is_not_is_named():
    ball = solid("ball", coal.Sphere(0.1))
    lost = solid("lost", coal.Sphere(0.1), "hnd")
    with pytest.raises(ControlError, match="hnd"):
        CollisionRows(control.CollisionLimit([ball, lost], [("ball", "lost")]), TALOS.model)
