"""Bodies keep apart from obstacles and from each other; coal itself is the judge."""

from dataclasses import replace
from itertools import product

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

from sims.legged import feet
from tests.control.scenes import moved_on, place_of, still, trunk
from wbc import control, load_robot
from wbc.control.kinematics import Kinematics
from wbc.control.rows.collision import CollisionRows
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


def filled(limit, q):
    rows = CollisionRows(limit, TALOS.model)
    JUDGE.update(q, np.zeros(TALOS.model.nv))
    rows.fill(JUDGE)
    return rows


def apart(limit, q):
    return filled(limit, q).distances.copy()


def test_rows_are_the_rates_of_coals_distances():
    limit, h = hands(influence=3.0, rate=2.0), 1e-5
    v = np.random.default_rng(0).normal(size=TALOS.model.nv)
    ahead, behind = (apart(limit, pin.integrate(TALOS.model, HALF, s * v)) for s in (h, -h))
    rates = filled(limit, HALF).rows @ v
    np.testing.assert_allclose(rates, (ahead - behind) / (2.0 * h), atol=1e-4)


@pytest.mark.parametrize("pair", ["obstacle", "hands"])
def test_a_hand_that_is_sent_into_something_stops_at_the_margin(pair):
    limit, least = hands(margin=0.03), {}
    target = place_of(TALOS, HALF, OTHER) if pair == "hands" else POST
    tasks = [
        control.CenterOfMassTask(weight=10.0),
        trunk(TALOS),
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
    cubes = solid("mesh", mesh(CUBE), HAND), solid("box", coal.Box(0.2, 0.2, 0.2), HAND)
    pairs = [("mesh", "ball"), ("box", "ball")]
    for along in (0.3, 0.12):  # outside, inside
        ball = solid("ball", coal.Sphere(0.05), HAND, at=(along, 0.01, 0.02))
        rows = filled(control.CollisionLimit([*cubes, ball], pairs, influence=1.0), HALF)
        assert rows.distances == pytest.approx(along - 0.15, abs=1e-6)
        np.testing.assert_allclose(rows.rows[0], rows.rows[1], atol=1e-6)


def test_solids_far_apart_are_found_without_coal():
    """Balls around them tell; a half space, which no ball holds, is always measured."""
    table = solid("ground", coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.2))
    ball = solid("ball", coal.Sphere(0.05), HAND)
    long = solid("long", coal.Capsule(0.01, 4.0), OTHER)
    limit = control.CollisionLimit([table, ball, long], [("ground", "ball"), ("ball", "long")])
    near, far = (replace(limit, influence=reach) for reach in (5.0, 0.1))
    exact, rough = apart(near, HALF), apart(far, HALF)
    assert exact[0] == pytest.approx(place_of(TALOS, HALF, HAND)[2] - 0.25)
    assert rough[0] == pytest.approx(exact[0])
    assert (rough <= exact + 1e-9).all()


def test_what_is_no_convex_solid_on_a_frame_is_named():
    with pytest.raises(ControlError, match=r"'flat'.*thin box"):
        solid("flat", mesh(CUBE[:4]))
    thin = solid("thin", mesh(CUBE * [1.0, 1.0, 1e-7]))
    assert thin.geometry.num_points == 8
    with pytest.raises(ControlError, match=r"'edge'.*four points"):
        solid("edge", mesh(CUBE[:2]))
    with pytest.raises(ControlError, match=r"'hand'.*str"):
        solid("hand", "hand.stl")
    ball, lost = solid("ball", coal.Sphere(0.1)), solid("lost", coal.Sphere(0.1), "hnd")
    with pytest.raises(ControlError, match="hnd"):
        filled(control.CollisionLimit([ball, lost], [("ball", "lost")]), HALF)
