"""Recordings on disk: the MCAP container and the messages in it."""
