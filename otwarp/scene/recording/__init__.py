"""The USD side of a recording: `usd.UsdRecording`."""
