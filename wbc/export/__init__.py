"""A robot with its effects, written for the simulators that people train in."""

from wbc.export.export import (
    Exported as Exported,
    export_robot as export_robot,
    losses_path as losses_path,
)
from wbc.export.numbers import loss_numbers as loss_numbers
