"""Writing pictures as a video: MP4 by ffmpeg, or where that is not there an animated GIF by Pillow. A file appears with its
whole content only."""

from __future__ import annotations

import contextlib
import io
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pgfmd.errors import ResultError
from pgfmd.files.regular_files import bring_to_disk, require_regular, temporary_name_for, write_atomically

if TYPE_CHECKING:
    from PIL.Image import Image

Picture = tuple[NDArray[np.uint8], int]
"""Colours (rows, columns, 3), the same size for all pictures of a video, and for how many frames they are shown."""
FORMATS = (".mp4", ".gif")
CODECS = {
    "libx264": ("-crf", "18", "-preset", "medium"),
    "libopenh264": ("-b:v", "4M"),
    "mpeg4": ("-q:v", "3"),
}
"""What ffmpeg may encode with, the best first, and the options for sharp lines."""
NO_FFMPEG = (
    "no ffmpeg here, so the movie is a GIF: larger, and with fewer colours; install ffmpeg, or pgfmd[movie], for MP4"
)
ALMOST = 12
"""Largest difference of red, green and blue, of 255, of colours that are almost the same."""
GIF_UNIT = 0.01
"""Time [s] in which GIFs count."""


@dataclass(frozen=True)
class Film:
    """What is to be written. pictures: makes them for a number of pixels an inch; dpi: these by format; rate: frames a
    second; colours: (any, 3), those that a format with few colours must have."""

    pictures: Callable[[int], Iterator[Picture]]
    dpi: Mapping[str, int]
    rate: float
    colours: NDArray[np.uint8]


def write_video(path: Path, film: Film) -> tuple[Path, tuple[str, ...]]:
    """Writes a video in the format of its name; an .mp4 without ffmpeg as .gif. Returns the path, and what to say of it.

    Raises:
        ResultError: if it can't be written.
        ValueError: for another format.
    """
    form = path.suffix.lower()
    if form not in FORMATS:
        raise ValueError(f"{path}: expected a name that ends in {' or '.join(FORMATS)}")
    if not path.parent.is_dir():
        # Before the pictures are made, which takes its time.
        raise ResultError(f"{path}: could not be written: there is no folder {path.parent}; name a file in one")
    remarks: tuple[str, ...] = ()
    ffmpeg = find_ffmpeg() if form == ".mp4" else None
    if form == ".mp4" and ffmpeg is None:
        path, form, remarks = path.with_suffix(".gif"), ".gif", (NO_FFMPEG,)
    pictures = film.pictures(film.dpi[form])
    try:
        require_regular(path)
        if ffmpeg is not None:
            _write_mp4(path, pictures, film.rate, ffmpeg)
        else:
            write_atomically(path, _gif(pictures, film.rate, film.colours))
    except OSError as problem:
        raise ResultError(f"{path}: could not be written: {problem.strerror or problem}") from problem
    return path, remarks


def find_ffmpeg() -> str | None:
    """The program on PATH, or that of the package imageio-ffmpeg; None without."""
    found = shutil.which("ffmpeg")
    if found is None:
        with contextlib.suppress(ImportError, RuntimeError):
            from imageio_ffmpeg import get_ffmpeg_exe

            found = get_ffmpeg_exe()
    return found


def _write_mp4(path: Path, pictures: Iterator[Picture], rate: float, ffmpeg: str) -> None:
    first, count = next(pictures)
    rows, columns = first.shape[:2]
    codec = _codec(ffmpeg)
    temporary = temporary_name_for(path)
    # The encoder wants even numbers of pixels; what is added has the colour of the paper.
    even = "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white"
    command = [
        ffmpeg, "-hide_banner", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{columns}x{rows}",
        "-r", f"{rate:g}", "-i", "-", "-an", "-vf", even, "-c:v", codec, *CODECS[codec], "-pix_fmt", "yuv420p",
        "-movflags", "+faststart", "-f", "mp4", "-n", str(temporary),
    ]  # fmt: skip
    try:
        with tempfile.TemporaryFile() as complaints:
            with subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=complaints
            ) as process:
                assert process.stdin is not None
                # If ffmpeg gives up, its own words say why.
                with contextlib.suppress(BrokenPipeError):
                    _feed(process.stdin, first, count)
                    for picture, times in pictures:
                        _feed(process.stdin, picture, times)
                    process.stdin.close()
            if process.returncode:
                complaints.seek(0)
                said = complaints.read().decode(errors="replace").strip().splitlines()
                raise ResultError(f"{path}: could not be written: {ffmpeg}: {said[-1] if said else process.returncode}")
        bring_to_disk(temporary)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _feed(pipe: IO[bytes], picture: NDArray[np.uint8], times: int) -> None:
    content = picture.tobytes()
    for _ in range(times):
        pipe.write(content)


def _codec(ffmpeg: str) -> str:
    """The best encoder that this ffmpeg has."""
    listed = subprocess.run([ffmpeg, "-hide_banner", "-encoders"], capture_output=True, text=True, check=False).stdout
    names = {words[1] for line in listed.splitlines() if len(words := line.split()) > 1}
    # The last is there in any build that can write MP4.
    return next((codec for codec in CODECS if codec in names), "mpeg4")


def _gif(pictures: Iterator[Picture], rate: float, colours: NDArray[np.uint8]) -> bytes:
    """An animated GIF that goes round. All frames have the same colours: `colours`, and the best for the rest."""
    from PIL.Image import Dither, fromarray

    frames, durations, palette = [], [], None
    shown, told = 0, 0
    for values, count in pictures:
        image = fromarray(values)
        if palette is None:
            palette = _palette(image, colours)
        frames.append(image.quantize(palette=palette, dither=Dither.NONE))
        shown += count
        # So that roundings do not add up.
        until = round(shown / rate / GIF_UNIT)
        durations.append(max(until - told, 2) * round(1000 * GIF_UNIT))
        told = max(until, told + 2)
    content = io.BytesIO()
    frames[0].save(content, "GIF", save_all=True, append_images=frames[1:], duration=durations, loop=0, optimize=False)
    return content.getvalue()


def _palette(image: Image, colours: NDArray[np.uint8]) -> Image:
    """An image of which Pillow takes the colours."""
    from PIL.Image import new

    # Paper and ink, which the best colours for the rest come close to but do not meet.
    colours = np.concatenate([colours, np.array([[255] * 3, [0] * 3], dtype=np.uint8)])
    rest = image.quantize(256 - len(colours))
    others = np.array(rest.getpalette(), dtype=np.uint8).reshape(-1, 3)
    # Pillow looks up colours by six bits: of two that are almost the same it may take the wrong one.
    distances = np.abs(others[:, None].astype(int) - colours.astype(int)).max(axis=2)
    others = others[distances.min(axis=1) > ALMOST]
    palette = new("P", (1, 1))
    palette.putpalette(np.concatenate([colours, others]).tobytes())
    return palette
