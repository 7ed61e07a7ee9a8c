"""Find where simulation and measurement disagree, name the missing effect, show that the gap shrinks."""
