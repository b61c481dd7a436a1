"""The HTML report of a comparison or a diagnosis."""

from wbc.extras import needs
from wbc.identification.answer.diagnosis.sentence import verdict_sentence

with needs("view", "writing a report"):
    from wbc.view.report.report import write_report

__all__ = ["verdict_sentence", "write_report"]
