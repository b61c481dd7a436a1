"""What the compiled loops know of a plant: arrays with names in one structure."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np

from wbc.arrays import BoolArray, FloatArray, frozen
from wbc.compiled import Dense, Flags, OutDense, OutFlags, OutRow, Places, Row, Table
from wbc.mechanics.kinematics import Tree
from wbc.mechanics.memory import Heap
from wbc.sim.energy import EnergyFlow
from wbc.structures import Structure, numbered, structured

EffectMemory: TypeAlias = tuple[FloatArray | None, ...]
"""Own states of a robot's effects, one per kind that is no row of a table; None without one."""


_NONE = frozen([])


class SimState(NamedTuple):
    """State of a simulated robot; a step turns one into the next and keeps nothing besides.

    Attributes:
        position: q (nq,), pinocchio's configuration.
        velocity: v (nv,).
        time: [s].
        closed: (2 j + k,) which joint limits (lower, then upper) and contacts are closed since the
            last step; empty means unknown, the next step then looks.
        impulse: (r,) row impulses of the last step [N m s, N s], where the next one starts its
            search and which split of internal forces it stays near; empty means none.
        deflection: (m,) [rad] of the motor's output ahead of the joint, where a gear is compliant
            or has backlash; empty means none.
        motor_velocity: (m,) [rad/s] of the motor's output; empty means that of the joints.
        memory: own states of the robot's effects (a motor's warmth, torque on its way); empty
            means as at the start, or that no effect has any.
    """

    position: FloatArray
    velocity: FloatArray
    time: float = 0.0
    closed: BoolArray = frozen([], np.bool_)
    impulse: FloatArray = _NONE
    deflection: FloatArray = _NONE
    motor_velocity: FloatArray = _NONE
    memory: EffectMemory = ()

    def replace(self, **changes: Any) -> SimState:
        """Return a copy with some fields changed; lists are as good as arrays."""
        lists = {name: np.asarray(own) for name, own in changes.items() if isinstance(own, list)}
        return self._replace(**(changes | lists))


TOUCH = 1e-6
"""Gap [m, rad] up to which a barrier counts as closed."""


# Joint limits, contact points, and the solids that these may meet. The c contact barriers are all
# points times all solids, then those of pairs of hulls (`Bodies`).
#
#     limit_at     (j, 2) entry of q and row of v
#     limit_range  (j, 2) least and greatest value
#     contact_at   (k,) joint, -1 for the world
#     contacts     (k, 4) place on the joint (3), radius
#     sides        (c, 3) last row of v that moves either side of each contact barrier, -1 for
#                  ground at rest (the normal points to the first side); and which point, or pair
#                  behind all points, is pushed
#     frictions    (c,)
#     solids       (s, w) see `solid_gap`; empty where Python knows the ground alone
#     points       (k, 3) memory: places of the contact points, world
#     touch        (c, 7) memory: gap, normal out of the solid (3), and where the point touches (3)
#     limits       2 j, how many barriers are joint limits
#     rigid        how many are rigid: all, or the limits where contacts are compliant
#     asked        address of a function of Python that fills `touch`, else zero
OBSTACLES = Structure(
    "Obstacles",
    (Table, "limit_at sides"),
    (Dense, "limit_range contacts solids"),
    (Places, "contact_at"),
    (Row, "frictions"),
    (OutDense, "points", "k", 3),
    (OutDense, "touch", "c", 7),
    (int, "limits rigid asked"),
)
Obstacles = Annotated[Any, OBSTACLES.kind]

# The gears.
#
#     ratio, inertia     N, N^2 I_r (m,)
#     viscous, coulomb   N^2 and |N| times the friction of the rotors (m,)
#     inverse, backward  1/eta_f, eta_b (m,), as they are in impacts
#     stiffness          (m,) of the flanks [N m/rad]
#     damping            (m,) of the flanks [N m s/rad]
#     play               (m,) between the flanks [rad]
#     rows               (m, nv) speed of the joints per v, as the motor outputs turn where gears
#                        are rigid
#     row                (m,) of v whose dry friction shares the gear's row, as the gear turns this
#                        joint alone and rigidly; -1 where there is none
#     alone              (nv,) whether dry friction of a row of v is in no gear's row
#     yields             (m,) whether the motor output may leave its joint: the gear is loose
#     coupling           (m, nv) memory: N C, see `RotorCoupling`; empty where rotors feel their
#                        spin alone
#     gyration           (1, nv + m) memory: torques on links and on rotors that come with it
#     loose              whether any gear is
GEARS = Structure(
    "Gears",
    (Row, "ratio inertia viscous coulomb inverse backward stiffness damping play"),
    (Dense, "rows"),
    (Places, "row"),
    (Flags, "alone yields"),
    (OutDense, "coupling", "coupled", "v"),
    (OutDense, "gyration", 1, "both"),
    (bool, "loose"),
)
Gears = Annotated[Any, GEARS.kind]

# Convex hulls that meet edges of the ground, and each other, see `Hull` and `pairs`.
#
#     hulls    (h, 9) joint (-1 for the world), its last row of v (-1), where the corners, planes
#              and edges begin and how many there are, and, of a body, the number of the contact
#              point at its first corner
#     shapes   (h, 6) centre (3) and radius of a ball around it, radius of balls at the corners,
#              least width; on the joint
#     corners  (n, 3)
#     planes   (f, 4)
#     edges    (e, 12)
#     ends     (e, 2) numbers of the hull's corners at both ends, -1 where ground has none
#     pairs    (p, 6) two hulls, first barrier, whether the corners of the first hull take part
#              (those on the ground are contact points), last barrier + 1, and for height fields,
#              which have no hull, the number of the solid, else -1
#     slots    (s, 1) pair of each barrier
BODIES = Structure(
    "Bodies", (Table, "hulls ends pairs slots"), (Dense, "shapes corners planes edges")
)
Bodies = Annotated[Any, BODIES.kind]

# Memory for a tree in one configuration.
#
#     poses      (n + 1, 12) rotation by rows and place of the joints, and last of the world, at -1
#     columns    (nv, 6) motion per unit of each row of v
#     bodies     (n, 10) mass, first moment and inertia of each body
#     composite  (n, 10) the same of all behind each joint
#     inertia    H_l (nv, nv)
#     about      (3,) the point of all spatial vectors: the first free base, or the first joint
#     bases      (b, 5) the free bases, columns JOINT to PLACES
#     carried    (b, 10) momentum (6), centre of mass (3), and mass of what each of these carries
PLACED_TREE = Structure(
    "PlacedTree",
    (OutDense, "poses", "poses", 12),
    (OutDense, "columns", "v", 6),
    (OutDense, "bodies composite", "joints", 10),
    (OutDense, "inertia", "v", "v"),
    (OutRow, "about", 3),
    (Table, "bases"),
    (OutDense, "carried", "bases", 10),
)
PlacedTree = Annotated[Any, PLACED_TREE.kind]

# What acts over a part beside gravity and the gears' losses.
#
#     joints, numbers, drives, gears: effects that loops evaluate in the middle, see `EffectTable`
#     low, high  (m,) memory: bounds of the rotor torques [N m]
#     command    (m,) memory: [N m] that reaches these drives
#     added      (m,) memory: [N m] on the rotors, of effects that Python evaluates
#     external   (nv,) memory: generalised forces from outside
#     outer      (nv,) memory: the same of effects that Python evaluates
#     dry        (nv,) memory: level of dry friction of the latter
#     friction   (nv,) memory: level of all dry friction
#     mesh       (m,) memory: torque [N m] that effects take the gears to carry, no number where it
#                is what they remember; empty where no effect asks
#     asked      address of a function of Python that fills command, added, outer and dry in the
#                middle, and coupling of gears, also before an impact; else zero
#     full       address of one that makes `Opened.stages` longer, which are all used
FORCES = Structure(
    "Forces",
    (Table, "joints"),
    (Dense, "numbers drives gears"),
    (OutRow, "low high command added", "m"),
    (OutRow, "external outer dry friction", "v"),
    (OutRow, "mesh", "meshed"),
    (int, "asked full"),
)
Forces = Annotated[Any, FORCES.kind]

BOOK = numbered(" ".join(EnergyFlow._fields) + " normal traffic kinetic taken share")
"""Numbers of the books of a part or an impact [J]: work and losses, see `EnergyFlow`; what one
contact or stop made; bounds of what moved, for an impact the kinetic energy before; what was taken
from speeds that the velocity terms had made; and the share of the restitution."""

TIME, LENGTH, STAGE = range(3)
"""Numbers of `Now`, its first words: [s]; how long the part takes that begins there [s], zero where
an impact does; and how many parts and impacts the step had before."""

# Memory for where the next part or impact starts: the state, and what is kept of the step.
#
#     numbers             (3,) TIME to STAGE
#     position, velocity  q (nq,), v (nv,)
#     impulse             of the rows of the last part, in the layout of `Ending.impulse`
#     deflection          (m,) [rad] of the motor outputs ahead of the joints
#     motor_speed         (m,) [rad/s] of the motor outputs
#     command             (m,) [N m] on the rotors over the step, within their bounds
#     flow                (13,) work and losses of the step so far [J], see `EnergyFlow`
#     closed              (2 j + c,) barriers that hold
#     kept, struck        (2 j + c,) barriers that may close within the next part, and those that
#                         were reached in the step
#     words               all of this memory in one
NOW = Structure(
    "Now",
    (OutRow, "numbers", 3),
    (OutRow, "position", "q"),
    (OutRow, "velocity", "v"),
    (OutRow, "impulse", "rows"),
    (OutRow, "deflection motor_speed command", "m"),
    (OutRow, "flow", len(EnergyFlow._fields)),
    (OutFlags, "closed kept struck", "barriers"),
    (OutRow, "words"),
)
Now = Annotated[Any, NOW.kind]

# Memory for the middle of a part and its end, and for an impact, which writes those marked *.
#
#     motor_speed   (m,) of the motor outputs at the end
#     mesh_impulse  * T (m,) [N m s]
#     torque        (m,) [N m] that drives delivered on the rotors
#     gap           * (2 j + c,)
#     after         * v (nv,) at the middle, after forces and impulses
#     before        q (nq,) in the middle
#     speed         v (nv,) there, before forces and impulses
#     force         (nv,) generalised forces in the middle, of effects and from outside
#     deepest       (2,) greatest depth that is left to take back, and the number of its barrier
#     pushes        * (3 (k + p),) impulses [N s] on contact points, and on the first hull of each
#                   pair, world axes
#     books         * (18,) work and losses [J], see BOOK
#     work          * (3,) USED to MISSED of `part_rows`
#     words         all of this in one; what follows is not kept of a stage
#     impulse       of the rows, in the layout in which a state keeps them
#     position      q (nq,) at the end
#     velocity      v (nv,) at the end
#     moved         (nv,) shift out of overlaps
#     deflection    (m,) [rad] of the motor outputs ahead of the joints
#     rate          (2 j + c,) at which closed contacts opened at the start
#     closed        * (2 j + c,) barriers that hold or take part; afterwards those that stay closed
#     kept, jumps   (2 j + c,) barriers that may close within the part, and those that are to be
#                   kept from its end on: they land slowly, or their gap jumps
#     fresh         * (2 j + c,) barriers that an impact reaches
ENDING = Structure(
    "Ending",
    (OutRow, "motor_speed mesh_impulse torque", "m"),
    (OutRow, "gap", "barriers"),
    (OutRow, "after speed force", "v"),
    (OutRow, "before", "q"),
    (OutRow, "deepest", 2),
    (OutRow, "pushes", "pushes"),
    (OutRow, "books", len(BOOK)),
    (OutRow, "work", 3),
    (OutRow, "words"),
    (OutRow, "impulse", "rows"),
    (OutRow, "position", "q"),
    (OutRow, "velocity moved", "v"),
    (OutRow, "deflection", "m"),
    (OutRow, "rate", "barriers"),
    (OutFlags, "closed kept jumps fresh", "barriers"),
)
Ending = Annotated[Any, ENDING.kind]


@structured
class Opened(NamedTuple):
    """All of a plant.

    Attributes:
        tree, obstacles, gears, placed, bodies, forces, now, end: see there.
        stages: (s, w) memory: the words of `now` at the start of parts and impacts, and behind them
            those of `end` at their end; last of all those of `now` at the end of the step.
        bounds: (5,) at RETURN_SPEED: at which an overlap is taken back at most; HERTZ, DISSIPATION:
            K and a of compliant contacts, K = 0 for rigid ones; SLOW: way of a slow landing per
            square of the step, see `course`; RESTITUTION.
        heap: memory for the rows of a part or an impact, and what solves them.
    """

    tree: Tree
    obstacles: Obstacles
    gears: Gears
    placed: PlacedTree
    bodies: Bodies
    forces: Forces
    now: Now
    end: Ending
    stages: OutDense
    bounds: OutRow
    heap: Heap


RETURN_SPEED, HERTZ, DISSIPATION, SLOW, RESTITUTION = range(5)
