"""`otwarp bench forces`: error against run time of every force model, for one bead in one trap."""
