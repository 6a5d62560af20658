"""What the inner rooms of haptics share: types, configuration, time, and memory between processes."""
