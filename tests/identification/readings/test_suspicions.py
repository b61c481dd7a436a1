"""Suspicions on recorded and simulated logs: none where the columns are right, named where not."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.outside import RECORDED, foreign, outside, recorded
from wbc.dynamics import link_torque
from wbc.effects import CoulombFriction, load_robot
from wbc.identification.readings import (
    SuspiciousLogError,
    evidence,
    find_suspicions,
    mistakes,
    suspicions,
)
from wbc.identification.readings.evidence import Judged, Report
from wbc.identification.readings.kinds import Reading
from wbc.identification.readings.mistakes import told_by_rows
from wbc.measurement import Log, load_logs, mended, together, write_map
from wbc.robot import Motion, Robot
from wbc.sim.excitation import record_with

LEG = load_robot("planar_leg_fixed").lossless()


def practice(case: str, letters: str) -> tuple[Log, ...]:
    return load_logs([outside(f"practice_leg/{case}{letter}.csv") for letter in letters])


@pytest.mark.parametrize(
    "case",
    [*((f"case{k:02d}", "ac", LEG) for k in range(11)),
     *((f"float{k:02d}", "ab", load_robot("planar_leg").lossless()) for k in range(4))],
    ids=str,
)  # fmt: skip
def test_no_hidden_effect_of_the_practice_leg_looks_like_a_wrong_column(
    case: tuple[str, str, Robot],
) -> None:
    name, letters, robot = case
    assert find_suspicions(practice(name, letters), robot) == [[], []]


@pytest.mark.parametrize("name", RECORDED)
def test_recorded_machines_are_not_suspected(name: str) -> None:
    """A servo that rests at zero holds no rows of a second publisher."""
    robot, logs = recorded(name)
    assert suspicions(robot, logs) == []


ARM = "strangers/11_duplicate_stamps"
JOINTS = ("yaw", "shoulder", "elbow")


Logs = tuple[Log, ...]
Arm = tuple[Robot, Logs]


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Arm:
    """A right arm of three joints with friction and rotors that its description lacks."""
    robot = load_robot(outside("strangers/14_missing_knee_ratio/robot.toml"))
    columns = tmp_path_factory.mktemp("map") / "columns.toml"
    columns.write_text('time.repeated = "spread"')
    return robot, load_logs([outside(f"{ARM}/run{k}.csv") for k in (1, 2, 3)], columns)


@pytest.fixture(scope="module")
def leg() -> tuple[Log, ...]:
    """Two runs of a leg whose hip rubs."""
    return record_with(LEG, [CoulombFriction("hip", 0.6)], duration=5.0)[:2]


@pytest.mark.parametrize("factor", [0.15, 0.4, 2.5, 7.0])
def test_wrong_torque_constants_are_no_wrong_side(leg: tuple[Log, ...], factor: float) -> None:
    weak = [mended(log, {"columns": {n: {"scale": factor} for n in _ROTORS}}) for log in leg]
    said = suspicions(LEG, weak)
    assert all("times what the links need" in text and "side" not in text for text in said)


def test_torque_sensors_that_report_alone_are_judged(leg: Logs) -> None:
    """Of a recorded arm nothing but its sensors is known: with other signs it was 27 times off."""
    behind, sensed = [f"{joint}.joint_torque" for joint in ("hip", "knee")], []
    for log in leg:
        columns = {name: values for name, values in log.columns.items() if name not in _ROTORS}
        pairs = zip(_ROTORS, LEG.transmission.gear_ratio, strict=True)
        torques = zip(behind, (ratio * log.column(name) for name, ratio in pairs), strict=True)
        sensed.append(replace(log, columns=columns | dict(torques)))
    robot = replace(LEG, sensor_only=("hip", "knee"))
    assert suspicions(robot, sensed) == []
    wrong = [mended(log, {"columns": {name: {"sign": -1} for name in behind}}) for log in sensed]
    for own in find_suspicions(wrong, robot):
        assert own[0].severity == "error"
        assert f"the signs of {' and '.join(behind)} are reversed" in own[0].text


_TORQUES = ("shoulder.motor_torque", "elbow.motor_torque")
_ROTORS, _MOTORS = (tuple(f"{j}.{q}_torque" for j in ("hip", "knee")) for q in ("rotor", "motor"))
_C1, _BOTH = "double_pendulum_c1", "of shoulder and elbow are exchanged"
_ARM_4 = "arm_4_joint.position"
_TURNS = "yaw.position, shoulder.position and elbow.position hold turns"
MISTAKES = [
    # A slide without gravity: friction of any size explained a thousand times the force.
    # A bare motor rubs as much beside what it moves: one log alone is no proof.
    ("emps", {"slide.motor_torque": {"scale": 1000}}, "warning", "slide.motor_torque holds mN"),
    # One log alone does not ask for it.
    (_C1, {a: {"from": b} for a, b in (_TORQUES, _TORQUES[::-1])}, "error", f"the torques {_BOTH}"),
    # Rivals explain such a torque without the links.
    (_C1, {_TORQUES[1]: {"sign": -1}}, "error", f"the sign of {_TORQUES[1]} is reversed"),
    ("arm", {"shoulder.position": {"offset": 0.5 * np.pi}}, "error", "the zero of shoulder.pos"),
    ("arm", {"shoulder.position": {"offset": np.pi}}, "error", "the zero of shoulder.position is"),
    # Behind the last joint a link that is turned needs the same torque.
    ("arm", {"elbow.position": {"offset": 0.5 * np.pi}}, "warning", "the zero of elbow.position"),
    ("arm", {"elbow.position": {"offset": np.pi}}, "warning", "the zero of elbow.position is off"),
    # Nor do wrists that rub tell it: links that are turned were likelier, and nothing was said.
    ("tiago", {_ARM_4: {"offset": 0.5 * np.pi}}, "warning", f"the zero of {_ARM_4} is off by"),
    *(
        ("leg", {n: {"scale": size} for n in _ROTORS}, "error", f"signs of {' and '.join(_ROTORS)}")
        for size in (-2.5, -0.4)
    ),
    ("leg", {_ROTORS[1]: {"scale": 20}}, "error", f"after the reduction as {_ROTORS[1]}"),
    *(
        ("leg", {m: {"from": m.replace("motor", "rotor"), "scale": s} for m in _MOTORS}, "error", t)
        for s, t in ((1.0, "before the reduction"), (400.0, "once too often"))
    ),
    # As moteus and ODrive report them: that the torques were 6.3 times the need was all.
    ("arm", {f"{j}.position": {"scale": 0.5 / np.pi} for j in JOINTS}, "error", _TURNS),
]


@pytest.mark.parametrize(("name", "columns", "severity", "says"), MISTAKES)
def test_a_mistake_in_all_logs_of_a_machine_is_named(
    name: str, columns: dict[str, dict[str, float]], severity: str, says: str, arm: Arm, leg: Logs
) -> None:
    robot, logs = {"arm": arm, "leg": (LEG, leg)}.get(name) or recorded(name)
    wrong = [mended(log, {"columns": columns}) for log in logs[:3]]
    for own in find_suspicions(wrong, robot):
        assert says in own[0].text
        assert own[0].severity == severity
        assert set(own[0].mend.get("columns", columns)) == set(columns)


def changed(log: Log, change: Callable[[Log, int, np.ndarray], np.ndarray]) -> Log:
    names = [f"{joint}.motor_torque" for joint in JOINTS]
    return log.with_columns({n: change(log, k, log.column(n)) for k, n in enumerate(names)})


def delayed(log: Log, late: float, *names: str) -> Log:
    """Return a log whose channels come late [s]."""
    return log.with_columns({n: np.interp(log.time - late, log.time, log.column(n)) for n in names})


def slow(log: Log, _: int, torque: np.ndarray, constant: float = 0.05) -> np.ndarray:
    """The torque through a first-order low-pass."""
    share = np.expm1(log.sample_time / constant) / np.exp(log.sample_time / constant)
    return lfilter([share], [1.0, share - 1.0], torque, zi=[(1.0 - share) * torque[0]])[0]


SIDES = [*(sign * 9.81 * axis for sign in (1.0, -1.0) for axis in np.eye(3))][:5]


@pytest.mark.parametrize("pull", [np.zeros(3), *SIDES], ids=str)
def test_gravity_that_is_another_is_named_and_the_printed_line_mends_the_robot(
    pull: np.ndarray, arm: Arm, tmp_path: Path
) -> None:
    """Of a base on its side only a wrong scale of all torques was said, a sixth of the need."""
    robot, logs = arm
    assert find_suspicions(logs, robot) == [[], [], []]
    kind, other = ("gravity_direction" if any(pull) else "no_gravity"), robot.with_gravity(pull)

    def weight(log: Log, k: int, torque: np.ndarray) -> np.ndarray:
        q = log.stack("position", JOINTS)
        still = Motion(q, 0.0 * q, 0.0 * q)
        return torque + (link_torque(other, still) - link_torque(robot, still))[:, k]

    wrong = [changed(log, weight) for log in logs]
    (finding,) = find_suspicions(wrong, robot)[0]
    assert (finding.kind, finding.severity) == (kind, "error")
    line = next(line.strip() for line in finding.way_out.splitlines() if "gravity = " in line)
    folder = outside("strangers/14_missing_knee_ratio")
    text = (folder / "robot.toml").read_text().replace("arm.urdf", str(folder / "arm.urdf"))
    (tmp_path / "robot.toml").write_text(f"{line}\n{text}")
    assert find_suspicions(wrong, load_robot(tmp_path / "robot.toml")) == [[], [], []]


@pytest.mark.parametrize(
    "change", [lambda log, _, torque: np.interp(log.time - 0.05, log.time, torque), slow]
)
def test_a_late_torque_is_named_and_moved_back(
    change: Callable[[Log, int, np.ndarray], np.ndarray], arm: Arm
) -> None:
    robot, logs = arm
    wrong = [changed(log, change) for log in logs]
    (finding,) = find_suspicions(wrong, robot)[0]
    assert (finding.kind, finding.severity) == ("torque_late", "error")
    assert finding.mend["columns"]["elbow.motor_torque"]["lag"] == 0.05
    back = mended(wrong[0], finding.mend)
    true = logs[0].between(back.time[0], back.time[-1] + 1e-6)
    for name in (f"{joint}.motor_torque" for joint in JOINTS):
        before = np.std(wrong[0].column(name) - logs[0].column(name))
        left = np.std(back.column(name) - true.column(name))
        assert left < 0.75 * before  # a filter also took the noise out, which nothing gives back


@pytest.mark.parametrize("name", ["27_ur5_null", "26_xarm7_outside_belt"])
def test_a_torque_late_by_two_hundredths_of_a_second_is_noticed(name: str) -> None:
    robot, logs = foreign(name, "run[12]")
    assert find_suspicions(logs, robot) == [[], []]
    torques = [n for n in logs[0].columns if "torque" in n]
    late = [delayed(log, 0.02, *torques) for log in logs]
    (finding,) = find_suspicions(late, robot)[0]
    assert finding.kind == "torque_late"
    assert {entry["lag"] for entry in finding.mend["columns"].values()} == {0.02}


def test_columns_as_published_are_not_accused() -> None:
    """A gain of .06 let friction explain a torque without the links: a sign was called wrong."""
    folder = "strangers/01_kuka_sign"
    robot = load_robot(outside(f"{folder}/robot.toml"))
    logs = load_logs([outside(f"{folder}/k{k}.csv") for k in (1, 2, 3)])
    assert find_suspicions(logs, robot) == [[], [], []]


def test_fewer_samples_than_coefficients_tell_no_scale(tmp_path: Path) -> None:
    """One smooth run of the KUKA: its torques were called .21 times what the links need."""
    robot = load_robot(outside("strangers/01_kuka_sign/robot.toml"))
    kinds = {"position": "positions", "velocity": "velocities", "motor_torque": "torques"}
    columns = {
        f"lwr_{k}_joint.{ours}": {"from": f"{theirs}_{k}"}
        for ours, theirs in kinds.items()
        for k in range(7)
    }
    names = write_map(tmp_path / "map.toml", {"time": {"from": "times"}, "columns": columns})
    assert find_suspicions(load_logs([outside("kuka_lwr4/lwr3.npz")], names), robot) == [[]]


def test_torques_of_another_scale_are_asked_about_and_not_mended(arm: Arm) -> None:
    (robot, logs), factor = arm, 20.0 / 9.0
    wrong = [changed(log, lambda log, _, torque: factor * torque) for log in logs]
    (finding,) = find_suspicions(wrong, robot)[0]
    assert (finding.kind, finding.severity) == ("torque_scale", "warning")
    assert finding.text.startswith(f"torques of {', '.join(JOINTS)} are ")
    assert float(finding.text.split("are ")[1].split(" times")[0]) == pytest.approx(factor, rel=0.1)
    assert not finding.likeliest


@pytest.mark.parametrize("trembling", [0.0, 3e-3])
def test_joints_that_are_held_while_another_moves_accuse_nobody(trembling: float, arm: Arm) -> None:
    """Of logs of one joint each "joint_1 holds turns" and "fits other columns" were said."""
    robot, random, logs = arm[0], np.random.default_rng(0), []
    time = np.arange(0.0, 6.0, 0.005)
    smooth = np.hanning(41) / np.sqrt(np.sum(np.hanning(41) ** 2))
    for moving in range(len(JOINTS)):
        noise = random.standard_normal((time.size, len(JOINTS)))
        position = trembling * np.apply_along_axis(np.convolve, 0, noise, smooth, "same")
        position[:, moving] = np.sin(1.3 * time) + 0.3 * np.sin(3.1 * time)
        velocity = np.gradient(position, 0.005, axis=0)
        change = np.gradient(velocity, 0.005, axis=0)
        torque = link_torque(robot, Motion(position, velocity, change)) + np.tanh(velocity / 0.05)
        torque += 0.01 * random.standard_normal(torque.shape)
        columns = {f"{joint}.position": position[:, k] for k, joint in enumerate(JOINTS)}
        columns |= {f"{joint}.motor_torque": torque[:, k] for k, joint in enumerate(JOINTS)}
        logs.append(Log(time, columns))
    assert find_suspicions(logs, robot) == [[]] * len(JOINTS)
    for own, explained in told_by_rows(robot, logs).values():
        assert own > 0.9
        assert explained > 0.8


@pytest.mark.parametrize("constant", [0.02, 0.05])
def test_a_torque_that_is_late_in_one_joint_alone_is_measured(constant: float, arm: Arm) -> None:
    robot, logs = arm
    name = "elbow.motor_torque"
    (finding,) = find_suspicions([delayed(log, constant, name) for log in logs], robot)[0]
    assert (finding.kind, finding.severity) == ("torque_late", "warning")
    assert list(finding.likeliest["columns"]) == [name]
    # The links and frictions that the description lacks look like a lag of 7 ms by themselves.
    assert finding.likeliest["columns"][name]["lag"] == pytest.approx(constant, abs=0.011)


def test_what_logs_show_with_other_numbers_is_mended_once() -> None:
    """Two logs turned the sign twice, and the printed map changed nothing."""
    logs = practice("case00", "ac")
    sizes = ({"hip": -1.0, "knee": -1.0}, {"hip": -1.001})
    wrong = [
        mended(log, {"columns": {f"{joint}.velocity": {"scale": s} for joint, s in own.items()}})
        for log, own in zip(logs, sizes, strict=True)
    ]
    with pytest.raises(SuspiciousLogError) as caught:
        suspicions(LEG, wrong)
    for joint in ("hip", "knee"):
        assert f'columns."{joint}.velocity" = {{ sign = -1 }}' in str(caught.value)


@pytest.mark.parametrize(("name", "number"), [("14_z1_ripple", 2), ("24_kinova_outside_wind", 1)])
def test_a_zero_that_is_another_in_one_log_is_told_at_all_joints(name: str, number: int) -> None:
    """The last of an arm, and one beside a joint whose torque follows no need."""
    robot, logs = foreign(name)
    column = f"{robot.transmission.joints[number]}.position"
    off = logs[1].with_columns({column: logs[1].column(column) + 0.3})
    before, (finding,), after = find_suspicions([logs[0], off, logs[2]], robot)
    assert before == after == []
    assert (finding.kind, finding.probability > 0.9) == ("position_zero", True)
    assert f"the zero of {column} is off by" in finding.text


def test_three_wrists_in_a_wrong_order_are_put_back() -> None:
    """One exchange was found, and the check approved the rest: exchanged wrists explain 99 %."""
    robot, logs = foreign("27_ur5_null", "run[12]")
    wrists = robot.transmission.joints[3:]
    order = dict(zip(wrists, (*wrists[1:], wrists[0]), strict=True))
    moved = {
        f"{ours}.{name.removeprefix(f'{theirs}.')}": {"from": name}
        for ours, theirs in order.items()
        for name in logs[0].columns
        if name.startswith(f"{theirs}.")
    }
    wrong = [mended(log, {"columns": moved}) for log in logs]
    found = find_suspicions(wrong, robot)[0]
    assert [(f.kind, f.severity) for f in found] == [("exchanged", "error")] * 2
    back = mended(wrong[0], together(finding.mend for finding in found))
    for name, values in logs[0].columns.items():
        np.testing.assert_array_equal(back.column(name), values)


@pytest.mark.parametrize("joint", ["arm_1_joint", "arm_3_joint"])
def test_a_joint_that_friction_moves_hides_no_mistake_of_another(joint: str) -> None:
    """TIAGo's first joint reports a hundred times its need: what it strays decided for all.

    A reversed position was called a reversed current, or a torque that follows nothing.
    """
    robot, (log,) = recorded("tiago")
    turned = {f"{joint}.position", f"{joint}.velocity"}
    columns = {name: {"sign": -1} for name in turned & set(log.names)}
    ((finding,),) = find_suspicions([mended(log, {"columns": columns})], robot)
    assert f"the sign of {joint}.position is reversed" in finding.text
    if finding.severity == "error":
        assert set(finding.mend["columns"]) == set(columns)
    else:
        assert f"the sign of {joint}.current is reversed" in finding.text


@pytest.mark.parametrize(("left", "closer"), [(0.25, False), (0.15, True)])
def test_an_exchange_that_explains_less_accuses_nobody(left: float, *, closer: bool) -> None:
    """Of an arm whose joints moved one at a time, 66.6 % were explained in the place of 67.0 %."""

    def report(left: float) -> Report:
        nothing = np.zeros(1)
        return Report(nothing, nothing, nothing, nothing, left, 0.0, 40.0, 1.0)

    strays = np.array([[2.0, 2.0]])
    as_is = Judged(Reading(), ((report(0.2), report(0.2)),), (strays,))
    read = Reading("exchanged", "they are exchanged", exchanged=(0, 1))
    other = Judged(read, ((report(left), report(left)),), (0.5 * strays,))
    assert other.closer(as_is, (0,)) is closer


@pytest.mark.parametrize(("better", "accused"), [(0.4, False), (4.0, True)])
def test_gains_of_twelve_drives_that_nothing_is_wrong_with_accuse_no_gear(
    better: float, accused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Free gains cost 30 nats: a quadruped with one weak drive was refused, its gears 1.16 times as
    high, although that explained .4 nats more of each log of that leg and nothing of the others."""
    gains = -0.5 * (np.log(evidence.GAINS) / 0.05) ** 2
    flat = np.zeros(101)
    one = Report(gains, flat, np.zeros((1, 5)), np.ones(1), 0.001, -1e3, 40.0, 1.0)
    strange = one._replace(ratios=flat + better * (np.arange(101) == 53))
    legs = tuple(one for _ in range(11)), tuple(strange for _ in range(11))
    reports = tuple((strange, *(legs[accused])) for _ in range(2))
    as_is = Judged(Reading(), reports, ())
    rare = Judged(Reading("torque_sign", "it is reversed", prior=-200.0), reports, ())
    monkeypatch.setattr(Judged, "closer", lambda *_: True)
    found = mistakes._likeliest(load_robot("solo12"), [as_is, rare])
    assert (found is not None and found[0].kind == "gear_ratio") is accused
