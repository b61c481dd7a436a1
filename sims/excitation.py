"""The recorded runs of a robot with hidden effects, at the name by which the studies know them."""

from wbc.sim.excitation import ENCODER, MultiSine, record_run, record_with

__all__ = ["ENCODER", "MultiSine", "record_run", "record_with"]
