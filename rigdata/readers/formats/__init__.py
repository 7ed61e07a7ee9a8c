"""Formats of other loggers, each read by its own library."""
