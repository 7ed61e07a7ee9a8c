"""What stands between readings and the film: one term of the measurement equation a file."""
