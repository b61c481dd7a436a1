"""Plots hold the numbers they claim; what is drawn is read back from the figure."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import wbc
from sims.leg import LegControl, balanced_pose, squat
from wbc.errors import ViewError
from wbc.identification import compare
from wbc.measurement import Log
from wbc.metrics import summary, with_contact_at
from wbc.robot import Robot
from wbc.samples import sample_logs
from wbc.sim import Plant, simulate
from wbc.view import DARK, LIGHT, plots


@pytest.fixture(scope="module")
def pose(leg: Robot) -> np.ndarray:
    """The pose of the paper."""
    return leg.configuration(base_z=0.69282, hip=-np.pi / 6, knee=np.pi / 3)


def test_standing_draws_one_line_per_run_and_the_height_of_the_center_of_mass(
    leg: Robot, squat: Log
) -> None:
    height = plots.standing_figure(leg, {"one": squat, "two": squat}).axes[0].get_lines()
    assert [line.get_label() for line in height[:2]] == ["one", "two"]
    knee = 0.4 * np.cos(squat.column("hip.position")) / 2.0
    base = squat.column("base_z.position")
    # base 15 kg at the hip, thigh and shin 2 kg each at their middles, shin below the knee
    shin = 2.0 * knee + 0.2 * np.cos(squat.column("hip.position") + squat.column("knee.position"))
    expected = base - (2.0 * knee + 2.0 * shin) / 19.0
    np.testing.assert_allclose(height[0].get_ydata(), expected, atol=1e-9)


def test_every_axis_of_every_plot_names_its_unit(leg: Robot, squat: Log, pose: np.ndarray) -> None:
    for theme in (LIGHT, DARK):
        figures = [
            plots.standing_figure(leg, {"run": squat}, theme=theme),
            plots.power_figure(leg, squat, theme),
            plots.energy_figure(leg, squat, theme),
            plots.leg_figure(leg, pose, "foot", theme),
        ]
        for figure in figures:
            for axes in figure.axes:
                assert "[" in axes.get_ylabel()
            assert any("[" in axes.get_xlabel() for axes in figure.axes)


def test_the_audit_of_an_exact_motion_closes_while_standing(leg: Robot, squat: Log) -> None:
    audit = plots.energy_audit(leg, squat.between(0.3, 1.9))
    # The torques were computed from the motion with the same losses: what the motors give is
    # stored or heat, up to the averaging of speeds at the reversals.
    assert np.abs(audit["unexplained"]).max() < 0.02 * np.abs(audit["work of the motors"]).max()
    assert audit["heat in gears"][-1] > 0.5 * np.ptp(audit["potential energy"])


def test_the_audit_of_a_noisy_recording_is_the_balance_of_the_simulator() -> None:
    """Noise makes the controller's torque change at every tick: sampled powers drift by 1 %."""
    robot = wbc.load_robot("planar_leg_strong")
    start = balanced_pose(robot)
    control = LegControl(robot, squat(0.67, 0.025, 0.5))
    run = simulate(Plant(robot), control, Plant(robot).state(start), 0.3)
    found = plots.energy_audit(robot, run.log)
    assert found["heat in gears"][-1] == pytest.approx(run.audit.flow.mesh, rel=1e-2)  # less a step
    assert np.abs(found["unexplained"]).max() < 2e-3 * np.abs(found["work of the motors"]).max()


def test_no_text_of_the_leg_figure_lies_on_curves_or_other_text(
    leg: Robot, pose: np.ndarray
) -> None:
    figure = plots.leg_figure(leg, pose, "foot")
    figure.draw_without_rendering()
    boxes = []
    for axes in figure.axes:
        legend = axes.get_legend()
        entries = [] if legend is None else legend.get_texts()
        labels = [axes.title, axes._left_title, axes.xaxis.label, axes.yaxis.label]
        texts = [t for t in [*entries, *labels, *axes.texts] if t.get_text()]
        boxes += [(t.get_text(), t.get_window_extent()) for t in texts]
        for entry in entries:
            assert not entry.get_window_extent().overlaps(axes.get_window_extent())
    assert any("no Forward-GIT" in text for text, _ in boxes)
    for (one, a), (other, b) in combinations(boxes, 2):
        assert not a.overlaps(b), f"{one!r} on {other!r}"


def test_the_pose_is_the_leg_and_not_the_joints_of_its_base(leg: Robot, pose: np.ndarray) -> None:
    chain = plots.leg_figure(leg, pose, "foot").axes[0].get_lines()[0].get_xydata()
    np.testing.assert_allclose(chain, [[0, 0], [0.2, 0.34641], [0, 0.69282]], atol=1e-5)


def test_the_polygon_that_is_drawn_is_the_one_that_is_printed(leg: Robot, pose: np.ndarray) -> None:
    """Same signs: a foot about to move up lifts 70 N upwards and holds 175 N downwards."""
    panel = plots.leg_figure(leg, pose, "foot").axes[2]
    drawn = {p.get_label(): p.get_xy()[:-1] for p in panel.patches}
    (printed,) = [
        m.value for m in summary(leg, pose, "foot") if m.name == "force polygon, moving up"
    ]
    np.testing.assert_allclose(drawn["combined, about to move along z"], printed)
    ends = zip(printed, np.roll(printed, -1, axis=0), strict=True)
    straight = [a[1] - a[0] * (b[1] - a[1]) / (b[0] - a[0]) for a, b in ends if a[0] * b[0] < 0.0]
    assert sorted(straight) == pytest.approx([-175.0, 70.0])
    weight = panel.get_lines()[0].get_ydata()[0]
    assert weight == pytest.approx(-9.81 * sum(body.mass for body in leg.model.inertias))


def test_an_arm_without_torque_limits_is_drawn_without_empty_panels() -> None:
    robot = with_contact_at(wbc.load_robot("staubli_tx40"), "link_6")
    q = robot.configuration(joint_2=0.5, joint_3=1.2, joint_5=0.6)
    pose, _, force = plots.leg_figure(robot, q, "link_6").axes
    (text,) = (text.get_text() for text in force.texts)
    assert "no torque_limit" in " ".join(text.split())
    names = [text.get_text() for text in pose.texts]
    assert names == ["link_6\njoint_6\njoint_5\njoint_4", "joint_3", "joint_2\njoint_1"]


def test_force_polytopes_of_the_fixed_leg(tmp_path: Path) -> None:
    robot = wbc.load_robot("planar_leg_fixed")
    figure = plots.leg_figure(robot, robot.configuration(hip=-np.pi / 6, knee=np.pi / 3), "foot")
    curves = {line.get_label() for line in figure.axes[1].get_lines()}
    assert {"GIT (perfect gears)", "Backward-GIT", "Forward-GIT"} <= curves
    polygons = {p.get_label(): p.get_xy() for p in figure.axes[2].patches if p.get_label()}
    lift, hold = polygons["lift (forward)"], polygons["hold (backward)"]
    assert hold[:, 1].max() / lift[:, 1].max() == pytest.approx(2.2, abs=0.2)
    for name in ("leg.png", "leg.pdf", "leg.svg"):
        assert plots.write_figure(tmp_path / name, figure).stat().st_size > 5_000
    again = plots.write_figure(tmp_path / "again.svg", figure)
    assert again.read_bytes() == (tmp_path / "leg.svg").read_bytes()
    with pytest.raises(ViewError, match=r"\.png, \.pdf, \.svg"):
        plots.write_figure(tmp_path / "leg.bmp", figure)


def test_no_legend_hides_a_torque() -> None:
    """It stood inside the panels, over the curves, and was wider than a part of them."""
    figure = compare(wbc.load_robot("planar_leg_fixed"), sample_logs()[:1]).plot()
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["measured", "model"]
    assert all(axes.get_legend() is None for axes in figure.axes)
