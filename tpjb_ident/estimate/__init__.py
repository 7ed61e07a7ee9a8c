"""One solve for all blocks of a campaign: equation, arrowhead, weights, budget, intervals."""
