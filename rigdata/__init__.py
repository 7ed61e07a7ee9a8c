"""Rig exports: reading, checking, calibrating and writing test campaigns (`tpjb-rig/1`)."""
