"""Rows about accelerations in a tick, compiled: contacts, tasks, bounds of joints, balance."""

from __future__ import annotations

from math import atan2, isfinite, sqrt

import numpy as np

from wbc.compiled import Dense, Row, compiled, inner, local
from wbc.control.kinematics import KIND, RowsMemory, TreeMemory, fill_state_rows, place_missing
from wbc.control.memory import COUNT, NUMBER, ProgramMemory
from wbc.control.qp.active_set import place_row
from wbc.control.qp.linalg import factorise_from, substitute
from wbc.control.rows.gear_rows import add_force
from wbc.mechanics.kinematics import placed_at, product
from wbc.mechanics.linear import add_times, dot, products

# [rad/s^2] that brakes without a limit are taken to give: within a tick whatever is needed.
_MOST = 1e9
_LEAST = 1.0  # [rad/s^2] deceleration to count on where the load leaves none
INSIDE = 0.1
"""Share of the way from an edge to the middle that a centre of mass at rest keeps from the edge."""
SWEEPS = 4
"""How often an acceleration is brought behind all edges: behind one it may be beyond another."""


@compiled
def keep_over_feet(program: ProgramMemory, vx: float, vy: float, row: int) -> None:
    """Take from the acceleration wanted of the centre of mass what would carry it off its feet.

    With b = sqrt(g / height), the contacts can bring the centre of mass c to rest as long as its
    capture point xi = c + c'/b lies in the hull of what they rest on. Behind an edge with the
    normal n at e, shrunk a little towards the middle of the hull, that stays so with

        n'c'' <= b (b (e - n'xi) - n'c').

    With fewer than three corners a robot balances on a line or a point, and nothing is taken.

    Args:
        vx, vy: of the centre of mass [m/s].
        row: of what tasks want, where x of its acceleration stands, and y in the next; result.
    """
    tree, corners, rows = program.tree, program.contacts.corners, program.contacts.rows
    wanted, com, count = program.tasks.wanted, tree.com, len(corners)
    if count < 3:
        return
    points = np.empty((count, 3))
    for i in range(count):
        e = int(corners[i, 0])
        placed_at(rows.places[e], corners[i, 1:], points[i])
        add_times(-1.0, rows.offsets[e, 12:15], points[i])
    mx, my, height = points[:, 0].mean(), points[:, 1].mean(), com[2] - points[:, 2].mean()
    if height <= 0.0:
        return
    pole = sqrt(-tree.gravity[2] / height)
    x, y = com[0] + vx / pole - mx, com[1] + vy / pole - my
    for _ in range(SWEEPS):
        kept = True
        for i in range(count):
            for j in range(count):
                nx, ny = points[j, 1] - points[i, 1], points[i, 0] - points[j, 0]
                size, outside = sqrt(nx * nx + ny * ny), 0.0
                for k in range(count):
                    along = nx * (points[k, 0] - points[i, 0]) + ny * (points[k, 1] - points[i, 1])
                    outside = max(outside, along)
                if size == 0.0 or outside > 1e-9 * size:
                    continue
                nx, ny = nx / size, ny / size
                edge = nx * (points[i, 0] - mx) + ny * (points[i, 1] - my)
                most = (1.0 - INSIDE) * edge - nx * x - ny * y
                most = pole * (pole * most - nx * vx - ny * vy)
                beyond = nx * wanted[row] + ny * wanted[row + 1] - most
                if beyond > 0.0:
                    kept = False
                    wanted[row] -= beyond * nx
                    wanted[row + 1] -= beyond * ny
        if kept:
            return


# What balancing reads of each unit of v: x and z of the foot, x and z of the centre of mass, the
# angular momentum about +y, and the pitch of a frame.
_FOOT_X, _FOOT_Z, _COM_X, _COM_Z, _SPIN, _PITCH = range(6)


@compiled
def pitch_rate(rows: Dense) -> tuple[float, float]:
    """Return a and c of dtheta/dt = a xd + c k for the smallest motion with a resting foot.

    From the rows (6, nv) above. Both are NaN where the foot cannot rest.
    """
    gram = np.empty((6, 6))
    products(rows, gram)
    weights = gram[_PITCH].copy()
    for i in range(5):
        gram[i, i] += 1e-12
    if not factorise_from(gram, 0, 5):
        return np.nan, np.nan
    substitute(gram, 5, weights)
    return weights[_COM_X], weights[_SPIN]


@compiled
def balancing(
    tree: TreeMemory, entries: RowsMemory, e: int, velocity: Row, mass: float, target: float
) -> float:
    """Return xdd [m/s^2], the feedback on (x, xd, k, theta) with all poles at -p.

    With u = xdd, G = m g and Z = m z the loop's polynomial is

        s^4 + (k2 - Z k3) s^3 + (k1 + (a - c Z) k4) s^2 + G k3 s + c G k4 = (s + p)^4.

    Args:
        entries: ROWS, of which row e names the foot, the frame whose pitch is kept, and p [1/s] in
            place of an arm, or 0 for that of the pendulum's fall, sqrt(g/z).
        e: number of the entry.
        velocity: v (nv,).
        mass: m [kg].
        target: theta wanted [rad].
    """
    foot, frame, com, offset = entries.plan[e, 1], entries.plan[e, 6], tree.com, entries.offsets[e]
    at, turn, weight = local(3), local(9), mass * sqrt(dot(tree.gravity, tree.gravity))
    placed_at(tree.poses[foot], offset[9:12], at)
    product(tree.poses[frame], offset[15:24], turn)
    x, z = at[0], at[2]
    rows, motions, momentum = np.zeros((6, len(velocity))), tree.motions, tree.momentum
    rows[_COM_X], rows[_COM_Z] = momentum[:, 0] / mass, momentum[:, 2] / mass
    rows[_SPIN] = momentum[:, 4]
    for j in tree.columns[tree.starts[foot] : tree.starts[foot + 1]]:
        rows[_FOOT_X, j] = motions[j, 0] + motions[j, 4] * z
        rows[_FOOT_Z, j] = motions[j, 2] - motions[j, 4] * x
    for j in tree.columns[tree.starts[frame] : tree.starts[frame + 1]]:
        rows[_PITCH, j] = motions[j, 4]
    from_speed, from_momentum = pitch_rate(rows)
    place, height = com[0] - x, com[2] - z
    speed, spin = dot(rows[_COM_X], velocity), dot(rows[_SPIN], velocity)
    pole = offset[12] if offset[12] > 0.0 else sqrt(weight / mass / abs(height))
    square = pole * pole
    on_pitch = square * square / (from_momentum * weight)
    on_spin = 4.0 * square * pole / weight
    on_speed = 4.0 * pole + mass * height * on_spin
    on_place = 6.0 * square - (from_speed - from_momentum * mass * height) * on_pitch
    pitch = target - atan2(turn[2], turn[8])
    return float(on_pitch * pitch - on_place * place - on_speed * speed - on_spin * spin)


@inner
def rest_contacts(program: ProgramMemory) -> None:
    """Write J of the contacts, and what brings them to rest: J qdd = -damping J v - dJ/dt v."""
    contacts, velocity = program.contacts, program.velocity
    fill_state_rows(program.tree, contacts.rows, program.numbers[NUMBER.mass])
    jacobian, drift = contacts.rows.jacobian, contacts.rows.drift
    for i in range(len(drift)):
        contacts.target[i] = -contacts.damping[i] * dot(jacobian[i], velocity) - drift[i]


@inner
def want(program: ProgramMemory) -> None:
    """Write the rows of all tasks, and what they want (k + c,): gains * parts, fed back in limits.

    Errors of what follows from the state, and all rates, are written into `parts` first. A momentum
    is a rate itself. A centre of mass that is to rest somewhere stays over the feet on its way.
    """
    tree, tasks, velocity = program.tree, program.tasks, program.velocity
    mass = program.numbers[NUMBER.mass]
    fill_state_rows(tree, tasks.rows, mass)
    rows, parts, gains, targets = tasks.rows, tasks.parts, tasks.gains, tasks.targets
    wanted, pull, chosen, jacobian = tasks.wanted, tasks.pull, tasks.chosen, tasks.rows.jacobian
    plan, total = rows.plan, len(tasks.wanted)
    count = total - len(chosen)
    for i in range(count):
        parts[1, i], parts[2, i] = dot(jacobian[i], velocity), rows.drift[i]
    for e in range(len(plan)):
        if rows.used[e] == 0:
            continue
        if plan[e, 0] == KIND.balance:
            parts[0, plan[e, 2]] = balancing(tree, rows, e, velocity, mass, targets[e, 9])
        else:
            place_missing(rows, e, targets[e], parts[1], parts[0])
    for i in range(len(chosen)):
        parts[1, count + i] = velocity[chosen[i]]
        parts[0, count + i] = tasks.goals[i] - program.position[tasks.positions[i]]
    for i in range(total):
        most = tasks.limits[i]
        back = min(max(gains[0, i] * parts[0, i], -most), most)
        back += gains[1, i] * parts[1, i] + gains[3, i] * parts[3, i]
        ahead = gains[2, i] * parts[2, i] + gains[4, i] * parts[4, i]
        wanted[i] = min(max(back, -most), most) + ahead
    for e in range(len(plan)):
        row, both = plan[e, 2], plan[e, 3] == 0 and plan[e, 4] > 1 and plan[e, 5] == 1
        limited = both and rows.used[e] != 0 and tasks.limits[row] < np.inf
        if plan[e, 0] == KIND.center_of_mass and limited:
            moves = abs(parts[3, row]) + abs(parts[3, row + 1])
            if moves + abs(parts[4, row]) + abs(parts[4, row + 1]) == 0.0:
                keep_over_feet(program, parts[1, row], parts[1, row + 1], row)
    pull[:] = 0.0
    for i in range(len(chosen)):
        pull[chosen[i]] += tasks.weights[count + i] * wanted[count + i]


@inner
def place_tasks(program: ProgramMemory) -> float:
    """Write the rows of tasks that have a weight, and the diagonal; leave room for efforts.

    Returns the sum of the sizes of everything wanted.
    """
    tasks, solver, count, total = program.tasks, program.solver, 0, 0.0
    for i in range(len(tasks.rows.jacobian)):
        total += abs(tasks.wanted[i])
        if tasks.weights[i] > 0.0:
            softness = 1.0 / tasks.weights[i]
            place_row(solver, count, tasks.rows.jacobian[i], tasks.wanted[i], softness)
            count += 1
    for j in range(len(tasks.diagonal)):
        solver.diagonal[j] = tasks.diagonal[j] + program.numbers[NUMBER.regular]
        solver.pull[j] = tasks.pull[j]
        total += abs(tasks.pull[j])
    program.counts[COUNT.cost] = count + len(program.efforts) * len(program.map)
    return total


@compiled
def viable(distance: float, speed: float, braking: float, dt: float) -> float:
    """Return the acceleration towards a stop after which a joint can still stop before it.

    The larger root a of (v + h a)^2 = 2 b (d - h v - h^2 a/2); braking in full where none is left.
    """
    if distance == np.inf:
        return np.inf
    reach = braking * dt
    root = reach * reach + 8.0 * braking * distance - 4.0 * reach * speed
    if root < 0.0:
        return -braking
    return (sqrt(root) - 2.0 * speed - reach) / (2.0 * dt)


@compiled
def place_joint_bounds(program: ProgramMemory) -> None:
    """Write the least and greatest acceleration of joints, see `JointLimit`."""
    joints, gears, dt = program.joints, program.gears, program.step[0]
    bias, mass, position, velocity = gears.bias, gears.mass, program.position, program.velocity
    least, greatest, first = program.stated_lower, program.stated_upper, program.joint
    for k in range(len(joints.rows)):
        row, most, room = joints.rows[k], joints.acceleration[k], joints.torque[k]
        q, v = position[joints.position_rows[k]], velocity[row]
        high = low = min(most, _MOST)
        if isfinite(room):
            load = joints.load[row] if isfinite(joints.load[row]) else bias[row]
            whole = mass[row, row] + joints.reflected[k]
            high = min(high, max((room + load) / whole, _LEAST))
            low = min(low, max((room - load) / whole, _LEAST))
        rise = viable(joints.upper[k] - q, v, high, dt)
        fall = viable(q - joints.lower[k], -v, low, dt)
        highest = min(max(min((joints.speed[k] - v) / dt, rise), -high), most)
        lowest = max(min(-min((joints.speed[k] + v) / dt, fall), low), -most)
        least[first + k], greatest[first + k] = min(lowest, highest), max(lowest, highest)


@inner
def place_balance(program: ProgramMemory) -> float:
    """Write (M qdd - scale J' f)_undriven = -bias_undriven, and the rows of contacts below.

    Returns the sum of the sizes of what stands on the right.
    """
    solver, at, total = program.solver, program.counts[COUNT.cost], 0.0
    jacobian, target = program.contacts.rows.jacobian, program.contacts.target
    for row in program.undriven:
        solver.rows[at], solver.softness[at] = 0.0, 0.0
        solver.right[at] = -add_force(program, row, 1.0, solver.rows[at])
        at, total = at + 1, total + abs(solver.right[at])
    for k in range(len(jacobian)):
        place_row(solver, at + k, jacobian[k], target[k], 0.0)
        total += abs(target[k])
    return total
