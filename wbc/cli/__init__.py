"""The `wbc` command: parses, calls, prints."""

import os

# The matrices are small: with two threads of linear algebra a diagnosis of a recorded arm takes 120
# instead of 69 s of processor time, and as long. Libraries read this when they are loaded.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from wbc.cli.main import main as main  # noqa: E402
