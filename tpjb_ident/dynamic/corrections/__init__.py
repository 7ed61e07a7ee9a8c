"""What is put right between phasors and estimate, and what that leaves uncertain."""
