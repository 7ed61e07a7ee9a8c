"""One comparison: every explanation is a Gaussian-linear model of all observations, with other numbers free."""
