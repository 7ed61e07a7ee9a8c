"""Everything a campaign offers as one labelled vector with its covariance."""
