"""The oil film of one pad: Reynolds, rupture, perturbation, energy."""
