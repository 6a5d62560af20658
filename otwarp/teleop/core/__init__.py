"""What a session speaks: its frames, what may be asked of it, who watches it, how its time passes."""
