"""The HTML report of a comparison or a diagnosis."""

from wbc.view.report.report import write_report
from wbc.view.report.sentence import verdict_sentence

__all__ = ["verdict_sentence", "write_report"]
