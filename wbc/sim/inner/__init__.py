"""The inner work of a smooth part in compiled loops, in the order of docs/guide/simulation.md."""
