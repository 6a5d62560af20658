"""What `otwarp haptics check` measures: costs, latency, jitter, Z-width."""
