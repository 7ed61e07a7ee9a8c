"""From fits to a verdict, and what speaks for it."""
