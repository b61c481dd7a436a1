"""One log held against its robot under many readings of its columns."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.measurement.suspicions.evidence import Report, report
from wbc.measurement.suspicions.readings import Reading, as_it_stands
from wbc.measurement.suspicions.rows import Need, Rows


class Bench:
    """Holds one log against its robot; each need and each report is computed once."""

    def __init__(self, rows: Rows) -> None:
        """Start with nothing computed."""
        self._rows = rows
        self._inertia = _inertia(rows)
        self._needs: dict[bytes, Need] = {}
        self._reports: dict[bytes, Report] = {}
        self._unrelated: FloatArray | None = None

    def unrelated(self, reading: Reading) -> FloatArray:
        """Return (m,) the log likelihoods of the columns of a reading if they mean nothing."""
        if self._unrelated is None:
            plain = self.reports(as_it_stands(self._rows))
            self._unrelated = np.array([one.idle for one in plain])
        return self._unrelated[reading.torque_order]

    def reports(self, reading: Reading) -> tuple[Report, ...]:
        """Return the report of every driven joint, read in one way."""
        rows = self._rows
        place = reading.order.tobytes() + reading.factor.tobytes()
        if place not in self._needs:
            self._needs[place] = rows.need(reading.order, reading.factor)
        torque = reading.torque(rows)
        found = []
        for k in range(torque.shape[1]):
            key = place + torque[:, k].tobytes() + bytes([k])
            if key not in self._reports:
                samples = float(rows.samples[reading.torque_order[k]])
                self._reports[key] = report(
                    torque[:, k],
                    self._needs[place],
                    k,
                    samples,
                    float(self._inertia[k]),
                    float(rows.robot.transmission.reflected_inertia[k]),
                    0.0 if rows.quantities[k] == "motor_torque" else -1.0,
                )
            found.append(self._reports[key])
        return tuple(found)


def _inertia(rows: Rows) -> FloatArray:
    """Return (m,) the typical inertia of each driven joint with its rotor."""
    robot = rows.robot
    data = robot.model.createData()
    places = rows.position[:: max(1, len(rows.position) // 8)]
    own = [np.diag(pin.crba(robot.model, data, q))[robot.actuated] for q in places]
    return np.asarray(np.mean(own, axis=0) + robot.transmission.reflected_inertia)
