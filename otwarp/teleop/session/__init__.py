"""The live loop, and the session that is built around it."""
