"""Search for the effects that explain a disagreement: screen, fit, examine."""
