"""Runs excited over a band as blocks of the measurement equation, and what its solve says of them."""
