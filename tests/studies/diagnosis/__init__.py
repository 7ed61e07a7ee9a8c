"""Evidence for the diagnosis: mixtures drawn from stated tolerances, hidden effects, and what lies outside."""
