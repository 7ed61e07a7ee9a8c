"""What every picture shares: colours, panels, axes, series."""
