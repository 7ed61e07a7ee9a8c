"""Identify, predict and compare the dynamic coefficients of tilting-pad journal bearings."""
