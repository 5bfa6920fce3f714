"""Strips of pictures, animated GIFs and MP4 films of a run, from its recorded poses."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kinetics.support.output import write_whole
from kinetics.support.packages import backend_agg, mpl
from kinetics.support.plots import save
from mechsim.inspection.pictures.tank import Paint, draw_frame
from mechsim.inspection.poses import Poses

WIDTH, HEIGHT = 640, 640  # px of a film; H.264 wants them even
DPI = 100
PANEL = (3.0, 3.6)  # inches of a picture in a strip


def draw_strip(poses: Poses, figure: Any, frames: Sequence[int], paint: Paint = "size") -> Any:
    """These frames side by side, each with its time; returns the figure."""
    figure.clear()
    for ax, frame in zip(np.atleast_1d(figure.subplots(1, len(frames))), frames, strict=True):
        draw_frame(poses, ax, frame, paint, legend=frame == frames[-1])
        ax.set_title(f"{poses.times[frame]:.4g} tu", fontsize=9)
    figure.suptitle(f"{poses.name}, {poses.slots.shape[1]} cubes", fontsize=10)
    return figure


def save_strip(poses: Poses, path: str | Path, frames: Sequence[int], paint: Paint = "size") -> None:
    """The strip as PNG, PDF or SVG."""
    size = (PANEL[0] * len(frames) + 1.3, PANEL[1])
    save(str(path), lambda ax: draw_strip(poses, ax.figure, frames, paint), size=size)


def images(
    poses: Poses, frames: Sequence[int], paint: Paint = "size", tell: Callable[[int], object] = lambda _: None
) -> Iterator[np.ndarray]:
    """The frames as RGB pictures (HEIGHT, WIDTH, 3), uint8; `tell` hears how many are done."""
    figure = mpl.figure.Figure(figsize=(WIDTH / DPI, HEIGHT / DPI), dpi=DPI)
    canvas = backend_agg.FigureCanvasAgg(figure)
    for done, frame in enumerate(frames, 1):
        figure.clear()
        # A place of its own for the legend: the tank must not move when a line is added to that.
        draw_frame(poses, figure.add_axes((0.02, 0.02, 0.74, 0.92)), frame, paint)
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba())[:, :, :3].copy()
        tell(done)


def save_gif(pictures: Iterator[np.ndarray], path: str | Path, fps: float) -> None:
    """An animated GIF that runs for ever."""
    from PIL import Image

    films = [Image.fromarray(picture) for picture in pictures]
    # Colours chosen once, from pictures of the whole film, so that nothing flickers and what comes late has its own;
    # without dithering, whose noise would not compress.
    some = films[:: max(1, len(films) // 8)] + films[-1:]
    sheet = Image.new("RGB", (WIDTH, HEIGHT * len(some)))
    for row, picture in enumerate(some):
        sheet.paste(picture, (0, HEIGHT * row))
    palette = sheet.quantize(255, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    # Paper stays white: the search for the nearest colour is coarse, so no other may be close to it.
    chosen = np.array(palette.getpalette() or [], np.uint8).reshape(-1, 3)
    chosen[chosen.min(axis=1) > 240] = 255
    palette.putpalette([*chosen.ravel().tolist(), 255, 255, 255][: 3 * 256])
    few = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in films]
    film = io.BytesIO()
    few[0].save(film, "GIF", save_all=True, append_images=few[1:], duration=round(1000 / fps), loop=0, optimize=False)
    write_whole(path, film.getvalue())


def save_mp4(pictures: Iterator[np.ndarray], path: str | Path, fps: float) -> None:
    """An H.264 film that any player shows."""
    import imageio_ffmpeg

    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "film.mp4"
        film = imageio_ffmpeg.write_frames(made, (WIDTH, HEIGHT), fps=fps, codec="libx264", macro_block_size=2)
        film.send(None)
        try:
            for picture in pictures:
                film.send(np.ascontiguousarray(picture))
        finally:
            film.close()
        write_whole(path, made.read_bytes())
