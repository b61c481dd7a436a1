"""Which bodies meet edges of the ground, and each other, as arrays for compiled loops."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from wbc.errors import SimulationError, unknown_name
from wbc.mechanics.tree import Tree
from wbc.robot import BodySurface, Hull, ground_box, hull_of
from wbc.sim.ground import Terrain
from wbc.sim.height_field import HeightField
from wbc.sim.step.contacts import BALL, BOX
from wbc.sim.step.tables import Bodies

_ON_FIELDS = 16
"""Most places in which a body touches a height field beside its corners."""


def pairs_of(
    hulls: Sequence[Hull], surface: BodySurface, terrain: Terrain
) -> tuple[list[Hull], list[tuple[int, int, int]]]:
    """Return all hulls, those of the ground last, and which pairs of them may meet.

    Each hull meets every box, stair, ball and height field of the ground, and those of other bodies
    that are asked for. With height fields, which have no hull, goes their number among the solids,
    else -1.

    Raises:
        SimulationError: a pair with a body that has no hull.
    """
    numbers = [solid.numbers() for solid in terrain.solids]
    ground = [
        ground_box(own[1:4], own[4:13].reshape(3, 3), own[13:16], own[16:19])
        for own in numbers
        if own is not None and own[0] == BOX
    ]
    ground = [hull for hull in ground if len(hull.edges) + len(hull.corners)]
    ground += [
        hull_of("ground", "", 0, own[None, 1:4], float(own[4]))
        for own in numbers
        if own is not None and own[0] == BALL
    ]
    own, pairs = len(hulls), []
    for one, other in product(range(own), range(own, own + len(ground))):
        if len(hulls[one].corners) > 1:
            pairs.append((one, other, -1))
    for number, solid in enumerate(terrain.solids):
        if isinstance(solid, HeightField) and all(known is not None for known in numbers):
            pairs += [(one, own + len(ground), number) for one in range(own)]
            ground.append(hull_of("ground", "", 0, np.zeros((1, 3))))
    bodies = tuple(dict.fromkeys(hull.body for hull in hulls))
    for names in surface.pairs:
        for name in names:
            if name not in bodies:
                raise SimulationError(unknown_name("body with collision geometry", name, bodies))
        mine, theirs = ([i for i in range(own) if hulls[i].body == name] for name in names)
        # The second hull has fewer edges: each of its edges takes two barriers.
        pairs += [
            (*((a, b) if len(hulls[a].edges) >= len(hulls[b].edges) else (b, a)), -1)
            for a, b in product(mine, theirs)
        ]
    return [*hulls, *ground], pairs


def tables_of(
    hulls: Sequence[Hull],
    pairs: Sequence[tuple[int, int, int]],
    surface: BodySurface,
    tree: Tree,
    points: int,
) -> Bodies:
    """Return hulls and pairs as arrays; the corners of bodies are the last contact points."""
    last = {int(joint): row for row, (joint, _) in enumerate(tree.rows)}
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
    return Bodies(
        np.array(heads, dtype=np.int64).reshape(-1, 9),
        np.array(shapes).reshape(-1, 6),
        np.concatenate([np.empty((0, 3)), *(hull.corners for hull in hulls)]),
        np.concatenate([np.empty((0, 4)), *(hull.planes for hull in hulls)]),
        np.concatenate([np.empty((0, 12)), *(hull.edges for hull in hulls)]),
        np.array(ends, dtype=np.int64).reshape(-1, 2),
        np.array(table, dtype=np.int64).reshape(-1, 6),
        np.full((len(pairs), 1), surface.friction),
        np.array(slots, dtype=np.int64).reshape(-1, 1),
    )
