"""Clearance polygon and shaft centre locus from slow sweeps (paper, Fig. 14)."""
