"""Readers of record files: each gives raw readings of single channels, as float64."""
