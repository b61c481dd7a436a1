"""What can be reached but not passed: joint limits and the ground under the contact points."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.errors import SimulationError, require_known
from wbc.mechanics.kinematics import Tree
from wbc.robot import BodySurface, Robot
from wbc.robot.body_contacts import Hull, ground_box, hull_of
from wbc.robot.model_file import driven_joints
from wbc.sim.ground import BALL, BOX, HeightField, Terrain
from wbc.sim.step.tables import BODIES, Bodies

# Most places in which a body touches a height field beside its corners.
_ON_FIELDS = 16


class Barriers:
    """The joint limits and contact points of a robot on a terrain: constant numbers and names.

    Attributes:
        limits: 2 j, lower limits, then upper ones, of j joints.
        points: k contact points.
        pairs: names of p pairs of hulls.
        bodies: the pairs as arrays.
        obstacles: limits, contact points and what they meet, arrays by their names in `Obstacles`.
        asks: whether Python alone knows how far some of the ground is.
        names: of the barriers (2 j + c,): limits, all points for the first of s solids, and so on,
            then those of the pairs.
        size: 2 j + c.
    """

    def __init__(self, robot: Robot, terrain: Terrain, tree: Tree, hulls: tuple[Hull, ...]) -> None:
        """Collect the finite limits and prepare the contacts.

        Args:
            robot: with all points that touch the ground.
            terrain: what they touch.
            tree: of the robot.
            hulls: of its links that meet edges of the ground, and each other.
        """
        model = robot.model
        low, high = _finite(model.lowerPositionLimit), _finite(model.upperPositionLimit)
        finite = np.isfinite(low) | np.isfinite(high)
        single = [n for n in driven_joints(model) if finite[robot.position_index(n)]]
        at = [(robot.position_index(name), robot.velocity_index(name)) for name in single]
        limit_at = np.array(at, dtype=np.int64).reshape(-1, 2)
        limit_range = np.column_stack((low[limit_at[:, 0]], high[limit_at[:, 0]]))
        known = [numbers for solid in terrain.solids if (numbers := solid.numbers()) is not None]
        both, pairs = _pairs_of(hulls, robot.surface, terrain, known)
        last = {int(joint): row for row, (joint, _) in enumerate(tree.rows)}
        self.bodies = _tables_of(both, pairs, last, len(robot.contacts))
        solids = np.zeros((len(known), max(map(len, known), default=0)))
        for row, numbers in zip(solids, known, strict=True):
            row[: len(numbers)] = numbers
        self.pairs = tuple((both[a].name, both[b].name) for a, b, *_ in pairs)
        self.limits, self.points = 2 * len(single), len(robot.contacts)
        self.names = (
            *(f"joint '{name}' at its lower limit" for name in single),
            *(f"joint '{name}' at its upper limit" for name in single),
            *(f"contact '{c.name}'" for c in robot.contacts * len(terrain.solids)),
            *(f"'{a}' on '{b}'" for a, b in (self.pairs[i] for i in self.bodies.slots[:, 0])),
        )
        self.size = len(self.names)
        self.asks = len(known) < len(terrain.solids)
        self.obstacles = _points_of(robot, self.bodies, last, len(terrain.solids))
        self.obstacles |= {"limit_at": limit_at, "limit_range": limit_range, "solids": solids}


def _finite(limits: FloatArray) -> FloatArray:
    """Return limits with pinocchio's way of saying "none" (the largest double) as infinity."""
    values = np.array(limits)
    return np.where(np.abs(values) > 1e18, np.copysign(np.inf, values), values)


def _pairs_of(
    hulls: Sequence[Hull], surface: BodySurface, terrain: Terrain, known: Sequence[FloatArray]
) -> tuple[list[Hull], list[tuple[int, int, int]]]:
    """Return all hulls, those of the ground last, and which pairs of them may meet.

    Each hull meets every box, stair, ball and height field of the ground, and those of other bodies
    that are asked for. With height fields, which have no hull, goes their number among the solids,
    else -1. `known` are the numbers of the solids that have some.

    Raises:
        SimulationError: a pair with a body that has no hull.
    """
    boxes = (
        ground_box(own[1:4], own[4:13].reshape(3, 3), own[13:16], own[16:19])
        for own in known
        if own[0] == BOX
    )
    ground = [hull for hull in boxes if len(hull.edges) + len(hull.corners)]
    balls = (own for own in known if own[0] == BALL)
    ground += [hull_of("ground", "", 0, own[None, 1:4], float(own[4])) for own in balls]
    own, pairs = len(hulls), []
    for one, other in product(range(own), range(own, own + len(ground))):
        if len(hulls[one].corners) > 1:
            pairs.append((one, other, -1))
    for number, solid in enumerate(terrain.solids):
        if isinstance(solid, HeightField) and len(known) == len(terrain.solids):
            pairs += [(one, own + len(ground), number) for one in range(own)]
            ground.append(hull_of("ground", "", 0, np.zeros((1, 3))))
    bodies = tuple(dict.fromkeys(hull.body for hull in hulls))
    for names in surface.pairs:
        for name in names:
            require_known(SimulationError, "body with collision geometry", name, bodies)
        mine, theirs = ([i for i in range(own) if hulls[i].body == name] for name in names)
        # The second hull has fewer edges: each of its edges takes two barriers.
        pairs += [
            (*((a, b) if len(hulls[a].edges) >= len(hulls[b].edges) else (b, a)), -1)
            for a, b in product(mine, theirs)
        ]
    return [*hulls, *ground], pairs


def _points_of(
    robot: Robot, bodies: Bodies, last: dict[int, int], solids: int
) -> dict[str, FloatArray | IntArray]:
    """Return contact points, and what stands on both sides of barriers, as of `Obstacles`."""
    contacts, placed = robot.contacts, [robot.contact_place(one) for one in robot.contacts]
    joints = np.array([joint - 1 for joint, _ in placed], dtype=np.int64)
    balls = [(*at, one.radius) for (_, at), one in zip(placed, contacts, strict=True)]
    slots = bodies.slots[:, 0]
    ground = [(last.get(joint, -1), -1, i) for i, joint in enumerate(joints.tolist())] * solids
    met = np.column_stack((bodies.hulls[bodies.pairs[slots, :2], 1], len(joints) + slots))
    sides = np.concatenate((np.reshape(ground, (-1, 3)), met)).astype(np.int64)
    rubbing = [contact.friction for contact in contacts] * solids
    frictions = np.array([*rubbing, *[robot.surface.friction] * len(slots)], dtype=np.float64)
    points = {"contact_at": joints, "contacts": np.reshape(balls, (-1, 4))}
    return points | {"sides": sides, "frictions": frictions}


def _tables_of(
    hulls: Sequence[Hull], pairs: Sequence[tuple[int, int, int]], last: dict[int, int], points: int
) -> Bodies:
    """Return hulls and pairs as arrays; the corners of bodies are the last contact points.

    `last` is the last row of v of each joint that moves.
    """
    heads, shapes, ends, begin = [], [], [], [0, 0, 0]
    point = points - sum(len(hull.corners) for hull in hulls if hull.body)
    for hull in hulls:
        sizes = len(hull.corners), len(hull.planes), len(hull.edges)
        places = [number for two in zip(begin, sizes, strict=True) for number in two]
        heads.append([hull.joint - 1, last.get(hull.joint - 1, -1), *places, point])
        point += len(hull.corners)
        begin = [start + size for start, size in zip(begin, sizes, strict=True)]
        for edge in hull.edges[:, :6].reshape(-1, 2, 3):  # -1 where ground has no such corner
            same = [(hull.corners == end).all(axis=1) for end in edge]
            ends.append([int(own.argmax()) if own.any() else -1 for own in same])
        spots = np.concatenate((hull.corners, hull.edges[:, :6].reshape(-1, 3)))
        center = 0.5 * (spots.min(axis=0) + spots.max(axis=0))
        around = np.linalg.norm(spots - center, axis=1).max() + hull.radius
        thin = hull.thickness if hull.thickness > 0.0 else np.inf
        shapes.append([*center, around, hull.radius, thin])
    table: list[list[int]] = []
    slots: list[int] = []
    for number, (a, b, field) in enumerate(pairs):
        whole = hulls[b].body != ""
        count = len(hulls[a].corners) * whole + len(hulls[b].corners) + 2 * len(hulls[b].edges)
        count = _ON_FIELDS if field >= 0 else count
        table.append([a, b, len(slots), int(whole), len(slots) + count, field])
        slots += [number] * count
    return BODIES.of(
        hulls=np.array(heads, dtype=np.int64).reshape(-1, 9),
        shapes=np.array(shapes).reshape(-1, 6),
        corners=np.concatenate([np.empty((0, 3)), *(hull.corners for hull in hulls)]),
        planes=np.concatenate([np.empty((0, 4)), *(hull.planes for hull in hulls)]),
        edges=np.concatenate([np.empty((0, 12)), *(hull.edges for hull in hulls)]),
        ends=np.array(ends, dtype=np.int64).reshape(-1, 2),
        pairs=np.array(table, dtype=np.int64).reshape(-1, 6),
        slots=np.array(slots, dtype=np.int64).reshape(-1, 1),
    )
