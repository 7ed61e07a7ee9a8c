"""What an identification says about every operating point, and its tables."""
