"""The HTML report of a comparison or a diagnosis."""

from wbc.identification.answer.sentence import verdict_sentence
from wbc.view.report.report import write_report

__all__ = ["verdict_sentence", "write_report"]
