"""Inertia, force capability, impact mitigation and holding of many designs at once.

The same formulas as the metrics of one robot, with the designs as the leading axis of every array;
`tests/metrics` holds both to be equal up to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import BoolArray, FloatArray, IntArray, checked
from wbc.errors import DynamicsError, unknown_name
from wbc.metrics.designs import Designs
from wbc.metrics.links import LinkTerms, link_terms

_NOTHING = 1e-9  # the share of the largest lever below which a gear bears nothing, as for one robot
_LOCKED = 1e-12  # the share of the conservative mobility below which there is none
_BLOCK = 4096  # designs per block: the arrays of a block stay in the processor's cache


@dataclass(frozen=True, eq=False)
class DesignMetrics:
    """The metrics of k designs along one direction at one contact, each (k,).

    Infinite means that nothing limits the number; NaN that it does not exist for the design.

    Attributes:
        inertia: 1/(n' Lambda^-1 n) [kg] with perfect gears.
        backward_inertia: the same, every gear driven by its joint [kg].
        forward_inertia: the same, every gear driven by its motor [kg]; NaN on a floating base.
        conventional: force [N] with perfect gears at the motors' limits.
        lift: force [N] that the motors can raise.
        hold: force [N] that they can resist.
        backdriving_force: force [N] that sets the unpowered robot in motion.
        impact_mitigation: 0 to 1, losses counted; NaN where the point cannot give way.
        impact_mitigation_lossless: the same with perfect gears.
        impact_mitigation_determinant: det of the factor's matrix over all axes, losses counted.
        holding_torque: root of the sum of squares [N m] of the least rotor torques that hold
            `load` along the direction.
        holding_torque_lossless: the same with perfect gears.
        heat_saved: share, 0 to 1, of the Joule heat of holding that stiction saves.
    """

    inertia: FloatArray
    backward_inertia: FloatArray
    forward_inertia: FloatArray
    conventional: FloatArray
    lift: FloatArray
    hold: FloatArray
    backdriving_force: FloatArray
    impact_mitigation: FloatArray
    impact_mitigation_lossless: FloatArray
    impact_mitigation_determinant: FloatArray
    holding_torque: FloatArray
    holding_torque_lossless: FloatArray
    heat_saved: FloatArray

    def columns(self) -> dict[str, FloatArray]:
        """Return the metrics by name, for a table."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


def design_metrics(
    designs: Designs,
    contact: str,
    direction: ArrayLike,
    axes: str = "xyz",
    load: float | None = None,
) -> DesignMetrics:
    """Return the metrics of every design at one contact point.

    Args:
        designs: k designs of one robot.
        contact: name of the contact point.
        direction: (n,) along `axes`.
        axes: world axes, each at most once, for example "xz".
        load: force [N] to hold along the direction; each design's own weight when left out.

    Raises:
        DynamicsError: axes that do not exist, a direction of zero.
        RobotError: no such contact.
    """
    rows, n = _direction(direction, axes)
    designs.robot.contact(contact)
    blocks = [
        _block(designs.part(start, start + _BLOCK), contact, rows, n, load)
        for start in range(0, designs.size, _BLOCK)
    ]
    names = [field.name for field in fields(DesignMetrics)]
    return DesignMetrics(**{name: np.concatenate([b[name] for b in blocks]) for name in names})


def held_torques(
    designs: Designs, contact: str, direction: ArrayLike, axes: str, load: float | None
) -> FloatArray:
    """Return the torque (k, m) [N m] after each gear of every design that holds a load at rest.

    Args:
        designs, contact, direction, axes, load: as in `design_metrics`.

    Raises:
        DynamicsError: axes that do not exist, a direction of zero.
        RobotError: no such contact.
    """
    rows, n = _direction(direction, axes)
    terms = link_terms(designs, contact)
    lever = np.swapaxes(_levers(designs, terms.jacobian[:, rows]), 1, 2) @ n
    torque = lever * _held_force(designs, terms, load)[:, None]
    return np.array(np.broadcast_to(torque, (designs.size, torque.shape[1])))


def _levers(designs: Designs, jacobian: FloatArray) -> FloatArray:
    """Return J_m D (k or 1, n, m): gear torques per force, transposed."""
    robot = designs.robot
    return np.asarray(jacobian[:, :, robot.actuated] @ robot.transmission.topology)


def _held_force(designs: Designs, terms: LinkTerms, load: float | None) -> FloatArray:
    if load is not None:
        return np.full(1, load)
    field = -np.asarray(designs.robot.model.gravity.linear)
    return np.asarray(terms.mass * float(np.linalg.norm(field)))


def _direction(direction: ArrayLike, axes: str) -> tuple[list[int], FloatArray]:
    if not axes or len(set(axes)) != len(axes):
        raise DynamicsError(f"axes '{axes}': name each of x, y, z at most once, at least one.")
    for axis in axes:
        if axis not in "xyz":
            raise DynamicsError(unknown_name("axis", axis, "xyz"))
    vector = checked(direction, (len(axes),), "direction", DynamicsError)
    length = float(np.linalg.norm(vector))
    if length == 0.0:
        raise DynamicsError(f"direction along {axes} must not be zero.")
    return ["xyz".index(axis) for axis in axes], vector / length


def _block(
    designs: Designs, contact: str, rows: list[int], n: FloatArray, load: float | None
) -> dict[str, FloatArray]:
    k, robot = designs.size, designs.robot
    terms = link_terms(designs, contact)
    jacobian = terms.jacobian[:, rows]
    backward = np.broadcast_to(designs.gears["backward_efficiency"], (k, robot.transmission.size))
    free = _mobility(designs, terms, jacobian, jacobian, np.ones((1, 1)))
    driven = _backward_mobility(designs, terms, jacobian, backward)
    found = {
        "inertia": _inertia_along(free, n),
        "backward_inertia": _inertia_along(driven, n, free),
        "forward_inertia": _forward_inertia(designs, terms, jacobian, n),
        **_mitigation(designs, terms, jacobian, free, driven, n),
        **_forces(designs, terms, jacobian, n, load),
    }
    return {name: np.array(np.broadcast_to(values, (k,))) for name, values in found.items()}


def _reflected(designs: Designs) -> FloatArray:
    return designs.gears["gear_ratio"] ** 2 * designs.gears["rotor_inertia"]


def _select(designs: Designs) -> FloatArray:
    """Return W (m, nv): motor output speeds from v."""
    robot = designs.robot
    select = np.zeros((robot.transmission.size, robot.model.nv))
    select[:, robot.actuated] = robot.transmission.motor_from_joint
    return select


def _mobility(
    designs: Designs,
    terms: LinkTerms,
    jacobian: FloatArray,
    effect: FloatArray,
    eta: FloatArray,
    free: FloatArray | None = None,
) -> FloatArray:
    """Return J H^-1 F' (k, n, n), H with each rotor counted eta times.

    Args:
        designs: the designs.
        terms: of their links.
        jacobian: J (k or 1, n, nv).
        effect: F (k or 1, n, nv), joint-space forces per unit of task force.
        eta: (k or 1, m or 1).
        free: (nv, f) basis of the velocities that are left, all when left out.
    """
    select = _select(designs)
    rotors = np.swapaxes(select[None] * (eta * _reflected(designs))[:, :, None], 1, 2) @ select
    inertia = terms.mass_matrix + rotors
    if terms.spin is not None:  # K' E_s H_s K with the rotor rows I_r a'J_omega of H_s
        coupled = terms.spin * designs.gears["rotor_inertia"][:, :, None]
        turned = designs.gears["gear_ratio"][:, :, None] * select
        inertia = inertia + np.swapaxes(coupled, 1, 2) @ turned
        inertia = inertia + np.swapaxes(eta[:, :, None] * turned, 1, 2) @ coupled
    if free is not None:
        if free.shape[1] == 0:
            return np.zeros((1, jacobian.shape[1], jacobian.shape[1]))
        inertia = free.T @ inertia @ free
        jacobian, effect = jacobian @ free, effect @ free
    if len(effect) < len(inertia):
        effect = np.broadcast_to(effect, (len(inertia), *effect.shape[1:]))
    return np.asarray(jacobian @ np.linalg.solve(inertia, np.swapaxes(effect, 1, 2)))


def _backward_mobility(
    designs: Designs, terms: LinkTerms, jacobian: FloatArray, backward: FloatArray
) -> FloatArray:
    """Return J H^-1 J' (k, n, n) with every gear driven by its joint; self-locking ones stand."""
    k, n = designs.size, jacobian.shape[1]
    locked = backward <= 0.0
    result = np.empty((k, n, n))
    for pattern in np.unique(locked, axis=0):
        members = np.flatnonzero((locked == pattern).all(axis=1))
        chosen = _take(designs, members)
        part = LinkTerms(
            _rows(terms.mass_matrix, members),
            terms.jacobian,
            terms.mass,
            None if terms.spin is None else _rows(terms.spin, members),
        )
        J = _rows(jacobian, members)
        eta = 1.0 / np.where(pattern, 1.0, backward[members])
        free = None
        if pattern.any():
            stuck = _select(designs)[pattern]
            free = np.linalg.svd(stuck)[2][len(stuck) :].T
        result[members] = _mobility(chosen, part, J, J, eta, free)
    return result


def _take(designs: Designs, members: IntArray) -> Designs:
    gears = {name: _rows(values, members) for name, values in designs.gears.items()}
    return Designs(
        designs.robot,
        len(members),
        _rows(designs.position, members),
        gears,
        _rows(designs.length_scale, members),
        _rows(designs.mass_scale, members),
    )


def _rows(values: FloatArray, members: IntArray) -> FloatArray:
    return values if len(values) == 1 else values[members]


def _inertia_along(
    mobility: FloatArray, n: FloatArray, reference: FloatArray | None = None
) -> FloatArray:
    along = np.einsum("i,kij,j->k", n, mobility, n)
    least = 0.0 if reference is None else _LOCKED * np.einsum("i,kij,j->k", n, reference, n)
    moves = along > least
    return np.asarray(np.where(moves, 1.0 / np.where(moves, along, 1.0), np.inf))


def _forward_inertia(
    designs: Designs, terms: LinkTerms, jacobian: FloatArray, n: FloatArray
) -> FloatArray:
    robot = designs.robot
    if robot.floating_size:
        return np.full(1, np.nan)
    # B E B^-1 = D^-T E D': the reductions cancel.
    forward = designs.gears["forward_efficiency"]
    inward = robot.transmission.motor_from_joint.T * forward[:, None, :]
    through = inward @ robot.transmission.topology.T
    effect = np.zeros((max(len(jacobian), len(through)), *jacobian.shape[1:]))
    effect[:, :, robot.actuated] = jacobian[:, :, robot.actuated] @ np.swapaxes(through, 1, 2)
    return _inertia_along(_mobility(designs, terms, jacobian, effect, forward), n)


def _mitigation(
    designs: Designs,
    terms: LinkTerms,
    jacobian: FloatArray,
    free: FloatArray,
    driven: FloatArray,
    n: FloatArray,
) -> dict[str, FloatArray]:
    rest = designs.robot.unactuated
    blocked = np.zeros((1, len(n), len(n)))
    if rest.size:
        base = terms.mass_matrix[:, rest[:, None], rest]
        across = jacobian[:, :, rest]
        base, across = _same(base, across)
        blocked = across @ np.linalg.solve(base, np.swapaxes(across, 1, 2))
    stiff = np.einsum("i,kij,j->k", n, blocked, n)
    give = np.einsum("i,kij,j->k", n, free, n)
    lossy = np.einsum("i,kij,j->k", n, driven, n)
    return {
        "impact_mitigation": _factor(stiff, lossy, _LOCKED * give),
        "impact_mitigation_lossless": _factor(stiff, give, np.zeros(1)),
        "impact_mitigation_determinant": _determinant(blocked, driven, free),
    }


def _factor(stiff: FloatArray, give: FloatArray, least: FloatArray) -> FloatArray:
    moves = give > least
    return np.asarray(np.where(moves, 1.0 - stiff / np.where(moves, give, 1.0), np.nan))


def _determinant(blocked: FloatArray, driven: FloatArray, free: FloatArray) -> FloatArray:
    """Return det(I - Lambda Lambda_L^-1), NaN in a singular pose."""
    regular = np.linalg.det(driven) > _LOCKED * np.abs(np.linalg.det(free))
    safe = np.where(regular[:, None, None], driven, np.eye(driven.shape[1]))
    matrix = np.eye(driven.shape[1]) - np.linalg.solve(*_same(safe, blocked))
    return np.asarray(np.where(regular, np.linalg.det(matrix), np.nan))


def _same(one: FloatArray, other: FloatArray) -> tuple[FloatArray, FloatArray]:
    k = max(len(one), len(other))
    return (
        np.broadcast_to(one, (k, *one.shape[1:])),
        np.broadcast_to(other, (k, *other.shape[1:])),
    )


def _forces(
    designs: Designs, terms: LinkTerms, jacobian: FloatArray, n: FloatArray, load: float | None
) -> dict[str, FloatArray]:
    gears = designs.gears
    forward, backward = gears["forward_efficiency"], gears["backward_efficiency"]
    ratio = np.abs(gears["gear_ratio"])
    matrix = np.swapaxes(_levers(designs, jacobian), 1, 2)
    lever = np.abs(matrix @ n)
    scale = np.abs(matrix).max(axis=(1, 2), initial=_NOTHING)
    loaded = lever > _NOTHING * scale[:, None]
    friction, limit = gears["rotor_coulomb_friction"], gears["torque_limit"]
    locked = backward <= 0.0
    safe = np.where(locked, 1.0, backward)
    held = np.where(locked, np.inf, ratio * (limit + friction) / safe)
    slack = np.where(locked, np.inf, ratio * friction / safe)
    raised = forward * ratio * np.maximum(limit - friction, 0.0)
    output = matrix @ n * _held_force(designs, terms, load)[:, None]
    perfect = np.abs(output) / ratio
    least = np.where(locked, 0.0, np.maximum(np.abs(output) * safe / ratio - friction, 0.0))
    copper = _copper(designs)
    spent, saved = (np.sum(copper * torque**2, axis=1) for torque in (perfect, least))
    return {
        "conventional": _least(ratio * limit, lever, loaded),
        "lift": _least(raised, lever, loaded),
        "hold": _least(held, lever, loaded),
        "backdriving_force": _least(slack, lever, loaded),
        "holding_torque": np.sqrt(np.sum(least**2, axis=1)),
        "holding_torque_lossless": np.sqrt(np.sum(perfect**2, axis=1)),
        "heat_saved": np.where(spent > 0.0, 1.0 - saved / np.where(spent > 0.0, spent, 1.0), 0.0),
    }


def _copper(designs: Designs) -> FloatArray:
    """Return heat per torque squared of each motor, alike for all where the robot names none."""
    heat = designs.robot.transmission.copper_loss
    return np.where(np.isfinite(heat).all(), heat, 1.0)


def _least(limits: FloatArray, lever: FloatArray, loaded: BoolArray) -> FloatArray:
    limits, lever = _same(limits, lever)
    loaded = np.broadcast_to(loaded, lever.shape)
    ends = np.where(loaded, limits / np.where(loaded, lever, 1.0), np.inf)
    return np.asarray(ends.min(axis=1))
