import numpy as np
import pytest

from wbc.measurement import Log


@pytest.fixture
def swing() -> Log:
    """Two joints, 4 s at 500 Hz, exact sinusoids."""
    time = np.arange(2000) * 0.002
    return Log(
        time,
        {
            "hip.position": 0.5 * np.sin(4.0 * time),
            "knee.position": 0.8 * np.sin(6.0 * time + 1.0),
            "hip.velocity": 2.0 * np.cos(4.0 * time),
            "knee.velocity": 4.8 * np.cos(6.0 * time + 1.0),
            "hip.rotor_torque": np.sin(4.0 * time),
            "knee.rotor_torque": np.cos(6.0 * time),
        },
    )
