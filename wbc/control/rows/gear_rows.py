"""Gears in a tick, compiled: which way they turn, what they give, and the rows that limit it.

Everything stands at the motor outputs, N times the rotors' torque. With sigma the certainty of a
gear's direction, T its output torque and e the slope of the mesh law blended by sigma, t = e T, and
N tau_phi = t + rotor qdd + rotor_bias.
"""

from __future__ import annotations

from math import sqrt

from wbc.compiled import OutRow, Places, Row, compiled, inner, view
from wbc.control.memory import BLEND, COUNT, GEAR, NUMBER, PART, ProgramMemory
from wbc.control.qp.solvers import INFINITE
from wbc.effects.tables import fill_commands, fill_torques
from wbc.mechanics.linear import add_times, copy_to, dot


@compiled
def place_loads(program: ProgramMemory) -> None:
    """Write which way joints and motors turn, the mesh law's slopes, and what the bias is.

    Dry friction acts against the direction that the expected speed gives it (`SpeedBlend`). The
    bias holds effects, and what the observer has learned.
    """
    gears, tree, velocity, dt = program.gears, program.tree, program.velocity, program.step[0]
    expected, corrected = program.expected, program.corrected
    blend, driven, bias, nv = gears.blend, gears.driven, gears.bias, len(velocity)
    trusted, full, rate = blend[BLEND.trusted], blend[BLEND.full_speed], blend[BLEND.observes]
    kept, smooth, dry = 1.0 - min(blend[BLEND.correction] * dt, 1.0), gears.smooth, gears.rubs
    fill_torques(gears.laws, gears.numbers, program.position, velocity, smooth, dry)
    for i in range(nv):
        corrected[i] = velocity[i]
        corrected[i] -= kept * min(max(velocity[i] - expected[i], -trusted), trusted)
        certain = min(max(corrected[i] / full, -1.0), 1.0)
        bias[i] = tree.bias[i] - smooth[i] - gears.effects[i]
        bias[i] += (dry[i] + gears.rubbing[i]) * certain
    for i in range(len(driven)):
        turns, moves = 0.0, 0.0
        for j in range(len(driven)):
            share = gears.from_joints[i, j]
            if share != 0.0:
                turns += share * corrected[driven[j]]
                moves += share * velocity[driven[j]]
        sigma, at_rest = min(max(turns / full, -1.0), 1.0), gears.rest[i]
        along = at_rest + abs(sigma) * (gears.forward[i] - at_rest)
        against = at_rest + abs(sigma) * (gears.backward[i] - at_rest)
        gears.turning[i], gears.sigma[i] = turns, sigma
        gears.slopes[0, i] = against if sigma > 0.0 else along
        gears.slopes[1, i] = along if sigma > 0.0 else against
        rubs = gears.dry[i] * sigma + gears.viscous[i] * moves
        gears.rotor_bias[i] = rubs + gears.rotor_added[i]
    for i in range(nv if rate > 0.0 else 0):
        surprise, learned, bound = 0.0, gears.learned[i], gears.bound[i]
        for j in range(nv):
            inertia = tree.mass_matrix[i, j] + gears.inertia[i, j]
            surprise += inertia * (velocity[j] - gears.predicted[j])
        # NaN where nothing was predicted
        found = learned + rate * surprise if surprise == surprise else learned
        gears.disturbance[i] = min(max(found, -bound), bound)
        bias[i] -= gears.disturbance[i]


@inner
def add_force(program: ProgramMemory, coordinate: int, share: float, row: OutRow) -> float:
    """Add a share of a coordinate of M qdd - scale J' f to a row (n,); return that of its bias."""
    gears, jacobian = program.gears, program.contacts.rows.jacobian
    nv, scale = len(gears.bias), program.numbers[NUMBER.scale]
    add_times(share, gears.mass[coordinate], row)
    for k in range(len(jacobian)):
        row[nv + k] -= scale * share * jacobian[k, coordinate]
    return float(share * gears.bias[coordinate])


@inner
def place_map(program: ProgramMemory) -> None:
    """Write T = D' (M qdd + bias - scale J' f)_driven as a map (m, n) and a constant part (m,)."""
    topology, driven = program.gears.topology, program.gears.driven
    for gear in range(len(driven)):
        program.output_bias[gear], program.map[gear] = 0.0, 0.0
        for i in range(len(driven)):
            share, row = topology[i, gear], program.map[gear]
            if share != 0.0:
                program.output_bias[gear] += add_force(program, driven[i], share, row)


@inner
def place_drive(
    program: ProgramMemory, gear: int, slope: float, rotor: float, row: OutRow
) -> float:
    """Write slope T + rotor (what the rotor takes) as a row (n,); return its constant part."""
    row[:] = 0.0
    add_times(slope, program.map[gear], row)
    add_times(rotor, program.gears.rotor[gear], row)
    return float(slope * program.output_bias[gear] + rotor * program.gears.rotor_bias[gear])


@inner
def place_output(program: ProgramMemory, x: Row, output: OutRow, share: OutRow) -> None:
    """Write T = map x + output_bias and what the rotors take, rotor qdd + rotor_bias (m,)."""
    gears, torque_map, bias = program.gears, program.map, program.output_bias
    for i in range(len(output)):
        output[i] = bias[i] + dot(torque_map[i], x)
        share[i] = gears.rotor_bias[i] + dot(gears.rotor[i], x)


@compiled(counted=False)
def place_torque_limits(program: ProgramMemory, choice: Places) -> None:
    """Write the convex rows of all gears, and one half-space of some; call after the map.

    A row is lower <= slope T + rotor qdd + rotor_bias <= upper of a gear. N tau_phi is convex in T
    where the slope for T > 0 is the larger one: its upper limit is then two rows, its lower one a
    union. In a gear that turns the other way it is the reverse. The rows for T <= 0 stand in front,
    those for T > 0 behind them.

    Args:
        program: PROGRAM, with the slopes written.
        choice: (m,) 1 where the half-space is that of T > 0, -1 where that of T < 0, 0 where
            there is none.
    """
    gears, C, count = program.gears, program.solver.C, len(program.limited)
    slopes, lower, upper = gears.slopes, program.stated_lower, program.stated_upper
    for i in range(count):
        gear = program.limited[i]
        steeper = slopes[1, gear] - slopes[0, gear]
        for side in range(2):
            row, slope = i + side * count, slopes[side, gear]
            offset = place_drive(program, gear, slope, 1.0, C[row])
            both = choice[gear] == 2 * side - 1 if steeper != 0.0 else side == 0
            has_low, has_high = both or steeper < 0.0, both or steeper > 0.0
            lower[row] = gears.lower[gear] - offset if has_low else -INFINITE
            upper[row] = gears.upper[gear] - offset if has_high else INFINITE


@compiled(counted=False)
def place_efforts(program: ProgramMemory, positive: Places) -> None:
    """Write the rows of efforts for directions (m,) of T, see `Effort`.

    They are root weight (e T + rotor share) or root weight T; what the mesh loses is a parabola.
    """
    gears, solver, m = program.gears, program.solver, len(program.map)
    row = program.counts[COUNT.cost] - len(program.efforts) * m
    for effort in range(len(program.efforts)):
        rotor, least = program.effort_kinds[effort, 0], program.effort_kinds[effort, 1]
        for i in range(m):
            e, weight = gears.slopes[min(positive[i], 1), i], program.efforts[effort, i]
            if least > 0.0:
                rate = abs(e - 1.0) * abs(gears.turning[i])
                weight *= rate / max(abs(program.output[i]), least)
            root = sqrt(weight)
            slope = root * (e if rotor > 0.0 else 1.0)
            right = -place_drive(program, i, slope, rotor * root, solver.rows[row])
            solver.right[row], solver.softness[row], row = right, 1.0, row + 1


@compiled(counted=False)
def place_torques(program: ProgramMemory, block: OutRow) -> bool:
    """Write what a solution leads to: torques, drive commands, the velocity expected next.

    Args:
        block: holds x; results.

    Returns:
        whether the limits leave all of the torque.
    """
    gears, ends, load, whole = program.gears, program.ends, program.joints.load, True
    x, expected = block[ends[PART.x] : ends[PART.x + 1]], program.corrected
    jacobian, nv, m = program.contacts.rows.jacobian, len(expected), len(gears.driven)
    rows, advanced = view(block, ends[PART.by_gear], len(GEAR), m), block[ends[PART.advanced] :]
    output, mesh, torque = rows[GEAR.output_torque], rows[GEAR.mesh_torque], rows[GEAR.torque]
    copy_to(program.position, block[ends[PART.position] :])
    copy_to(program.velocity, block[ends[PART.velocity] :])
    copy_to(expected, block[ends[PART.corrected] :])
    for i in range(nv):
        advanced[i] = expected[i] + program.step[0] * x[i]
    for i in range(m if len(load) > 0 else 0):
        row = gears.driven[i]
        load[row] = gears.bias[row]
        for k in range(len(jacobian)):
            load[row] -= program.numbers[NUMBER.scale] * jacobian[k, row] * x[nv + k]
    place_output(program, x, output, rows[GEAR.share])
    for i in range(m):
        rows[GEAR.expected_speed, i], rows[GEAR.certainty, i] = gears.turning[i], gears.sigma[i]
        mesh[i] = gears.slopes[1 if output[i] > 0.0 else 0, i] * output[i]
        needed = mesh[i] + rows[GEAR.share, i]
        torque[i] = min(max(needed, gears.lower[i]), gears.upper[i])
        if torque[i] != needed:
            mesh[i], whole = torque[i] - rows[GEAR.share, i], False
        rows[GEAR.drive, i] = torque[i] * gears.inverse_ratio[i]
    fill_commands(gears.drives, rows[GEAR.drive], rows[GEAR.drive])
    return whole
