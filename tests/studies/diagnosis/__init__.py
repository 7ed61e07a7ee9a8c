"""Evidence for the diagnosis: bearings drawn from stated tolerances, hidden effects, and what lies outside."""
