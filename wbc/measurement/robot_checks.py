"""Findings about what a robot has and a log lacks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations, permutations
from math import factorial

import numpy as np
from scipy.special import logsumexp

from wbc.measurement.evidence import evidence
from wbc.measurement.findings import LogFinding, Mend, say_so
from wbc.measurement.log import Log
from wbc.measurement.log_rows import LogRows, rows_of
from wbc.measurement.names import unread_columns, unread_map
from wbc.measurement.read import mended
from wbc.measurement.readings import Bench, Reading, as_it_stands
from wbc.measurement.torque import (
    REPORTED,
    makes_torque,
    placeless_joints,
    torque_channels,
    without_position,
)
from wbc.robot import Robot, state_gear

_TORQUES = (*REPORTED, "joint_torque")
_NO_TORQUE = "Record what the drive reports; a log of positions alone can be played, not compared."
_MOST_ORDERS = 720
_SURE = 0.9
_OF_UNIT = ("rotor_torque", "motor_torque", "joint_torque")


def check_robot(log: Log, robot: Robot) -> list[LogFinding]:
    """Return findings about joints without position, drives without torque, and no motion."""
    unknown = unknown_joints(log, robot)
    if unknown is not None:
        return [unknown]
    base = unknown_base(log, robot)
    found = [*([base] if base is not None else _without_force(log, robot))]
    found += _without_torque(log, robot)
    return [*found, *_with_holes(log, robot)]


def _with_holes(log: Log, robot: Robot) -> list[LogFinding]:
    """Return what to do about channels that the robot needs and that hold NaN."""
    needed = [f"{joint}.position" for joint in robot.single_joints]
    for joint in robot.transmission.joints:
        names = [f"{joint}.{quantity}" for quantity in _TORQUES]
        if not any(log.has(name) for name in names):
            needed += names
    held = [name for name in needed if name in log.source.unusable]
    if not held:
        return []
    mend: Mend = {"columns": {name: {"missing": "drop_rows"} for name in held}}
    rows = log.source.unusable[held[0]].partition(". ")[0]
    text = f"{', '.join(held)} {'is' if len(held) == 1 else 'are'} needed, and {rows}."
    way = say_so(mend, "To drop these rows, say so")
    return [LogFinding("error", "missing", held[0], text, way, mend)]


def unknown_joints(log: Log, robot: Robot) -> LogFinding | None:
    """Return what to do about joints without position, None where every joint has what it needs.

    A velocity is enough for a joint whose position changes nothing (see `placeless_joints`).
    """
    missing = [name for name in robot.single_joints if not log.recorded(f"{name}.position")]
    speeds = without_position(robot, log)
    placeless = placeless_joints(robot, speeds)
    missing = [name for name in missing if name not in placeless]
    if not missing:
        return None
    strange = [name for name in log.with_quantity("position") if name not in robot.joints]
    seen = f"the log has those of {', '.join(log.with_quantity('position')) or 'no joint'}"
    text = f"no position of {', '.join(missing)} of '{robot.name}'; {seen}."
    mend: Mend = {}
    unread = log.source.ignored
    sought = [f"{name}.position" for name in missing]
    named = unread_map(unread, sought)
    if len(named.get("columns", {})) == len(missing):
        way = unread_columns(unread, sought)
        return LogFinding("error", "joints_unknown", "", text, way, named)
    way = "Give the robot of these logs, or name the columns in a column map (--columns MAP.toml)."
    placed = [name for name in missing if name in speeds]
    if placed:
        way += f" The velocity of {', '.join(placed)} alone is not enough: gravity or inertia there"
        way += " depends on the position."
    way += " Joints that never moved are held still by a line at the top of robot.toml:"
    way += f"\n    lock = {missing}"
    if len(strange) == len(missing):
        order, sure = match_joints(robot, log, missing, strange)
        mend = {
            "columns": {
                f"{ours}.{name.removeprefix(theirs + '.')}": {"from": name}
                for ours, theirs in order.items()
                for name in log.columns
                if name.startswith(f"{theirs}.")
            }
        }
        why = "as their motion and torques tell" if sure else "if their order is the same"
        way = f"If they are the same joints ({why}), " + say_so(mend)
    elif unread:
        way = f"{unread_columns(unread, sought)}\n{way}"
        mend = named
    return LogFinding("error", "joints_unknown", "", text, way, mend)


def unknown_base(log: Log, robot: Robot) -> LogFinding | None:
    """Return what to do about a free base without a pose, None where the pose is there."""
    if not robot.has_free_flyer:
        return None
    needed = {"position": "xyz", "orientation": "xyzw"}
    names = {kind: [f"base.{kind}.{axis}" for axis in axes] for kind, axes in needed.items()}
    lost = {kind: [name for name in each if not log.recorded(name)] for kind, each in names.items()}
    lacking = [name for each in lost.values() for name in each]
    if not lacking:
        return None
    kinds = " and ".join(kind for kind, each in lost.items() if each)
    way = (
        "Record where the robot is, from motion capture or a state estimator, as metres and as a "
        "unit quaternion (body to world). If the base is held, give the robot with its fixed base."
    )
    return LogFinding(
        "error",
        "no_base_pose",
        "",
        f"no {kinds} of the base of '{robot.name}', which is free: {', '.join(lacking)} needed.",
        f"{way} {unread_columns(log.source.ignored, lacking)}".rstrip(),
    )


def _without_force(log: Log, robot: Robot) -> list[LogFinding]:
    """Return what to do where nothing tells when and how contacts of a free base push."""
    names = [contact.name for contact in robot.contacts]
    told = [name for name in names if name in log.contacts or log.has(f"{name}.active")]
    if not robot.floating_size or not names or told:
        return []
    sought = [f"{name}.force.z" for name in names]
    return [
        LogFinding(
            "warning",
            "no_contact_force",
            "",
            f"no force and no flag of the contacts {', '.join(names)}: only logs in which the "
            "robot stands on all of them can be used.",
            f"Record {names[0]}.force.x, .y and .z [N], or {names[0]}.active, 1 while it touches "
            f"and else 0, and so on. {unread_columns(log.source.ignored, sought)}".rstrip(),
        )
    ]


def _found_torque(log: Log, joints: list[str]) -> str:
    """Return what to do where columns that were not read may be the torques of joints."""
    sought = torque_channels(joints)
    way = unread_columns(log.source.ignored, sought)
    certain = len(unread_map(log.source.ignored, sought).get("columns", {})) == len(joints)
    return way if certain or not way else f"{_NO_TORQUE} {way}"


def _without_torque(log: Log, robot: Robot) -> list[LogFinding]:
    lacking = [
        joint
        for joint in robot.transmission.joints
        if not any(log.recorded(f"{joint}.{quantity}") for quantity in _TORQUES)
    ]
    gears = robot.transmission if log.machine is None else log.machine.transmission
    made = dict(zip(gears.joints, makes_torque(log, gears), strict=True))
    targets = [joint for joint in lacking if log.recorded(f"{joint}.target_position")]
    followed = [joint for joint in lacking if made[joint]]
    lacking = [joint for joint in lacking if joint not in followed]
    constant = robot.transmission.torque_constant
    found = []
    gained = np.isfinite(gears.position_gain) | np.isfinite(gears.duty_gain)
    holes = [joint for joint in targets if joint in lacking and gained[gears.joints.index(joint)]]
    lacking = [joint for joint in lacking if joint not in holes]
    for joint in holes:
        text = log.source.unusable.get(
            f"{joint}.target_position", "a number of its gear is missing."
        )
        found.append(
            LogFinding(
                "error",
                "no_target",
                joint,
                f"the torque of {joint} is made from its target, and {text}",
                "If nothing drives the joint, take its gear out of robot.toml.",
            )
        )
    if lacking and set(lacking) <= set(targets):
        found.append(
            LogFinding(
                "error",
                "no_drive_gains",
                "",
                f"targets and no torque of {', '.join(lacking)}, and the robot states no gains of "
                "their position drives.",
                "State them (of drives that set the voltage: duty_gain instead of kp and kd): "
                + "\n".join(state_gear(joint, "kp", "kd") for joint in lacking),
            )
        )
    elif lacking:
        found.append(
            LogFinding(
                "error",
                "no_torque",
                "",
                f"no torque of {', '.join(lacking)}: one of rotor_torque, motor_torque, current "
                "and joint_torque is needed, or target_position and the drive's gains kp and kd.",
                _found_torque(log, lacking) or _NO_TORQUE,
                unread_map(log.source.ignored, torque_channels(lacking)),
            )
        )
    silent = [
        joint
        for k, joint in enumerate(robot.transmission.joints)
        if joint not in lacking
        and joint not in followed
        and not any(log.recorded(f"{joint}.{quantity}") for quantity in _OF_UNIT)
        and not np.isfinite(constant[k])
    ]
    if silent:
        found.append(
            LogFinding(
                "error",
                "no_torque_constant",
                "",
                f"the log gives currents of {', '.join(silent)}, and the robot no torque constant.",
                "State it: " + "\n".join(state_gear(j, "torque_constant") for j in silent),
            )
        )
    return found


def match_joints(
    robot: Robot, log: Log, ours: Sequence[str], theirs: Sequence[str]
) -> tuple[dict[str, str], bool]:
    """Return joint of the robot -> joint of the log, and whether the rows tell it.

    The order in which the reported torques follow what the motion needs; the order of the names
    where that cannot be told.

    Args:
        robot: whose joints some names of the log are thought to mean.
        log: with columns of `theirs`.
        ours: joints of the robot without columns.
        theirs: joints of the log that the robot does not have, as many.
    """
    plain = dict(zip(ours, theirs, strict=True))
    if len(ours) < 2 or factorial(len(ours)) > _MOST_ORDERS:
        return plain, len(ours) == 1
    renamed = mended(
        log,
        {
            "columns": {
                f"{one}.{name.removeprefix(other + '.')}": {"from": name}
                for one, other in plain.items()
                for name in log.columns
                if name.startswith(f"{other}.")
            }
        },
    )
    rows = rows_of(robot, renamed)
    if rows is None or len(set(rows.quantities)) > 1:
        return plain, False
    bench = Bench(rows)
    orders = list(permutations(range(len(ours))))
    scores = []
    for order in orders:
        sources = dict(zip(ours, (ours[k] for k in order), strict=True))
        changed = _reordered(robot, rows, sources)
        scores.append(evidence([(bench.reports(changed), bench.unrelated(changed))]))
    best = int(np.argmax(scores))
    sure = float(np.exp(scores[best] - logsumexp(scores))) > _SURE
    chosen = orders[best] if sure else orders[0]
    return {ours[k]: theirs[source] for k, source in enumerate(chosen)}, sure


def told_by_rows(robot: Robot, logs: Sequence[Log]) -> dict[str, tuple[float, float]]:
    """Return how well the rows tell the columns of each driven joint from those of the others.

    Args:
        robot: whose logs they are.
        logs: of it.

    Returns:
        Joint -> (probability that its position and torque are its own, with even odds for every
        exchange with another joint; share of its torque's power that the motion explains). Empty
        where the logs cannot be held against the robot, or nothing can be exchanged.
    """
    known = [rows for rows in (rows_of(robot, log) for log in logs) if rows is not None]
    driven = robot.transmission.joints
    if not known or len(driven) < 2 or any(len(set(rows.quantities)) > 1 for rows in known):
        return {}
    benches = [(rows, Bench(rows)) for rows in known]
    plain = [(bench, as_it_stands(rows)) for rows, bench in benches]
    standing = evidence([(bench.reports(one), bench.unrelated(one)) for bench, one in plain])
    left = np.mean([[r.left for r in bench.reports(one)] for bench, one in plain], axis=0)
    before = np.sum([bench.strays(one).sum(axis=0) for bench, one in plain], axis=0)
    odds = np.zeros(len(driven))
    for a, b in combinations(range(len(driven)), 2):
        pair = {driven[a]: driven[b], driven[b]: driven[a]}
        each = [(bench, _reordered(robot, rows, pair)) for rows, bench in benches]
        after = np.sum([bench.strays(one).sum(axis=0) for bench, one in each], axis=0)
        if after[[a, b]].sum() >= before[[a, b]].sum():
            continue  # what brings no report closer to the need is no rival
        score = evidence([(bench.reports(one), bench.unrelated(one)) for bench, one in each])
        odds[[a, b]] += np.exp(np.minimum(score - standing, 500.0))
    own, share = 1.0 / (1.0 + odds), np.clip(1.0 - left, 0.0, 1.0)
    return {joint: (float(own[k]), float(share[k])) for k, joint in enumerate(driven)}


def _reordered(robot: Robot, rows: LogRows, sources: Mapping[str, str]) -> Reading:
    """Return the reading in which some joints have the columns of others, position and torque."""
    single, driven = list(robot.single_joints), list(robot.transmission.joints)
    reading = as_it_stands(rows)
    places, torques = reading.order.copy(), reading.torque_order.copy()
    for joint, source in sources.items():
        places[single.index(joint)] = single.index(source)
        if joint in driven and source in driven:
            torques[driven.index(joint)] = driven.index(source)
    return replace(reading, order=places, torque_order=torques)
