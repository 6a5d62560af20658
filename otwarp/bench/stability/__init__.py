"""`otwarp bench stability`: what happens to scenes that are hard to step."""
