"""Rows of equalities and inequalities: written, made orthonormal, found to be implied."""
