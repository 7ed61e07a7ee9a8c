"""What can be seen wrong in records that read well: single channels, clocks, set points, signs."""
