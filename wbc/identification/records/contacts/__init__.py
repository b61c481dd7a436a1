"""Contacts whose force no sensor measured: which touch, and how they leave the rows."""
