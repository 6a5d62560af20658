"""`otwarp bench terms`: what every term of the step costs, on and off."""
