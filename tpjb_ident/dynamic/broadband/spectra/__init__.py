"""A broadband run as phasors: its samples, its period, lines that disturb it, its clocks."""
