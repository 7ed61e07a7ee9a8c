"""The known lines of a record: which they are, the windows that tell them apart, their least-squares fit."""
