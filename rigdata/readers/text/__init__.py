"""Text exports: CSV in any dialect, catman ASCII."""
