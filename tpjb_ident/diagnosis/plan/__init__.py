"""What a campaign could and could not tell, before it is run."""
