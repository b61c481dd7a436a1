import numpy as np

from wbc.effects.link_motion import best_contacts
from wbc.robot import LinkResponse


def test_nothing_swings_behind_a_gear_that_moves_a_point_on_its_own_axis() -> None:
    rows = 1000
    torque = np.sin(np.linspace(0.0, 20.0, rows))[:, None]
    none, some = np.zeros((rows, 1)), np.full((rows, 1), 0.05)
    contacts = np.array([[100.0, 1.0, 0.0], [1000.0, 1.0, 0.0]])

    def offered(inertia: np.ndarray) -> np.ndarray:
        response = LinkResponse(1e-3, 0, torque, inertia, none, none)
        return best_contacts([response], [torque], contacts, count=1)

    assert offered(none).shape == (0, 3)
    assert offered(some).shape == (1, 3)
