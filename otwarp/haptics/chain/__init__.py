"""The signal chain of one side, from a device's sample to a force that is safe to send."""
