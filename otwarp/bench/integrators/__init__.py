"""`otwarp bench integrators`: error against run time of integrators, force models and precisions."""
