"""Movies: as GIF, or as MP4 and WebM through ffmpeg as it comes with imageio-ffmpeg (the extra `movie`)."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.files import written
from otwarp.preview.image import save_movie

CODECS = {
    # H.264 at a quality where one sees no difference, with its index in front so that browsers begin at once
    ".mp4": ("libx264", ["-crf", "18", "-preset", "medium", "-movflags", "+faststart"]),
    ".webm": ("libvpx-vp9", ["-crf", "28", "-b:v", "0", "-deadline", "good", "-cpu-used", "4"]),
}
"""Ending → codec, and its options."""

COLOURS = [
    "-vf",
    "scale=out_color_matrix=bt709",
    "-colorspace",
    "bt709",
    "-color_primaries",
    "bt709",
    "-color_trc",
    "bt709",
]
"""Says in the file how its colours are meant; players guess otherwise, by the height of the picture."""


def write_movie(frames: Iterable[np.ndarray], path: str | Path, fps: float) -> int:
    """Write frames as GIF, MP4 or WebM, by the ending; see `save_movie` and `save_video`."""
    return (save_video if Path(path).suffix in CODECS else save_movie)(frames, path, fps)


def check_video(path: Path) -> None:
    """Find out whether this kind of movie can be written here.

    Raises:
        InputError: imageio-ffmpeg is absent.
    """
    if path.suffix in CODECS and importlib.util.find_spec("imageio_ffmpeg") is None:
        raise InputError(
            f"{path}: a movie as {path.suffix} needs imageio-ffmpeg: pip install 'otwarp[movie]'; allowed without: .gif"
        )


def save_video(frames: Iterable[np.ndarray], path: str | Path, fps: float) -> int:
    """Write frames, (h, w, 3) uint8 each, as MP4 (H.264) or WebM (VP9) while they come; memory holds one of them.

    An odd width or height loses its last column or row, because colours are stored for two by two pixels.

    Args:
        frames: Iterable of equally large images, at least one, of at least 2 × 2 pixels.
        path: File to write, `.mp4` or `.webm`.
        fps: Frames per second.

    Returns:
        Number of frames written.

    Raises:
        InputError: No frames, frames of different sizes or too small, or the file cannot be written, also for a full
            disk: ffmpeg then says why on standard error.
    """
    import imageio_ffmpeg

    path = Path(path)
    codec, options = CODECS[path.suffix]
    given: dict[str, Any] = {
        "fps": fps,
        "codec": codec,
        "quality": None,
        "pix_fmt_out": "yuv420p",
        "macro_block_size": 1,
        "output_params": [*COLOURS, *options],
        "ffmpeg_log_level": "error",
    }
    count, shape, encoder = 0, (0, 0, 0), None
    with written(path, str(path)) as part:
        try:
            for image in frames:
                if encoder is None:
                    shape = image.shape
                    height, width = (n - n % 2 for n in shape[:2])
                    if min(height, width) < 2:
                        raise InputError(f"{path}: size = {shape[1]}x{shape[0]}, allowed [2, inf) in both")
                    encoder = imageio_ffmpeg.write_frames(str(part), (width, height), **given)
                    encoder.send(None)
                elif image.shape != shape:
                    raise InputError(f"{path}: frame {count} has shape {image.shape}, the ones before {shape}")
                try:
                    encoder.send(np.ascontiguousarray(image[:height, :width]))
                except OSError:  # ffmpeg is gone
                    break
                count += 1
        finally:
            if encoder is not None:
                encoder.close()
        if encoder is None:
            raise InputError(f"{path}: no frames to write, at least 1 wanted")
        if (whole := _frames_in(part)) != count or not count:
            raise InputError(f"{path}: ffmpeg wrote {whole} of {count} frames; allowed: a disk with room")
    return count


def _frames_in(file: Path) -> int:
    """How many frames of a movie can be read: on a full disk ffmpeg's binding says nothing of what it did not write."""
    import imageio_ffmpeg

    try:
        return imageio_ffmpeg.count_frames_and_secs(file)[0] or 0
    except RuntimeError:
        return 0
