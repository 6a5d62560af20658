"""Command line: one thin command per capability, each also one Python call."""
