"""What the records say of the instruments that took them, and what that does to the coefficients."""
