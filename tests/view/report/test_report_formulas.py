"""The report shows the formulas that were proposed for what no effect explains."""

from pathlib import Path

import numpy as np

import wbc
from wbc.effects import CustomTorque, ViscousFriction
from wbc.identification import diagnose
from wbc.identification.formulas import discover
from wbc.sim.excitation import record_with
from wbc.view.report import write_report


def test_a_proposed_formula_stands_in_the_report_with_its_numbers(tmp_path: Path) -> None:
    leg = wbc.load_robot("planar_leg_fixed").lossless()
    hidden = CustomTorque.at("knee", {"sin(2 q_hip)": -0.8})
    logs = record_with(leg, [hidden], duration=2.0)
    diagnosis = diagnose(leg, logs, [ViscousFriction])
    discovery = discover(leg, logs, known=diagnosis.effects)
    (proposal,) = discovery.proposals
    page = write_report(tmp_path / "r.html", leg, logs, diagnosis, discovery=discovery)
    text = page.read_text(encoding="utf-8")
    section = text[text.index('<section id="formulas">') :]
    section = section[: section.index("</section>")]
    assert "sin(2 q_hip)" in section
    assert discovery.summary in section
    (estimate,) = proposal.coefficients.values()
    assert np.isclose(estimate.value, -0.8, rtol=0.02)
    assert f"{abs(estimate.value):.3f}"[:4] in section
