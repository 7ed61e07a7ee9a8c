"""Coefficients in the forms that other programs read, and records as dictionaries (SEP 005)."""
