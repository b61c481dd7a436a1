"""Discovery: formulas for what no named effect explains, clearly labelled as proposals."""

from wbc.identification.formulas.discovery import discover as discover
from wbc.identification.formulas.formula import (
    Discovery as Discovery,
    Outcome as Outcome,
    Proposal as Proposal,
)
