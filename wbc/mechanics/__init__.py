"""Compiled: trees of rigid bodies, the laws of rows, small linear algebra, Newton on rows."""
