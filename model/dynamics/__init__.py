"""Dynamic coefficients: the pads' matrices and their reduction at the excitation frequency."""
