"""`otwarp bench speed`: steps per second of typical scenes, beside codes written for one of them."""
