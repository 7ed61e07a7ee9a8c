"""Dry pivot tests to load-deflection curves per pad (paper, Sec. 5)."""
