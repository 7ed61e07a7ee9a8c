"""Excitation over a band: multi-sine, periodic and other noise, sweeps, impacts. From records to h over frequency."""
