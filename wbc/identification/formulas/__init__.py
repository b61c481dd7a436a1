"""Discovery: formulas for what no named effect explains, clearly labelled as proposals."""

from wbc.identification.formulas.discovery import discover
from wbc.identification.formulas.formula import Discovery, Outcome, Proposal

__all__ = ["Discovery", "Outcome", "Proposal", "discover"]
