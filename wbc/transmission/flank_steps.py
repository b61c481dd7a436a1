"""One time step through the law of `Flanks`, compiled: import where needed.

Loading the compiler takes a moment that most programs need not wait for.
"""

from __future__ import annotations

from wbc.compiled import Number, compiled, several


@compiled(several(Number, Number, Number), *(Number,) * 9)
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
) -> tuple[float, float, float]:
    """Return what a gear's flanks take over a time step that ends at a rate.

    The one rule by which the plant and the links of a log step through the law of `Flanks`. The
    deflection moves from d to d' = d + h ((1 - theta) v + theta v'). The spring's torque is the
    slope of the chord of its energy U between both (discrete gradient: O. Gonzalez, "Time
    integration and discrete Hamiltonian systems", J. Nonlinear Sci. 6, 1996, section 4):

        (2 - 2 theta) (U(d') - U(d)) / (d' - d) + (2 theta - 1) U'(d')

    With theta = 1/2 it gives back exactly what it stores, also where the step crosses from the play
    onto a flank. The damper counts for the share of the way that touches a flank, at the rate
    (1 - theta_c) v + theta_c v'. A flank with play pushes only.

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
    """
    way = step * ((1.0 - late) * rate + late * end)
    there = place + way
    bent = place - min(max(place, -half), half)
    bends = there - min(max(there, -half), half)
    if half == 0.0 or bent * bends > 0.0:
        torque = (1.0 - late) * bent + late * bends
        turn, touch, growth = late, 1.0, 0.0
    elif bent == 0.0 and bends == 0.0:
        return 0.0, 0.0, 0.0
    else:
        long = abs(way)
        carried = (bends * bends - bent * bent) / (2.0 * way)
        moved = 1.0 if bends != 0.0 else 0.0
        torque = (2.0 - 2.0 * late) * carried + (2.0 * late - 1.0) * bends
        turn = (2.0 - 2.0 * late) * (bends - carried) / way + (2.0 * late - 1.0) * moved
        touch = (abs(bends) + abs(bent)) / long
        growth = (moved - touch) / way
    damped = step * damping * ((1.0 - late_damping) * rate + late_damping * end)
    impulse = step * stiffness * torque + touch * damped
    if half > 0.0 and impulse * torque <= 0.0:
        return 0.0, 0.0, 0.0
    slope = step * (stiffness * turn * step * late + damping * touch * late_damping)
    slope += damped * growth * step * late
    return impulse, max(slope, 0.0), touch
