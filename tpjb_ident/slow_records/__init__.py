"""Records of slow tests (dry load steps, clearance sweeps, loci): noise, glitches, channels that stand still."""
