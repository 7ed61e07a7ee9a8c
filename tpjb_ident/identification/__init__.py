"""The path of a campaign's dynamic runs to coefficients, point by point."""
