"""A humanoid that steps: footholds and a capture point planned ahead, a swing foot, a base task.

The centre of pressure goes in straight lines from sole to sole while both feet stand, and rests
in a sole while one does. The capture point that fits to it follows backwards in time, because it
is stable that way (Englsberger, Ott & Albu-Schaeffer 2015); `CapturePointTask` follows it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from math import exp, sqrt

import numpy as np
import pinocchio as pin

from sims.legged import feet
from wbc import Robot
from wbc.arrays import FloatArray
from wbc.control import (
    CapturePointTask,
    CenterOfMassTask,
    Command,
    ContactRamp,
    Controller,
    FrameOrientationTask,
    FramePositionTask,
    PostureTask,
    Reference,
    State,
)
from wbc.design.trotter import hump, minimum_jerk

SIDES = ("left", "right")
TRUNK, PELVIS = "torso_2_link", "base_link"
_START = 0.5  # [s] of standing before the weight goes to the first sole
_SINGLE = 0.6  # [s] that one foot stands
_DOUBLE = 0.3  # [s] that both do
_CLEARANCE = 0.05  # [m] of a swing
_EARLY = 0.7  # share of a swing after which a foot that touches stands
_DOWN = 0.1  # [m/s] at which a foot that is late goes on down
_STIFFNESS = 5.0  # [1/s] with which the capture point follows the plan
_REACH = np.array([0.3, 0.2])  # [m] that a foothold may move, ahead or back and outwards
_INWARDS = 0.03  # [m] that it may move towards the other foot
_TOUCH = 1e-3  # [m] above the ground within which a corner of a sole counts as touching


@dataclass(frozen=True)
class Plan:
    """Footholds and the capture point that fits to them.

    Attributes:
        holds: (k + 1, 2, 2) [m], where the left and the right sole stand after every step.
        point: (n, 2) [m], the capture point at every tick; the last one is kept.
        rate: (n, 2) [m/s], its velocity.
    """

    holds: FloatArray
    point: FloatArray
    rate: FloatArray


def planned(soles: FloatArray, steps: int, length: float, pole: float, tick: float) -> Plan:
    """Return the plan of `steps` steps, the left foot first.

    Args:
        soles: (2, 2) [m], x and y of the left and the right sole.
        steps: number of steps.
        length: [m] that every step leads ahead of the standing foot; the last one closes up.
        pole: sqrt(g/h) [1/s].
        tick: [s].
    """
    holds = [soles]
    for step in range(steps):
        ahead = soles.copy()
        ahead[:, 0] += length * (step + 1 if step + 1 < steps else step)
        hold = holds[-1].copy()
        hold[step % 2] = ahead[step % 2]
        holds.append(hold)
    middle, rests = soles.mean(axis=0), [holds[k][1 - k % 2] for k in range(steps)]
    stops = [middle, *rests, holds[-1].mean(axis=0)]
    pressure = [np.tile(middle, (round(_START / tick), 1))]
    for before, after in pairwise(stops):
        share = np.linspace(0.0, 1.0, round(_DOUBLE / tick), endpoint=False)[:, None]
        pressure += [before + share * (after - before), np.tile(after, (round(_SINGLE / tick), 1))]
    center = np.concatenate(pressure)
    point, shrink = center.copy(), exp(-pole * tick)
    for k in range(len(center) - 2, -1, -1):
        point[k] = center[k] + shrink * (point[k + 1] - center[k])
    return Plan(np.array(holds), point, pole * (point - center))


@dataclass
class Stepper:
    """The loop's controller for steps of TALOS along x.

    Attributes:
        model: robot model that the controller obeys.
        pose: q (nq,) in which it stands with both soles side by side.
        steps: number of steps, the left foot first.
        length: [m] of a step; 0 on the spot.
        tick: time between two calls [s].
        adjusts: whether footholds answer to an error of the capture point that a sole cannot hold.
    """

    model: Robot
    pose: FloatArray
    steps: int = 4
    length: float = 0.0
    tick: float = 1e-3
    adjusts: bool = True
    commands: list[Command] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Make the plan, the tasks and the controller."""
        self._data = self.model.model.createData()
        soles = feet(self.model)
        corner = {c.name: c for c in self.model.contacts}
        names = {s: [n for n in corner if n.startswith(s)] for s in SIDES}
        self._corners = {s: np.array([corner[n].offset for n in names[s]]) for s in SIDES}
        self._frame = {s: self.model.model.getFrameId(corner[names[s][0]].frame) for s in SIDES}
        self._read(self.pose, np.zeros(self.model.model.nv))
        center = np.array(self._data.com[0])
        self._height = center[2:]
        self._pole = sqrt(9.81 / center[2])
        self._middle = np.array([self._corners[s].mean(axis=0) for s in SIDES])
        places = np.array([self._sole(s).mean(axis=0)[:2] for s in SIDES])
        self._level = float(self._data.oMf[self._frame["left"]].translation[2])
        self.plan = planned(places, self.steps, self.length, self._pole, self.tick)
        weight = 9.81 * pin.computeTotalMass(self.model.model)
        self._ramp = ContactRamp(list(SIDES), 1.5 * weight, _DOUBLE)
        frames = {s: corner[names[s][0]].frame for s in SIDES}
        tasks = [
            CapturePointTask(weight=100.0, stiffness=_STIFFNESS, height=float(center[2])),
            CenterOfMassTask(name="height", axes="z", weight=100.0, stiffness=100.0),
            FrameOrientationTask(name="trunk", frame=TRUNK, weight=10.0, stiffness=100.0),
            FrameOrientationTask(name="pelvis", frame=PELVIS, weight=10.0, stiffness=100.0),
            *[
                FramePositionTask(name=s, frame=frames[s], weight=100.0, stiffness=900.0)
                for s in SIDES
            ],
            *[
                FrameOrientationTask(
                    name=f"{s} level", frame=frames[s], weight=30.0, stiffness=900.0
                )
                for s in SIDES
            ],
            PostureTask.of(self.model, weight=0.1, stiffness=50.0),
        ]
        self._controller = Controller(self.model, tasks, soles)
        self._starts: dict[str, FloatArray] = {}
        self._time, self.done = 0.0, 0
        corners = self._corners["left"][:, :2]
        half = 0.5 * (corners.max(axis=0) - corners.min(axis=0))
        self._held = half / (1.0 + _STIFFNESS / self._pole)
        self._moved, self._aside = np.zeros(2), np.zeros(2)  # of the whole plan, of this step

    def __call__(self, state: State) -> FloatArray:
        """Return the rotor torque for a state, one tick after the last call."""
        self._read(state.position, state.velocity)
        standing, swinging, share = self._phases()
        now = min(round(self._time / self.tick), len(self.plan.point) - 1)
        if swinging is not None and share <= 1.0 and self.adjusts:
            self._aside = self._answer(swinging, now, (1.0 - share) * _SINGLE)
        references = {
            "capture_point": Reference(self.plan.point[now] + self._moved, self.plan.rate[now]),
            "height": Reference(self._height),
            "trunk": Reference(np.eye(3)),
            "pelvis": Reference(np.eye(3)),
        }
        if swinging is not None:
            references[swinging] = self._swing(swinging, share)
            references[f"{swinging} level"] = Reference(np.eye(3))
        on = {name: float(s == swinging) for s in SIDES for name in (s, f"{s} level")}
        ceilings = self._ramp.step(standing, self.tick)
        if swinging is not None:
            ceilings = {s: c for s, c in ceilings.items() if s != swinging}
        command = self._controller.step(state, references, ceilings, activation=on)
        self.commands.append(command)
        self._time += self.tick
        return command.rotor_torque

    def point_error(self) -> FloatArray:
        """Return the capture point less the planned one (2,) [m] at the last call's state."""
        return self._error(min(round(self._time / self.tick) - 1, len(self.plan.point) - 1))

    def _error(self, now: int) -> FloatArray:
        point = self._data.com[0][:2] + self._data.vcom[0][:2] / self._pole
        return np.array(point - self.plan.point[now] - self._moved)

    def _answer(self, side: str, now: int, left: float) -> FloatArray:
        """Return how far the foothold moves, (2,) [m], with `left` [s] of the swing to go.

        Against an error e of the capture point the task moves the centre of pressure by
        e (1 + stiffness / pole), at most by half the sole: it takes back errors up to d. What is
        beyond grows, to (e - d) exp(pole left) when the foot lands, and that is where it lands.
        """
        error = self._error(now)
        beyond = np.sign(error) * np.maximum(np.abs(error) - self._held, 0.0)
        moved = np.clip(beyond * exp(self._pole * left), -_REACH, _REACH)
        inwards = -1.0 if side == "left" else 1.0
        if moved[1] * inwards > _INWARDS:
            moved[1] = inwards * _INWARDS
        return np.asarray(moved)

    def _read(self, q: FloatArray, v: FloatArray) -> None:
        pin.centerOfMass(self.model.model, self._data, q, v)
        pin.updateFramePlacements(self.model.model, self._data)

    def _sole(self, side: str) -> FloatArray:
        """Return where the corners of a sole are (4, 3) [m]."""
        place = self._data.oMf[self._frame[side]]
        return np.array([place.act(corner) for corner in self._corners[side]])

    def _phases(self) -> tuple[set[str], str | None, float]:
        """Return the feet that shall bear, the one in the air and the share of its swing.

        A foot gives off its load while both stand. It lifts when it bears none.
        """
        clock = self._time - _START
        step = int(clock // (_SINGLE + _DOUBLE))
        if self._starts:
            step = self.done  # also when the foot is late
        within = clock - step * (_SINGLE + _DOUBLE)
        if clock < 0.0 or step >= self.steps or self.done > step:
            return set(SIDES), None, 0.0
        side = SIDES[step % 2]
        rest = {SIDES[1 - step % 2]}
        if within < _DOUBLE:
            return rest, None, 0.0
        share = (within - _DOUBLE) / _SINGLE
        if side not in self._starts:
            self._starts = {side: np.array(self._data.oMf[self._frame[side]].translation)}
        if share > _EARLY and self._sole(side)[:, 2].min() < _TOUCH:
            self.done, self._starts = step + 1, {}
            self._moved, self._aside = self._moved + self._aside, np.zeros(2)
            return set(SIDES), None, 0.0
        return rest, side, share

    def _swing(self, side: str, share: float) -> Reference:
        """Return where a foot in the air should be."""
        start, index = self._starts[side], SIDES.index(side)
        hold = self.plan.holds[self.done + 1][index] + self._moved + self._aside
        hold = hold - self._middle[index][:2]
        end = np.array([*hold, self._level])
        if share > 1.0:
            down = np.array([0.0, 0.0, _DOWN])
            return Reference(end - (share - 1.0) * _SINGLE * down, -down)
        path, slope, bend = minimum_jerk(share)
        rise, climb, curve = hump(share)
        way, up = end - start, np.array([0.0, 0.0, _CLEARANCE])
        return Reference(
            start + path * way + rise * up,
            (slope * way + climb * up) / _SINGLE,
            (bend * way + curve * up) / _SINGLE**2,
        )
