"""What an unexplained remainder looks like, in words."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.answer.breakdown import breakdowns, output_names
from wbc.identification.model.fit import Fit
from wbc.identification.model.problem import Problem
from wbc.identification.model.residual import condensed_residual
from wbc.identification.records.record import Record

_MATTERS = 2.0  # floors above which an output is mentioned
_DEPENDS = 0.15  # share of variance above which a dependence is mentioned


def describe_remainder(problem: Problem, fit: Fit) -> str:
    """Return a sentence per output with an unexplained residual: how large, and on what it depends.

    Args:
        problem: the logs.
        fit: the model whose residual is described.
    """
    records = problem.records
    parts = [condensed_residual(fit.robot, [record]) for record in records]
    given = [condensed_residual(problem.robot, [record]) for record in records]
    found = breakdowns(records, parts)
    sentences = []
    for column, name in enumerate(output_names(records[0])):
        values = [part[:, column] for part in parts]
        size = float(np.sqrt(np.mean(np.concatenate(values) ** 2)))
        floor = float(problem.floor.values[column])
        if size < _MATTERS * floor or column in problem.floor.aside:
            continue
        clues = [
            f"{b.variable} ({100.0 * b.share:.0f} %)"
            for b in found
            if b.output == name and b.share > _DEPENDS
        ][:3]
        text = f"{name}: {size:.3g} left, {size / floor:.0f} times the floor"
        text += f", follows {', '.join(clues)}" if clues else ", follows no single variable"
        growth = _growth(values)
        if growth > 1.5:
            text += f", grows {growth:.1f}-fold during a log"
        speeds = [_speed(record, column) for record in records]
        # Partial explanations blur the trace of a memory: the robot as given shows it, too.
        if _memory(values, speeds) or _memory([part[:, column] for part in given], speeds):
            text += ", builds up after every reversal (memory)"
        sentences.append(text + ".")
    return " ".join(sentences)


def _growth(values: list[FloatArray]) -> float:
    """Return the size in the last third of the logs over that in the first."""
    first = np.concatenate([v[: len(v) // 3] for v in values])
    last = np.concatenate([v[-(len(v) // 3) :] for v in values])
    return float(np.sqrt(np.mean(last**2) / max(float(np.mean(first**2)), 1e-300)))


def _speed(record: Record, column: int) -> FloatArray:
    """Return the speed (rows,) of the coordinate behind an output."""
    robot = record.robot
    order = np.concatenate([robot.actuated, robot.unactuated])
    return record.thinned(record.motion.velocity[:, order[column]])


def _memory(values: list[FloatArray], speeds: list[FloatArray]) -> bool:
    """Whether the residual changes gradually after reversals, as hysteresis does."""
    early, late = [], []
    for residual, speed in zip(values, speeds, strict=True):
        sign = np.sign(speed)
        toward = residual * sign
        changed = np.flatnonzero(np.diff(sign) != 0.0) + 1
        for start, stop in pairwise(changed):
            third = (stop - start) // 3
            if third >= 2:
                early.append(float(np.mean(toward[start : start + third])))
                late.append(float(np.mean(toward[stop - third : stop])))
    if len(early) < 6:
        return False
    difference = np.array(late) - np.array(early)
    score = float(np.mean(difference) / (np.std(difference) / np.sqrt(difference.size)))
    return abs(score) > 4.0
