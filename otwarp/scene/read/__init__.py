"""Reads a USD stage into the description: `load.read_file`."""
