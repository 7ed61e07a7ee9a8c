"""The model with effects, asked for exactly what a campaign measured."""
