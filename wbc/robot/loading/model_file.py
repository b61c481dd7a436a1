"""Loading the rigid bodies from URDF or MJCF, and saying what of the file was not used."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from wbc.errors import RobotError, unknown_name
from wbc.robot.loading.left_out import left_out

_BASES = ("fixed", "free_flyer")


def read_model(path: Path, base: str, lock: Sequence[str]) -> tuple[pin.Model, tuple[str, ...]]:
    """Return the links of a model file and notes on what was read but set aside.

    Args:
        path: a `.urdf` or MJCF `.xml` file.
        base: "fixed" (the file's root is the world) or "free_flyer" (a free-flyer is put first).
        lock: joints to weld at their neutral position.

    Raises:
        RobotError: an unreadable file, an unknown base or joint.
    """
    if base not in _BASES:
        raise RobotError(f"{path}: " + unknown_name("base", base, _BASES))
    model = _parse(path, base)
    notes = _set_aside(model, path)
    if lock:
        known = list(model.names)[1:]
        for joint in lock:
            if joint not in known:
                raise RobotError(f"{path}: lock: " + unknown_name("joint", joint, known))
        numbers = [model.getJointId(joint) for joint in lock]
        model = pin.buildReducedModel(model, numbers, pin.neutral(model))
    return model, notes


def _parse(path: Path, base: str) -> pin.Model:
    try:
        if path.suffix == ".urdf":
            if base == "free_flyer":
                return pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
            return pin.buildModelFromUrdf(str(path))
        if path.suffix == ".xml":
            model = pin.buildModelFromMJCF(str(path))
            if base == "free_flyer" and not _floats(model):
                return pin.buildModelFromMJCFAndRootJoint(str(path), pin.JointModelFreeFlyer())
            return model
    except (ValueError, RuntimeError) as cause:
        raise RobotError(f"cannot read the model file '{path}': {cause}.") from cause
    raise RobotError(f"'{path}': a model file ends in .urdf or .xml (MJCF).")


def _floats(model: pin.Model) -> bool:
    return bool(model.njoints > 1 and model.joints[1].shortname() == "JointModelFreeFlyer")


def _set_aside(model: pin.Model, path: Path) -> tuple[str, ...]:
    """Zero what the transmission and the effects are responsible for; say which values it held."""
    notes = []
    for label, values in (
        ("armature", model.armature),
        ("rotorInertia", model.rotorInertia),
        ("damping", model.damping),
        ("friction", model.upperDryFrictionLimit),
    ):
        held = np.array(values)
        if np.any(held != 0.0):
            rows = ", ".join(f"{held[i]:g}" for i in np.flatnonzero(held))
            notes.append(
                f"{path.name}: {label} ({rows}) was read and set aside; give it in robot.toml "
                "(rotor_inertia) or as an effect (viscous_friction, coulomb_friction)."
            )
    model.armature = np.zeros(model.nv)
    model.damping = np.zeros(model.nv)
    model.upperDryFrictionLimit = np.zeros(model.nv)
    model.lowerDryFrictionLimit = np.zeros(model.nv)
    # The URDF parser stores the speed limit with the same sign on both sides.
    model.lowerVelocityLimit = -np.abs(model.upperVelocityLimit)
    tag = "<transmission" if path.suffix == ".urdf" else "<actuator"
    if tag in path.read_text(encoding="utf-8", errors="replace"):
        notes.append(f"{path.name}: {tag}> was ignored; gears stand in robot.toml.")
    return (*notes, *left_out(path))
