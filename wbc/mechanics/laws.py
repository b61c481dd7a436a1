"""The laws of rows, one by one: what an element carries, and what gives way in series with it.

Over a step a dissipative row (a gear, dry friction, or both in one row) with speed w after the step
carries an impulse T (on the links, along the row). With s = sgn(w) and the gear's share
T_g = T + s f + B w of the impulse:

    w > 0:  M w + k T_g = up        k = 1/eta_f where s T_g > 0 (motor drives), eta_b otherwise
    w < 0:  M w + k T_g = down
    w = 0:  T anywhere between the two branches

M is the reflected rotor inertia (plus the step's viscous share), up and down the impulse that the
rotor brings along: motor impulse plus M w_before, less or plus the rotor's Coulomb impulse. For
eta_f eta_b <= 1 the graph T(w) is non-increasing: a step is a convex program. Friction of a joint
alone is the same law with M = up = down = 0 and both efficiencies one.

A spring in series, T = p + s (w - W v), leaves a law of the same kind between T and u = W v. With
s = 0 it is T = p: it is written so that a spring that hardly changes its impulse (a short step, a
flank that is only just reached) is as regular as a stiff one.

Flanks of a gear that yields are such a spring near each speed e = w - u that ends a step. What
they pass never falls with e and never jumps, so that one e meets both laws. A compliant contact
(K. Hunt and F. Crossley, *Coefficient of Restitution Interpreted as Damping in Vibroimpact*,
J. Applied Mechanics 42, 1975) is a flank in front of the ground, which stands still: w = 0. With
the depth d > 0 that grows at d' [m/s] it pushes by F = K d^(3/2) (1 + 3/2 a d'), and never pulls.
Over a step in which the depth goes from d0 to d1 the impulse is

    h (U(d1) - U(d0))/(d1 - d0) (1 + 3/2 a (d1 - d0)/h),    U = 2/5 K d^(5/2),

so that what the spring takes and gives back is exact at any step, and the rest is lost.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbc.compiled import OutRow, Row, inner

STIFFNESS, DAMPING, HALF, STEP, LATE, LATE_DAMPING, PLACE, RATE, END = range(9)
"""Columns of flanks: k, c, half of the play [rad], h, theta and theta_c of `flank_impulse`, place d
and rate at the start of the step, and memory for the rate at its end. Of contacts K, a, -1, h, 1/2,
any, d0, d', and the same memory."""

_ROUNDS = 60  # of Newton's iteration in an interval, which settles in 1 to 4 where it is near
_MET = 1e-14  # of an impulse: how far it may be off its flank's law
_NEAR = 1e-5  # share of a depth below which a difference quotient is the slope in the middle


@inner
def branch_of(law: Row, point: float, slope: float) -> tuple[float, float, float]:
    """Return sign, gain and bring of the branch on which a law meets the line T - slope w = point.

    The sign is +1 turning forward, -1 backward, 0 stuck; the gain is k, the mesh input per output;
    what is brought is `up` or `down`. The line meets the law of a self-locking row once if its
    slope, >= 0 [kg m^2], is below M/|eta_b|.
    """
    up, down, inertia, inverse, backward = law[0], law[1], law[2], law[3], law[4]
    load, resisting = point + law[5], law[6] + slope
    if up > max(load * inverse, load * backward):
        driving = inertia * load + resisting * up > 0.0
        return 1.0, inverse if driving else backward, up
    load = point - law[5]
    if down < min(load * inverse, load * backward):
        driving = -inertia * load - resisting * down > 0.0
        return -1.0, inverse if driving else backward, down
    return 0.0, 0.0, 0.0


@inner
def meeting_speed(law: Row, point: float, slope: float) -> float:
    """Return w at which a law (9,) meets the line T - slope w = point."""
    sign, gain, bring = branch_of(law, point, slope)
    if sign == 0.0:
        return 0.0
    return float((bring - gain * (point + sign * law[5])) / (law[2] + gain * (law[6] + slope)))


@inner
def own_speed(law: Row, slope: float, impulse: float, speed: float) -> float:
    """Return w of an element (9,) that carries an impulse T at u = W v.

    Where there is a spring it follows from the law and the line of that slope on which the row
    meets it, not from the spring, whose impulse may hardly depend on it.
    """
    if law[7] == np.inf:
        return speed
    give = 1.0 / (law[7] + slope)
    point = give * (law[7] * (impulse - slope * speed) + slope * law[8])
    return meeting_speed(law, point, law[7] * give * slope)


@inner
def element_meets(law: Row, own: float, about: float, speed: float) -> tuple[float, float]:
    """Return where an element's law meets a row that gives way.

    Args:
        law: (9,) of the element.
        own: compliance of the row.
        about: impulse at which it is unloaded.
        speed: u = W v there.

    Returns:
        the change of the impulse, and by how much it falls per speed.
    """
    slope, pull = 1.0 / own, 0.0
    if law[7] < np.inf:
        yields = 1.0 + law[7] * own
        slope, pull = law[7] / yields, (law[8] - about) / yields
    sign, gain, bring = branch_of(law, about + pull - slope * speed, slope)
    if sign == 0.0:
        return pull - slope * speed, slope
    kept = law[2] + gain * law[6]
    share = slope / (kept + gain * slope)
    missing = bring - gain * (about + pull + sign * law[5]) - kept * speed
    return pull + share * missing, share * kept


@inner
def flank_impulse(flank: Row, end: float) -> tuple[float, float, float, float]:
    """Return what a gear's flanks take over a time step that ends at a rate.

    The one rule by which the plant and the links of a log step through the law of `Flanks`. The
    deflection moves from d to d' = d + h ((1 - theta) v + theta v'). The spring's torque is the
    slope of the chord of its energy U between both (discrete gradient: O. Gonzalez, "Time
    integration and discrete Hamiltonian systems", J. Nonlinear Sci. 6, 1996, section 4):

        (2 - 2 theta) (U(d') - U(d)) / (d' - d) + (2 theta - 1) U'(d')

    With theta = 1/2 it gives back exactly what it stores, also where the step crosses from the play
    onto a flank. The damper counts for the share of the way that touches a flank, at the rate
    (1 - theta_c) v + theta_c v'. A flank with play pushes only: each of the two for itself, where a
    step leaves one and reaches the other. So the impulse never jumps with v' and never falls.

    Args:
        flank: (9,) k [N m/rad], c [N m s/rad], half of the play [rad] (none makes a spring that
            pulls and pushes), h [s], theta (1/2 takes no energy out of a swing, 1 takes it out of
            one that is too quick), theta_c, and d [rad] and v [rad/s] at the start.
        end: v' [rad/s].

    Returns:
        impulse: against the deflection [N m s].
        slope: its change per v', not negative [N m s^2/rad].
        touch: share of the way that touches a flank; zero where the flank lets go.
        damped: what of the impulse is not the spring's [N m s].
    """
    stiffness, damping, half, step = flank[STIFFNESS], flank[DAMPING], flank[HALF], flank[STEP]
    late, late_damping, place, rate = flank[LATE], flank[LATE_DAMPING], flank[PLACE], flank[RATE]
    way = step * ((1.0 - late) * rate + late * end)
    there = place + way
    bent = place - min(max(place, -half), half)
    bends = there - min(max(there, -half), half)
    damped = step * damping * ((1.0 - late_damping) * rate + late_damping * end)
    if half == 0.0 or bent * bends > 0.0:
        torque = step * stiffness * ((1.0 - late) * bent + late * bends)
        if half > 0.0 and (torque + damped) * torque <= 0.0:
            return 0.0, 0.0, 0.0, -torque
        slope = step * (stiffness * late * step * late + damping * late_damping)
        return torque + damped, slope, 1.0, damped
    impulse, slope, touch, rest = 0.0, 0.0, 0.0, 0.0
    # The flank that is left, then the one that is reached.
    for place_on, first in ((bent, True), (bends, False)):
        if place_on == 0.0:
            continue
        share = abs(place_on / way)
        torque, growth = (1.0 - late) * share * place_on, (1.0 - share) / way
        turn = (1.0 - late) * share * (2.0 - share)
        if first:
            growth, turn = -share / way, (1.0 - late) * share * share
        else:
            torque, turn = torque + (2.0 * late - 1.0) * place_on, turn + 2.0 * late - 1.0
        torque *= step * stiffness
        push = torque + share * damped
        if push * place_on <= 0.0:
            rest -= torque
            continue
        impulse, touch, rest = impulse + push, touch + share, rest + share * damped
        slope += step * (stiffness * turn * step * late + damping * share * late_damping)
        slope += damped * growth * step * late
    return impulse, max(slope, 0.0), touch, rest


@inner
def begin_flank(flank: OutRow, half: float, place: float, rate: float, step: float) -> None:
    """Write all of a flank but its stiffness and damping, at the start of a step of h [s].

    Springs take the chord of their energy (theta 1/2), dampers the final speed (theta_c 1).
    """
    flank[HALF], flank[PLACE], flank[RATE], flank[END] = half, place, rate, rate
    flank[STEP], flank[LATE], flank[LATE_DAMPING] = step, 0.5, 1.0


@inner
def stored_at(stiffness: float, depth: float) -> float:
    """Return what a contact stores at a depth [m]: U, none outside."""
    return 0.4 * stiffness * depth * depth * sqrt(depth) if depth > 0.0 else 0.0


@inner
def mean_force(flank: Row, after: float) -> tuple[float, float]:
    """Return the mean force [N] of a contact up to a depth [m], and its derivative by that."""
    stiffness, before = flank[STIFFNESS], flank[PLACE]
    way = after - before
    if abs(way) <= _NEAR * max(abs(before), abs(after)):
        root = sqrt(max(0.5 * (before + after), 0.0))
        force, slope = stiffness * root**3, 0.75 * stiffness * root
    else:
        force = (stored_at(stiffness, after) - stored_at(stiffness, before)) / way
        slope = (stiffness * sqrt(max(after, 0.0)) ** 3 - force) / way
    rate = 1.5 * flank[DAMPING] / flank[STEP]
    share = 1.0 + rate * way
    if share <= 0.0 or force <= 0.0:
        return 0.0, 0.0
    return share * force, share * slope + rate * force


@inner
def place_after(flank: Row, end: float) -> float:
    """Return where a flank is after a step that ends at a rate."""
    late = flank[LATE]
    return float(flank[PLACE] + flank[STEP] * ((1.0 - late) * flank[RATE] + late * end))


@inner
def passed_by(flank: Row, end: float) -> tuple[float, float, float]:
    """Return impulse, slope and damped part (see `flank_impulse`) of flanks or a contact."""
    if flank[HALF] < 0.0:
        step, (force, rise) = flank[STEP], mean_force(flank, place_after(flank, end))
        return step * force, flank[LATE] * step * step * rise, 0.0
    impulse, slope, _, damped = flank_impulse(flank, end)
    return impulse, slope, damped


@inner
def flank_meets(
    law: OutRow, flank: OutRow, own: float, about: float, speed: float
) -> tuple[float, float]:
    """Return what `element_meets` does, with the flanks (9,) in series.

    Their spring is written into the law, and the rate e at the end of the step into the flanks. A
    rigid flank that is reached stops the relative motion; what it is overrun by, at most one step,
    stays. One without play is none.
    """
    half = flank[HALF]
    if flank[STIFFNESS] == np.inf:
        place = flank[PLACE] + 0.5 * flank[STEP] * flank[RATE]
        if half > 0.0:
            law[7], law[8] = np.inf if abs(place) >= half else 0.0, 0.0
        change, fall = element_meets(law, own, about, speed)
        if half > 0.0 and np.sign(place) * (about + change) < 0.0:
            law[7] = 0.0
            change, fall = element_meets(law, own, about, speed)
        return change, fall
    low, high, end = -np.inf, np.inf, flank[END]
    change = fall = 0.0
    for turn in range(_ROUNDS):
        impulse, slope, _ = passed_by(flank, end)
        off, size = impulse - law[8] - law[7] * end, abs(impulse) + abs(law[7] * end)
        if turn > 0 and abs(off) <= _MET * size:
            break
        law[7], law[8] = slope, impulse - slope * end
        change, fall = element_meets(law, own, about, speed)
        following = own_speed(law, 1.0 / own, about, speed) - speed - own * change
        low, high = (end, high) if following >= end else (low, end)
        inside = low < following < high or following == end
        end = following if inside else 0.5 * (low + high)
    flank[END] = end
    return change, fall
