"""The loop that runs the chains at a fixed rate, and the process that it lives in."""
