"""`wbc metrics`, `export` and `list`: the commands that need no logs."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console

from wbc.arrays import FloatArray
from wbc.cli.outputs import Options, Outcome, require_outputs, write_figures
from wbc.effects import EFFECTS, load_robot
from wbc.errors import RobotError, ViewError, WbcError
from wbc.files import as_json
from wbc.robot import Robot, robot_names
from wbc.tables import TextTable

if TYPE_CHECKING:
    from wbc.metrics import Metric


def first_contact(robot: Robot) -> str:
    """Return the name of the robot's first contact.

    Raises:
        RobotError: a robot without contacts.
    """
    if not robot.contacts:
        raise RobotError(
            f"'{robot.name}' has no contact; add [[contacts]] to its description, or name a frame: "
            f"--contact {robot.model.frames[-1].name}."
        )
    return robot.contacts[0].name


def pose_from(robot: Robot, text: str | None) -> FloatArray:
    """Return the pose q (nq,) of `NAME`, of `JOINT=VALUE,...`, or the robot's usual one
    (the neutral one of a robot without poses).

    Raises:
        RobotError: an unknown pose or joint, or text of another form.
    """
    if text is None and not robot.poses:
        return robot.neutral()
    if text is None or "=" not in text:
        return robot.pose(text)
    joints: dict[str, float] = {}
    for item in text.split(","):
        name, _, value = item.partition("=")
        try:
            joints[name.strip()] = float(value)
        except ValueError as cause:
            raise RobotError(f"--pose: '{item}' is not JOINT=VALUE [rad, m].") from cause
    return robot.configuration(**joints)


def run_metrics(options: Options, console: Console) -> Outcome:
    """Print what the gears do to inertia, force capability and impacts; write figures and JSON."""
    from wbc.metrics import summary, with_contact_at

    if options.figures and len(options.axes) != 2:
        raise ViewError(f"--figures are drawn in two axes, not in '{options.axes}'.")
    robot = load_robot(options.robot)
    contact = options.contact or first_contact(robot)
    robot = with_contact_at(robot, contact)
    q = pose_from(robot, options.pose)
    found = summary(robot, q, contact, options.axes, options.load)
    notes = list(dict.fromkeys(metric.assumption for metric in found))
    cells = [(_label(m), _told(m, robot), str(notes.index(m.assumption) + 1)) for m in found]
    title = f"{robot.name}, contact {contact}"
    console.print(TextTable.of("metric|value|assumes", cells, title))
    numbered = [(str(number), note) for number, note in enumerate(notes, 1)]
    console.print(TextTable.of("|what the numbers assume", numbered))
    content = {_label(metric): _by_joint(metric) for metric in found}
    content["assumptions"] = {_label(metric): metric.assumption for metric in found}
    if options.figures:
        from wbc.view.plots import leg_figure

        draw = partial(leg_figure, robot, q, contact, axes=options.axes)
        write_figures(options, {f"{options.figures}/{robot.name}_leg.png": draw}, console)
    return 0, content


def _label(metric: Metric) -> str:
    return metric.name if metric.unit == "1" else f"{metric.name} [{metric.unit}]"


def _by_joint(metric: Metric) -> Any:
    """Return the value, of a vector with an entry per gear the one of each joint."""
    plain = as_json(metric.value, "unlimited")
    return dict(zip(metric.joints, plain, strict=True)) if metric.joints else plain


def _told(metric: Metric, robot: Robot) -> str:
    """Return a value as text."""
    plain = _by_joint(metric)
    if isinstance(plain, dict):
        return _by_gear(metric, plain, robot)
    if plain is None:
        gears, needed = robot.transmission, ("torque_constant", "resistance")
        lacking = [name for name in needed if np.isnan(getattr(gears, name)).any()]
        named = " and the ".join(lacking).replace("_", " ")
        return f"unknown: robot.toml lacks the {named} of a motor"
    if isinstance(plain, list):
        rows = plain if plain and isinstance(plain[0], list) else [plain]
        return "\n".join("  ".join(_entry(x) for x in row) for row in rows)
    return plain if isinstance(plain, str) else f"{plain:.6g}"


def _by_gear(metric: Metric, values: dict[str, Any], robot: Robot) -> str:
    """Return the value of each gear that has one, and which torques are above their limit."""
    limits = dict(zip(robot.transmission.joints, robot.transmission.torque_limit, strict=True))
    held, lines = {joint: value for joint, value in values.items() if value != 0.0}, []
    for joint, value in held.items():
        over = metric.name.startswith("holding") and value > limits[joint]
        limit = f" (above its limit {limits[joint]:.4g})" if over else ""
        lines.append(f"{_entry(value)}  {joint}{limit}")
    if rest := len(values) - len(held):
        others = "all others" if held else "every gear"
        lines.append(f"{0:9d}  {others if rest > 1 or not held else 'the other one'}")
    return "\n".join(lines)


def _entry(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:9.4f}"


def run_export(options: Options, console: Console) -> Outcome:
    """Write the robot as a file of another simulator, and print what is not in it."""
    from wbc.export import export_robot, losses_path

    robot = load_robot(options.robot)
    options.file = options.file or f"{robot.name}.xml"
    if Path(options.file).suffix.lower() != ".xml":
        raise WbcError(f"--file '{options.file}': MJCF wants a name that ends in .xml.")
    require_outputs(options, ["--file", "--json"])
    exported = export_robot(robot, options.to)
    path = exported.write(options.file)
    unsaid = f"{options.to} cannot say:"
    for title, texts in (("set by hand:", exported.notes), (unsaid, exported.unsaid)):
        if texts:
            console.print("\n  - ".join((title, *texts)))
    console.print(f"wrote {path}: links, joints and motors; shapes and pictures are not in it")
    content = dict[str, Any](file=str(path), notes=exported.notes, unsaid=exported.unsaid)
    if exported.losses is not None:
        content["losses"] = str(losses_path(path))
        console.print(f"wrote {losses_path(path)}: the losses of the gears, to call in every step")
    return 0, content


def run_list(options: Options, console: Console) -> Outcome:
    """Print the robots, effects or gearboxes there are."""
    rows = {"robots": _robots, "effects": _effects, "gearboxes": _gearboxes}[options.what]()
    name, *others = rows[0]
    heads = (name, *(f"~{other}" for other in others))  # the name is given to other commands: whole
    cells = tuple(tuple(row.values()) for row in rows)
    console.print(TextTable(heads, cells, whole=True))
    return 0, {options.what: rows}


def _robots() -> list[dict[str, str]]:
    rows = []
    for name in robot_names():
        try:
            robot = load_robot(name)
            joints = ", ".join(robot.transmission.joints)
            contacts = ", ".join(contact.name for contact in robot.contacts)
        except WbcError as error:
            joints, contacts = f"not available: {error}", ""
        rows.append({"robot": name, "driven joints": joints, "contacts": contacts})
    return rows


def _effects() -> list[dict[str, str]]:
    return [
        {
            "effect": name,
            "what it is": effect.explanation,
            "parameters": ", ".join(f"{p.name} [{p.unit}]" for p in effect.parameters),
        }
        for name, effect in EFFECTS.items()
    ]


def _gearboxes() -> list[dict[str, str]]:
    from wbc.design import read_gearboxes

    def number(value: float | None) -> str:
        return "?" if value is None else f"{value:g}"

    return [
        {
            "gearbox": box.name,
            "kind": box.kind,
            "reduction": number(box.reduction),
            "efficiencies": f"{number(box.forward_efficiency)}, {number(box.backward_efficiency)}",
            "kg m^2": number(box.gear_inertia),
            "source": box.source,
        }
        for box in read_gearboxes().values()
    ]
