"""A robot description for a model file: what the file says, and guesses marked as guesses."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree

import pinocchio as pin

from wbc.errors import RobotError
from wbc.files import write_text
from wbc.measurement.guessing.ratio_guess import RatioGuess
from wbc.robot.loading.model_file import read_model

_KP, _KD = 20.0, 0.5  # gains of a small position drive: a start that has to be replaced
_GUESS = "guess: not in the model file; look it up"


def guessed_numbers(path: str | Path) -> list[str]:
    """Return the numbers of a robot description that are still guesses, `gears.knee.gear_ratio`.

    Empty for a robot that is no file.
    """
    if not Path(path).is_file():
        return []
    with Path(path).open("rb") as file:
        gears = tomllib.load(file).get("gears", {})
    return [
        f"gears.{joint}.{key}"
        for joint, numbers in gears.items()
        for key, number in numbers.items()
        if isinstance(number, dict) and str(number.get("source", "")).startswith(_GUESS)
    ]


def driven_joints(model: pin.Model) -> tuple[str, ...]:
    """Return the joints of a model that a gear can drive: those with one degree of freedom."""
    joints = [model.joints[model.getJointId(name)] for name in list(model.names)[1:]]
    names = list(model.names)[1:]
    return tuple(n for n, j in zip(names, joints, strict=True) if j.nv == 1 and j.nq == 1)


def model_joints(path: Path, base: str) -> tuple[str, ...]:
    """Return the joints of a model file that a gear can drive.

    Raises:
        RobotError: a file that cannot be read, or without such a joint.
    """
    model, _ = read_model(path, base, [])
    joints = driven_joints(model)
    if not joints:
        raise RobotError(f"'{path}' has no joint with one degree of freedom for a gear to drive.")
    return joints


def write_robot(
    target: str | Path,
    model: Path,
    base: str,
    driven: Sequence[str],
    name: str,
    targets: Sequence[str] = (),
    held: Sequence[str] = (),
    ratios: Mapping[str, RatioGuess] = MappingProxyType({}),
) -> Path:
    """Write a robot.toml whose numbers come from the model file, or are marked as guesses.

    Args:
        target: the file.
        model: URDF or MJCF.
        base: fixed or free_flyer.
        driven: joints that get a gear.
        name: of the robot.
        targets: joints of those whose drive follows a target that the logs hold, without a torque.
        held: joints that are welded at zero.
        ratios: gear ratios that the logs tell.
    """
    stated = {**_reductions(model), **_armatures(model)}
    lines = [
        "# Written by `wbc init`. Numbers whose source is 'guess' are to be looked up.",
        f'name = "{name}"',
        f'model = "{model.resolve().as_posix()}"',
        f'base = "{base}"',
    ]
    if held:
        names = ", ".join(f'"{joint}"' for joint in held)
        lines.append(f"lock = [{names}]  # guess: no column with their position, so held at zero")
    for joint in driven:
        ratio, inertia = stated.get(joint, (None, None))
        lines += [
            "",
            f'[gears."{joint}"]',
            _number("gear_ratio", ratio, *_of_rows(ratios.get(joint))),
            _number("rotor_inertia", inertia, 0.0, "kg m^2", "the diagnosis can find it"),
        ]
        if joint in targets:
            why = "it scales every torque: the gains of the drive make the torque of the target"
            lines += [
                _number("kp", None, _KP, "N m/rad", why),
                _number("kd", None, _KD, "N m s/rad", "as kp"),
            ]
    return write_text(Path(target), "\n".join(lines) + "\n")


def _of_rows(told: RatioGuess | None) -> tuple[float, str, str]:
    """Return a guessed gear ratio, its unit and where it comes from."""
    if told is None:
        return 1.0, "1", "torque is then taken behind the gear"
    return told.value, "1", f"from the rows: {told.source}"


def _number(key: str, value: float | None, guess: float, unit: str, why: str) -> str:
    known = value is not None
    source = "the model file" if known else f"{_GUESS}; {why}"
    return (
        f'{key} = {{ value = {value if known else guess}, unit = "{unit}", source = "{source}" }}'
    )


def _reductions(path: Path) -> Mapping[str, tuple[float, float | None]]:
    """Return joint -> (gear ratio, no inertia) of the <transmission> elements of a URDF."""
    found: dict[str, tuple[float, float | None]] = {}
    for element in _root(path).iter("transmission"):
        joint = element.find("joint")
        ratio = element.find(".//mechanicalReduction")
        if joint is None or ratio is None or not ratio.text:
            continue
        try:
            value = float(ratio.text)
        except ValueError:
            continue
        if value != 0.0:
            found[str(joint.get("name"))] = (value, None)
    return found


def _armatures(path: Path) -> Mapping[str, tuple[float, float]]:
    """Return joint -> (1, armature) of the joints of an MJCF file that state one themselves."""
    found: dict[str, tuple[float, float]] = {}
    for joint in _root(path).iter("joint"):
        name, armature = joint.get("name"), joint.get("armature")
        if name and armature:
            found[name] = (1.0, float(armature))
    return found


def _root(path: Path) -> ElementTree.Element:
    try:
        return ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError) as cause:
        raise RobotError(f"cannot read the model file '{path}': {cause}.") from cause
