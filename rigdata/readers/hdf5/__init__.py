"""Runs in an HDF5 campaign, read without leaving the file."""
