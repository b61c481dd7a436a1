"""The rivals of a saved diagnosis: what it found, and what explains its logs as well."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.design.experiment.rivals import BAND, Cause, Rivals, require_predictable
from wbc.effects import effect_class
from wbc.errors import DesignError
from wbc.files import load_table
from wbc.robot import Effect, Robot

_MOST = 4  # causes: pairs grow with the square, and less likely rivals matter less


def tied_causes(table: Mapping[str, Any], robot: Robot) -> tuple[Cause, ...]:
    """Return what a diagnosis found, and the rivals that explain its logs as well.

    Each with all its effects and the parameters that were fitted to the logs. Where nothing ties,
    the rival that came closest. Rivals whose torque no planned motion tells are left out.

    Args:
        table: what `wbc diagnose --json` wrote.
        robot: the robot that was diagnosed.

    Raises:
        DesignError: no diagnosis, one that found nothing, or no rival that a planned motion could
            tell from what was found.
        EffectError: an effect or place that this robot does not have.
    """
    if not isinstance(table.get("effects"), list):
        raise DesignError("--between: no diagnosis; give what `wbc diagnose --json FILE` wrote.")
    own = tuple(map(_effect, table["effects"]))
    if not own:
        raise DesignError(
            f"the diagnosis is '{table.get('verdict')}' and names no effect; there is nothing to "
            "tell apart. Name causes with --between EFFECT@PLACE EFFECT@PLACE."
        )
    causes, refused = [own], ""
    for rival in _ranked(table):
        try:
            for effect in rival:
                require_predictable(effect, robot)
        except DesignError as reason:
            refused = f" ({reason})"
            continue
        if {e.key for e in rival} not in [{e.key for e in cause} for cause in causes]:
            causes.append(rival)
    for effect in own:
        require_predictable(effect, robot)
    if len(causes) < 2:
        raise DesignError(
            f"the diagnosis holds no rival of what it found{refused}. Name causes with --between "
            "EFFECT@PLACE EFFECT@PLACE."
        )
    return tuple(causes[:_MOST])


def tied_rivals(
    found: Mapping[str, Any] | str | Path,
    robot: Robot,
    noise: FloatArray,
    band: float | None = None,
) -> Rivals:
    """Return the `tied_causes` of a diagnosis with what its logs leave open of their values.

    Args:
        found: what `wbc diagnose --json` wrote, or the path of its file.
        robot: the robot that was diagnosed.
        noise: (m,) standard deviation of the measured rotor torque [N m].
        band: [Hz] that the diagnosis of the log will keep of torques; that of `found` when left
            out, or `BAND` where it does not say.

    Raises:
        DesignError: as `tied_causes`, a file that cannot be read or that a newer wbc wrote, and
            covariances that do not fit their causes.
        EffectError: an effect or place that this robot does not have.
    """
    table = found
    if not isinstance(table, Mapping):
        table = load_table(table, "the diagnosis", DesignError, json.loads)
    causes = tied_causes(table, robot)
    covariances = tuple(_covariance(table, cause) for cause in causes)
    if band is None:
        band = float(table.get("band") or BAND)
    return Rivals(robot, causes, noise, band, covariances)


def _covariance(table: Mapping[str, Any], cause: Cause) -> FloatArray | None:
    """Return the covariance that the ranking holds of a cause, None where it holds none."""
    keys = [effect.key for effect in cause]
    for row in table.get("ranking", []):
        listed = [(e["effect"], e["where"]) for e in row.get("effects", [])]
        if listed == keys and row.get("covariance") is not None:
            return np.array(row["covariance"], dtype=np.float64)
    return None


def _ranked(table: Mapping[str, Any]) -> list[Cause]:
    """Return the rivals of the ranking: those that tie, else the closest one."""
    rows = [row for row in table.get("ranking", []) if row.get("effects") and row["added"]]
    instead = [row for row in rows if row["removed"]]
    tied = [row for row in instead if row["standing"] in ("better", "not distinguishable")]
    chosen = tied or instead[:1] or rows[:1]
    return [tuple(map(_effect, row["effects"])) for row in chosen]


def _effect(entry: Mapping[str, Any]) -> Effect:
    try:
        name, where = entry["effect"], entry["where"]
        values = {
            key: float(number["value"] if isinstance(number, Mapping) else number)
            for key, number in entry["parameters"].items()
        }
    except (KeyError, TypeError, ValueError) as cause:
        raise DesignError(f"--between: an effect of the diagnosis lacks {cause}.") from cause
    return effect_class(name).at(where[0] if isinstance(where, list) else where, values)
