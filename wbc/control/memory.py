"""Memory of a tick: what the compiled functions of `wbc.control.rows` read and write."""

from __future__ import annotations

from typing import Annotated, Any

from wbc.compiled import Count, Dense, OutDense, OutPlaces, OutRow, Places, Row, Table
from wbc.control.kinematics import RowsMemory, TreeMemory
from wbc.control.qp.active_set import SolverMemory
from wbc.control.rows.limits import JointsMemory
from wbc.structures import Structure, numbered

# The tasks of a level: k rows J qdd = wanted, and c rows that select coordinates.
#
# targets (e, 12) as placements; chosen (c,) coordinates, where q holds their positions, and goals
# (c,); gains and parts (5, k + c) of error, rate, drift, velocity and acceleration; limits of what
# is fed back, weights and wanted (k + c,); of the selecting rows also the summed weights (nv,) and,
# as a result, the weighted pull (nv,).
TASKS = Structure(
    "Tasks",
    (Dense, "targets", "e", 12),
    (Places, "chosen positions"),
    (Row, "goals", "c"),
    (Dense, "gains", 5, "k"),
    (Row, "limits weights", "k"),
    (OutDense, "parts", 5, "k"),
    (OutRow, "wanted", "k"),
    (Row, "diagonal", "v"),
    (OutRow, "pull", "v"),
    rows=RowsMemory,
)
TasksMemory = Annotated[Any, TASKS.kind]

# The contacts that are active: rows J qdd = target (k,), with damping (k,) [1/s].
#
# corners (c, 4): number of the entry of the rows, and a point of its frame [m] on which it rests.
CONTACTS = Structure(
    "Contacts", (Row, "damping"), (OutRow, "target", "k"), (Dense, "corners"), rows=RowsMemory
)
ContactsMemory = Annotated[Any, CONTACTS.kind]

# The gears of a controller, m of them on nv coordinates, and what acts on them in a tick.
#
# driven (m,) coordinates, D^-1 and D (m, m), 1/N (m,); M (nv, nv) with which the rotors' housings
# turn; what the rotors take (m, nv) per qdd, their dry and viscous friction and what else is added
# to it (m,); slopes of the mesh law at rest, where T sigma > 0, and elsewhere (m,); least and
# greatest N tau_phi (m,); effects at joints and drives as `EffectTable` holds them; torque of all
# other effects, and level of their dry friction (nv,); of the observer: torque learned, velocity
# predicted, bound (nv,), and the rotors' inertia (nv, nv). `blend`: error trusted and speed of
# certainty [rad/s], correction [1/s], rate of the observer [1/s], 0 without one. Results: bias
# (nv,), rotor_bias (m,), disturbance (nv,), expected dpsi and its certainty (m,), and slopes (2, m)
# of the mesh law for T <= 0 and for T > 0; `smooth` and `rubs` (nv,) are memory.
GEARS = Structure(
    "Gears",
    (Places, "driven"),
    (Dense, "from_joints topology mass rotor numbers drives inertia"),
    (Row, "inverse_ratio dry viscous lower upper predicted bound blend"),
    (Row, "rotor_added rest forward backward", "m"),
    (Table, "laws"),
    (Row, "effects rubbing learned", "v"),
    (OutRow, "bias disturbance smooth rubs", "v"),
    (OutRow, "rotor_bias turning sigma", "m"),
    (OutDense, "slopes", 2, "m"),
)
GearsMemory = Annotated[Any, GEARS.kind]

# The program of one level for one set of contacts. Its rows: tasks, efforts, balance of the
# undriven coordinates, contacts, what a more important level has decided.
#
# The state of a tick is q (nq,), v, the v that was expected of it and that drawn towards the
# measured one (nv,), and the time until the next tick [s]. `efforts` (e, m) are weights, of N
# tau_phi where the first of `effort_kinds` (e, 2) is one, of T where it is zero, and of what the
# mesh loses where the second one, a least torque, is not zero. They read T of the last tick and, in
# `positive` (m,), whether T > 0. T = map x + output_bias. `limited` (g,) are the gears that have a
# torque limit, whose rows are the first 2 g bounds; those of joints and distances begin at `joint`.
# The stated bounds are those of the solver but where a more important level has to pass. Part p of
# a block of results stands from ends[p] to ends[p + 1].
PROGRAM = Structure(
    "Program",
    (OutRow, "position", "q"),
    (OutRow, "velocity expected corrected", "v"),
    (OutRow, "step", 1),
    (Places, "limited undriven ends"),
    (OutDense, "map", "m", "n"),
    (OutRow, "output_bias output", "m"),
    (OutPlaces, "counts", 3),
    (Row, "numbers"),
    (Dense, "efforts effort_kinds"),
    (OutPlaces, "positive", "m"),
    (OutRow, "stated_lower stated_upper"),
    tree=TreeMemory,
    tasks=TasksMemory,
    contacts=ContactsMemory,
    gears=GearsMemory,
    joints=JointsMemory,
    solver=SolverMemory,
    joint=Count,
)
ProgramMemory = Annotated[Any, PROGRAM.kind]

BLEND = numbered("trusted full_speed correction observes")
"""`blend` of the gears."""

COUNT = numbered("cost hard own")
"""`counts`: rows of tasks and efforts, hard rows below them, and those of these that are the
robot's own."""

NUMBER = numbered("mass scale regular greatest reach")
"""`numbers`: [kg], [N] per unit of force, weight of qdd, greatest right side, and how
far a level may be beyond a bound, which counts as reached there, and lets the next one pass."""

PART = numbered("position velocity corrected advanced by_gear x z y")
"""Parts of a block: q, v, v corrected and expected next, the rows of the gears, x, z and y. What
stands before x is the same in every program of a controller, so that a tick reads there what the
last one came to, whatever its contacts were."""

GEAR = numbered("expected_speed certainty output_torque share mesh_torque torque drive")
"""Rows of gears in a block: expected dpsi, certainty, T, what the rotors take, t, N tau_phi within
the limits, and what the drives are told."""
