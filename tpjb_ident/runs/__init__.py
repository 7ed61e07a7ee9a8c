"""All dynamic runs of a campaign: read by jobs, kept, grouped by operating point."""
