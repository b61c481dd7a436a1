"""One of many designs as a robot of its own."""

from dataclasses import replace

import numpy as np

from wbc import Robot
from wbc.metrics import Designs
from wbc.metrics.designs import Stretching


def robot_at(designs: Designs, index: int) -> tuple[Robot, np.ndarray]:
    """Return one design as a robot, and its pose q (nq,)."""

    def pick(values: np.ndarray) -> np.ndarray:
        return values[0 if len(values) == 1 else index]

    robot, lengths = designs.robot, pick(designs.length_scale)
    gears = {name: pick(values) for name, values in designs.gears.items()}
    model = robot.model.copy()
    Stretching(model, range(len(model.frames))).to(lengths, pick(designs.mass_scale))
    places = [(contact, robot.contact_place(contact)[0]) for contact in robot.contacts]
    contacts = [
        replace(contact, offset=contact.offset * (lengths[joint - 1] if joint else 1.0))
        for contact, joint in places
    ]
    one = replace(robot, model=model, contacts=contacts, source=None)
    return one.with_transmission(robot.transmission.replace(**gears)), pick(designs.position)
