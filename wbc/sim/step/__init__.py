"""One time step: smooth parts, impacts, and the program that each of them solves."""
