"""The force of traps on spheres in plain floats."""
