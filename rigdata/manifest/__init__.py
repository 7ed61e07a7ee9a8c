"""The manifest: parsed and checked as a whole, every problem at once."""
