"""Follow what a diagnosis asks for: the runs that its next experiment stands for."""

from __future__ import annotations

from benchmarks.corpus.case import Case
from benchmarks.corpus.excitation import Excitation
from wbc.identification import Diagnosis

_DURATION = 8.0  # [s]

# Which run each effect's `experiment` describes.
RUN_FOR = {
    "viscous_friction": "speeds",  # several speeds
    "directional_viscous_friction": "speeds",
    "thermal_viscous_friction": "speeds",  # cold and warm
    "voltage_scaling": "multisine",  # one motion at two voltages
    "quadratic_drag": "speeds",
    "rotor_viscous_friction": "speeds",
    "coulomb_friction": "sweep",  # slowly both ways
    "rotor_coulomb_friction": "sweep",
    "stribeck_friction": "sweep",
    "presliding": "sweep",
    "load_presliding": "sweep",
    "link_inertia": "shake",
    "link_inertias": "shake",
    "torque_ripple": "sweep",
    "load_stribeck_friction": "sweep",
    "load_friction": "slow",  # lift and lower slowly
    "transmission_efficiency": "slow",
    "torque_constant": "holds",  # still in many poses
    "payload_mass": "holds",
    "center_of_mass": "holds",
    "joint_spring": "holds",
    "torque_offset": "holds",
    "position_offset": "holds",
    "gravity_direction": "holds",
    "rotor_inertia": "shake",  # fast with small strokes
    "actuation_delay": "shake",
    "supply_sag": "fast",  # several joints accelerate at once
    "current_limit": "fast",
    "joint_compliance": "stops",  # stop abruptly
    "backlash": "multisine",  # swing the load through zero
    "thermal_drift": "multisine",  # one loaded motion for long
}


def following_runs(case: Case, diagnosis: Diagnosis) -> tuple[Excitation, ...]:
    """Return one run of each kind that the rivals' experiments ask for."""
    names = [
        name.split(" at ")[0]
        for finding in diagnosis.findings
        if finding.alternatives
        for name in (finding.effect.name, *finding.rivals)
    ]
    kinds = dict.fromkeys(RUN_FOR[name] for name in names if name in RUN_FOR)
    first = 1_000_000 + 100 * case.number
    return tuple(Excitation(kind, first + k, _DURATION, first + k) for k, kind in enumerate(kinds))
