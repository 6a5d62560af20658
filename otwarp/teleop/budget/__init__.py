"""The reduced scene: what this machine carries in time with the wall clock."""
