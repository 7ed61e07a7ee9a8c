"""Records to dynamic coefficients: phasors, oil force, R matrices and Eq. (13)-(15)."""
