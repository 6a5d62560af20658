"""Headless pictures and movies of a stage or a recorded run: a small ray caster on Warp.

A stage and a time code come in, by `otwarp.scene.drawing` as a draw list; a PNG, GIF, MP4 or WebM goes
out. Open `draw` first.

- `draw`: the one call behind `otwarp preview`; frames of a run.
- `render`: a draw list in, a picture out: sampling, tone curve, bloom.
- `studio`: size and quality of a picture, its lights and background, and the upload to the device.
- `kernels`: what runs there.
- `annotate`, `image`, `video`: scale bar and time stamp; PNG and GIF, MP4 and WebM on disk.
"""
