"""Static equilibrium of journal, pads and pivots."""
