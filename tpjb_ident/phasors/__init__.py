"""A dynamic run's record to phasors of displacement and oil force, window by window."""
