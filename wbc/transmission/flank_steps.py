"""One time step through the law of `Flanks`, compiled: import where needed.

Loading the compiler takes a moment that most programs need not wait for.
"""

from __future__ import annotations

from wbc.compiled import inner


@inner
def flank_impulse(
    stiffness: float,
    damping: float,
    half: float,
    step: float,
    late: float,
    late_damping: float,
    place: float,
    rate: float,
    end: float,
) -> tuple[float, float, float, float]:
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
        stiffness: k [N m/rad].
        damping: c [N m s/rad].
        half: half of the play [rad]; none makes a spring that pulls and pushes.
        step: h [s].
        late: theta; 1/2 takes no energy out of a swing, 1 takes it out of one that is too quick.
        late_damping: theta_c.
        place: d at the start [rad].
        rate: v at the start [rad/s].
        end: v' [rad/s].

    Returns:
        impulse: against the deflection [N m s].
        slope: its change per v', not negative [N m s^2/rad].
        touch: share of the way that touches a flank; zero where the flank lets go.
        damped: what of the impulse is not the spring's [N m s].
    """
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
