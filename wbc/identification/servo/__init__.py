"""Position servos: fits of rollouts to their runs."""

from wbc.identification.servo.servo_models import RolloutModel, Rollouts, fit_rollouts

__all__ = ["RolloutModel", "Rollouts", "fit_rollouts"]
