"""Many designs of one robot: gears, link lengths, link masses and poses that vary together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray, checked, frozen
from wbc.errors import DynamicsError, TransmissionError, require_known
from wbc.robot import Robot
from wbc.transmission import GEAR_NUMBERS, wedge_backward_efficiency

GEAR_FIELDS = (
    "gear_ratio",
    "rotor_inertia",
    "forward_efficiency",
    "backward_efficiency",
    "rotor_coulomb_friction",
    "torque_limit",
)


@dataclass(frozen=True, eq=False)
class Designs:
    """k designs of one robot. Arrays have a leading axis of k, or of 1 where nothing varies.

    Attributes:
        robot: the robot that the designs start from.
        size: k.
        position: q (k or 1, nq).
        gears: the fields of `GEAR_FIELDS`, each (k or 1, m).
        length_scale: (k or 1, joints) length of each joint's link over that of `robot`. The whole
            link is stretched alike at the same mass: places on it grow with the scale, its
            inertia about the centre of mass with the square of it.
        mass_scale: (k or 1, joints) mass of each link over that of `robot`; its inertia grows
            with it.
    """

    robot: Robot
    size: int
    position: FloatArray
    gears: Mapping[str, FloatArray]
    length_scale: FloatArray
    mass_scale: FloatArray

    @classmethod
    def of(
        cls,
        robot: Robot,
        position: ArrayLike,
        gears: Mapping[str, ArrayLike] | None = None,
        lengths: Mapping[str, ArrayLike] | None = None,
        masses: Mapping[str, ArrayLike] | None = None,
    ) -> Designs:
        """Return designs from what varies; what is left out stays as in `robot`.

        Args:
            robot: the robot that the designs start from.
            position: q (nq,) for all or (k, nq).
            gears: field of `GEAR_FIELDS` -> (k,) for all gears alike, or (k, m). Without
                `backward_efficiency`, a given `forward_efficiency` brings the wedge's 2 - 1/eta_f.
            lengths: link -> (k,) [m], from its joint to the furthest joint or contact on it.
            masses: link -> (k,) [kg].

        Raises:
            DynamicsError: different numbers of designs, an unknown field or link, a link without
                length or mass.
            TransmissionError: a number of a gear outside its range.
        """
        q = checked(np.atleast_2d(position), (None, robot.model.nq), "position", DynamicsError)
        given = _gears(robot, gears or {})
        length_scale = _scales(robot, lengths or {}, "length")
        mass_scale = _scales(robot, masses or {}, "mass")
        arrays = [q, length_scale, mass_scale, *given.values()]
        sizes = {len(a) for a in arrays} - {1}
        if len(sizes) > 1:
            raise DynamicsError(
                f"designs: arrays of {', '.join(map(str, sorted(sizes)))} designs cannot be "
                "combined; give every varied quantity the same number of values."
            )
        full = {
            name: given.get(name, np.array(getattr(robot.transmission, name))[None])
            for name in GEAR_FIELDS
        }
        _check_gears(full)
        size = sizes.pop() if sizes else 1
        return cls(robot, size, q, full, length_scale, mass_scale)

    def part(self, start: int, stop: int) -> Designs:
        """Return the designs from `start` to before `stop`."""

        def cut(values: FloatArray) -> FloatArray:
            return values if len(values) == 1 else values[start:stop]

        return Designs(
            self.robot,
            min(stop, self.size) - start,
            cut(self.position),
            {name: cut(values) for name, values in self.gears.items()},
            cut(self.length_scale),
            cut(self.mass_scale),
        )


def link_length(robot: Robot, body: str) -> float:
    """Return the length [m] of a link: from its joint to the furthest joint or contact on it.

    Raises:
        RobotError: no such link.
        DynamicsError: nothing is mounted away from the link's joint.
    """
    places = robot.ends(robot.body_joint(body))
    length = max((float(np.linalg.norm(place)) for place in places), default=0.0)
    if length == 0.0:
        raise DynamicsError(
            f"the link '{body}' of '{robot.name}' has no length: no joint and no contact sits "
            "away from its own joint."
        )
    return length


class Stretching:
    """Changes a model's links in place, each time from how they are drawn.

    `Designs` says what a scale means. Frames move with the links that carry them.
    """

    def __init__(self, model: pin.Model, frames: Iterable[int]) -> None:
        """Keep the links of `model` as they are now, and the frames that shall move with them."""
        joints = range(model.njoints)
        self._bodies = [
            (body, body.mass, np.array(body.lever), np.array(body.inertia))
            for body in model.inertias
        ]
        self._places: list[list[tuple[pin.SE3, FloatArray]]] = [[] for _ in joints]
        for child in joints[1:]:
            place = model.jointPlacements[child]
            self._places[model.parents[child]].append((place, np.array(place.translation)))
        for frame in (model.frames[number] for number in frames):
            place = frame.placement
            self._places[frame.parentJoint].append((place, np.array(place.translation)))
        self._now = [(1.0, 1.0)] * model.njoints

    def to(self, length_scale: FloatArray, mass_scale: FloatArray) -> None:
        """Give each link its scales (joints,), one per moving joint."""
        pairs = zip(length_scale.tolist(), mass_scale.tolist(), strict=True)
        for joint, (scale, share) in enumerate(pairs, start=1):
            before, self._now[joint] = self._now[joint], (scale, share)
            if before == (scale, share):
                continue
            body, mass, lever, inertia = self._bodies[joint]
            body.mass, body.lever = mass * share, scale * lever
            body.inertia = share * scale**2 * inertia
            for place, drawn in self._places[joint]:
                place.translation = scale * drawn


def _gears(robot: Robot, gears: Mapping[str, ArrayLike]) -> dict[str, FloatArray]:
    m, found = robot.transmission.size, {}
    for name, values in gears.items():
        require_known(DynamicsError, "gear parameter", name, GEAR_FIELDS)
        array = np.asarray(values, dtype=np.float64)
        wide = np.repeat(array[:, None], m, axis=1) if array.ndim == 1 else array
        if wide.ndim != 2 or wide.shape[1] != m or np.isnan(wide).any():
            raise DynamicsError(
                f"{name} has shape {array.shape}; give (k,) or (k, {m}) numbers, none of them NaN."
            )
        found[name] = frozen(wide)
    if "forward_efficiency" in found and "backward_efficiency" not in found:
        found["backward_efficiency"] = frozen(
            wedge_backward_efficiency(found["forward_efficiency"])
        )
    return found


def _check_gears(gears: Mapping[str, FloatArray]) -> None:
    for name, values in gears.items():
        for holds, rule in GEAR_NUMBERS[name].rules:
            wrong = np.argwhere(~holds(values))
            if len(wrong):
                row, column = (int(i) for i in wrong[0])
                raise TransmissionError(
                    f"{name} of design {row}, gear {column} is {values[row, column]:g}; it must be "
                    f"{rule}."
                )


def _scales(robot: Robot, given: Mapping[str, ArrayLike], what: str) -> FloatArray:
    scales = np.ones((1, robot.model.njoints - 1))
    for body, values in given.items():
        joint = robot.body_joint(body)
        array = checked(np.atleast_1d(values), (None,), f"{what} of '{body}'", DynamicsError)
        now = link_length(robot, body) if what == "length" else robot.model.inertias[joint].mass
        if now <= 0.0 or np.any(array <= 0.0):
            raise DynamicsError(f"the {what} of '{body}' must be > 0, before and after.")
        if len(array) > len(scales):
            scales = np.repeat(scales, len(array), axis=0)
        scales[:, joint - 1] = array / now
    return frozen(scales)
