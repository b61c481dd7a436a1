"""Settings of every test."""

import os

from hypothesis import settings

# A gate must say the same of the same commit; the search for new cases goes on at every desk.
settings.register_profile("gate", derandomize=True, print_blob=True)
if os.environ.get("CI"):
    settings.load_profile("gate")
