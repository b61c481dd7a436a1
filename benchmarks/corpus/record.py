"""Run cases on their plants and return tables of log columns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.corpus.case import Case
from benchmarks.corpus.closed_loop import Run, run_lanes
from benchmarks.corpus.excitation import Excitation
from benchmarks.corpus.families import CLOSED_LOOP
from benchmarks.corpus.needed import link_torque, motor_motion, needed_torque
from benchmarks.corpus.prescribed import RATE, prescribed_motion
from benchmarks.corpus.sensors import base_table, condition_table, joint_table

Table = dict[str, np.ndarray]


def record_cases(jobs: Sequence[tuple[Case, Sequence[Excitation]]]) -> list[list[Table]]:
    """Return the tables of every case's runs; those in closed loop are simulated side by side.

    Args:
        jobs: cases with the runs to record, which need not be the case's own.
    """
    tables: list[list[Table]] = [[] for _ in jobs]
    by_rate: dict[float, list[tuple[int, Run]]] = {}
    for k, (case, excitations) in enumerate(jobs):
        if case.machine.family in CLOSED_LOOP:
            runs = [(k, Run(case.machine, case.flaws, e)) for e in excitations]
            by_rate.setdefault(case.sensors.rate, []).extend(runs)
        else:
            tables[k] = [_prescribed(case, e) for e in excitations]
    for rate, runs in by_rate.items():
        for (k, run), trace in zip(runs, run_lanes([r for _, r in runs], rate), strict=True):
            case = jobs[k][0]
            tables[k].append(
                joint_table(
                    case.machine,
                    case.flaws,
                    case.sensors,
                    case.torque_noise,
                    run.excitation.noise,
                    trace.time,
                    trace.q,
                    trace.v,
                    trace.torque,
                )
            )
    return tables


def _prescribed(case: Case, excitation: Excitation) -> Table:
    machine, flaws, sensors = case.machine, case.flaws, case.sensors
    motion = prescribed_motion(machine, flaws, excitation)
    links = link_torque(machine, flaws, motion)
    torque = needed_torque(machine, flaws, motion, links)[:, : len(machine.driven)]
    q, v, _ = motor_motion(machine, flaws, motion, links)
    every = round(RATE / sensors.rate)
    kept = motion.thinned(every)
    table = joint_table(
        machine,
        flaws,
        sensors,
        case.torque_noise,
        excitation.noise,
        kept.time,
        q[::every],
        v[::every],
        torque[::every],
    )
    if sensors.conditions and kept.conditions is not None:
        table |= condition_table(machine, excitation.noise, kept.conditions)
    if machine.base_size:
        table |= base_table(machine, sensors, excitation.noise, kept)
    return table
