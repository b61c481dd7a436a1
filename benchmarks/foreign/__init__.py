"""The controller on robots that this project does not ship; see `__main__`."""
