"""What a picture needs of a stage: `drawables.read_drawables`."""
