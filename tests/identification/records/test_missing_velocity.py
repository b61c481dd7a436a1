import numpy as np

from wbc.identification.records.filters import white_level


def test_level_of_an_unmeasured_column_is_unknown_and_the_others_keep_theirs() -> None:
    rate, spread = 500.0, 0.02
    noise = spread * np.random.default_rng(3).standard_normal((20000, 1))
    both = np.hstack([np.full_like(noise, np.nan), noise])
    level = white_level(both, rate)
    assert np.isnan(level[0])
    # White noise of variance s^2 has the one-sided density 2 s^2 / rate.
    assert abs(level[1] / (2.0 * spread**2 / rate) - 1.0) < 0.1


def test_nothing_measured_is_nothing_known() -> None:
    assert np.isnan(white_level(np.full((100, 2), np.nan), 100.0)).all()
