"""`wbc metrics`, `export` and `list`: the commands that need no logs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
        way = "add [[contacts]] to its description, or name a frame: --contact "
        raise RobotError(f"'{robot.name}' has no contact; {way}{robot.model.frames[-1].name}.")
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
    items = [item.partition("=") for item in text.split(",")]
    try:
        return robot.configuration(**{name.strip(): float(value) for name, _, value in items})
    except ValueError as cause:
        raise RobotError(f"--pose: '{text}' is not JOINT=VALUE [rad, m].") from cause


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
        write_figures(options, {f"{robot.name}_leg": draw}, console)
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
    lines = []
    for joint, value in values.items():
        over = metric.name.startswith("holding") and value > limits[joint]
        limit = f" (above its limit {limits[joint]:.4g})" if over else ""
        lines += [f"{_entry(value)}  {joint}{limit}"] if value != 0.0 else []
    if rest := len(values) - len(lines):
        others = "all others" if rest > 1 else "the other one"
        lines.append(f"{0:9d}  {others if lines else 'every gear'}")
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
    heads, rows = _LISTS[options.what]
    # The name is given to other commands: whole.
    table = TextTable(tuple(heads.replace("|", "|~").split("|")), tuple(rows()), whole=True)
    console.print(table)
    return 0, {options.what: [dict(zip(table.names, row, strict=True)) for row in table.cells]}


Rows = Sequence[tuple[str, ...]]


def _robots() -> Rows:
    rows = []
    for name in robot_names():
        try:
            robot = load_robot(name)
            joints = ", ".join(robot.transmission.joints)
            contacts = ", ".join(contact.name for contact in robot.contacts)
        except WbcError as error:
            joints, contacts = f"not available: {error}", ""
        rows.append((name, joints, contacts))
    return rows


def _effects() -> Rows:
    parameters = {n: [f"{p.name} [{p.unit}]" for p in one.parameters] for n, one in EFFECTS.items()}
    return [(n, one.explanation, ", ".join(parameters[n])) for n, one in EFFECTS.items()]


def _gearboxes() -> Rows:
    from wbc.design import read_gearboxes

    rows = []
    for box in read_gearboxes().values():
        known = (box.reduction, box.forward_efficiency, box.backward_efficiency, box.gear_inertia)
        n, forth, back, inertia = ("?" if value is None else f"{value:g}" for value in known)
        rows.append((box.name, box.kind, n, f"{forth}, {back}", inertia, box.source))
    return rows


# What there is a list of -> its columns, and what returns the rows.
_LISTS: dict[str, tuple[str, Callable[[], Rows]]] = {
    "robots": ("robot|driven joints|contacts", _robots),
    "effects": ("effect|what it is|parameters", _effects),
    "gearboxes": ("gearbox|kind|reduction|efficiencies|kg m^2|source", _gearboxes),
}
