"""Recordings of sessions, and their replay bit for bit."""
