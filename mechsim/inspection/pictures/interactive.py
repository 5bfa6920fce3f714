"""Interactive 3-D view of a run, in a notebook or as one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kinetics.support.output import write_whole
from mechsim.inspection.pictures.tank import CORNERS, EYE, Paint, face_colours, labels, tank_edges
from mechsim.inspection.poses import Poses

DIGITS = 3  # after the point of a coordinate, in lengths: a file of half the size


def view(poses: Poses, frames: Sequence[int], paint: Paint = "size") -> Any:
    """A plotly figure with a slider over these frames; a notebook shows it as it is."""
    from plotly import graph_objects as go

    triangles = np.arange(6 * len(poses.slots[0]))[:, None] * 4 + np.array([0, 1, 2, 0, 2, 3]).reshape(2, 1, 3)
    i, j, k = triangles.reshape(-1, 3).T

    def cubes(frame: int) -> Any:
        """All faces as two triangles each (all first ones, then all second ones), with corners of their own: so they
        stay flat."""
        turned = np.einsum("cij,fkj->cfki", poses.axes[frame], CORNERS)
        x, y, z = np.round(poses.centres[frame][:, None, None] + 0.5 * poses.edge * turned, DIGITS).reshape(-1, 3).T
        colours = [_css(rgb) for rgb in face_colours(poses, frame, paint).reshape(-1, 3)]
        return go.Mesh3d(
            x=x, y=y, z=z, i=i, j=j, k=k, facecolor=colours * 2, hoverinfo="skip",
            flatshading=True, lighting={"ambient": 0.65, "diffuse": 0.5, "specular": 0.05}, showlegend=False,
        )  # fmt: skip

    walls = np.full((12, 3, 3), np.nan)  # a line breaks at what is no number
    walls[:, :2] = tank_edges(poses.tank / 2)
    x, y, z = walls.reshape(-1, 3).T
    tank = go.Scatter3d(
        x=x, y=y, z=z, mode="lines", line={"color": "#888888", "width": 2}, hoverinfo="skip", showlegend=False
    )
    names = [f"{poses.times[frame]:.4g} tu" for frame in frames]
    named = {frame: labels(poses, frame, paint) for frame in frames}
    # The legend stays, so it names what is there in any frame; how many there are is in the title of each.
    kinds = {label.split(":")[0]: colour for frame in frames for label, colour in named[frame]}
    key = [
        go.Scatter3d(x=[None], y=[None], z=[None], mode="markers", marker={"color": c, "symbol": "square"}, name=kind)
        for kind, c in sorted(kinds.items(), key=lambda kind: (len(kind[0]), kind[0]))
    ]

    def title(frame: int) -> str:
        counts = ", ".join(label for label, _ in named[frame]) if paint == "size" else f"{poses.slots.shape[1]} cubes"
        return f"{poses.name} at {poses.times[frame]:.4g} tu: {counts}"

    figure = go.Figure(
        data=[cubes(frames[0]), tank, *key],
        frames=[
            go.Frame(data=[cubes(frame)], traces=[0], name=name, layout={"title": {"text": title(frame)}})
            for frame, name in zip(frames, names, strict=True)
        ],
    )
    eye = dict(zip("xyz", EYE / np.linalg.norm(EYE) * 2.2, strict=True))
    hidden = {"visible": False}
    figure.update_layout(
        title={"text": title(frames[0]), "font": {"size": 14}},
        scene={"aspectmode": "data", "camera": {"eye": eye}, "xaxis": hidden, "yaxis": hidden, "zaxis": hidden},
        margin={"l": 10, "r": 10, "b": 20, "t": 40},
        sliders=[
            {
                "steps": [{"label": n, "method": "animate", "args": [[n], _at_once(0)]} for n in names],
                "x": 0.15,
                "len": 0.8,
                "pad": {"b": 30},
            }
        ],
        updatemenus=[
            {
                "type": "buttons",
                "direction": "left",
                "x": 0.0,
                "y": 0.0,
                "yanchor": "bottom",
                "buttons": [
                    {"label": "play", "method": "animate", "args": [None, _at_once(80)]},
                    {"label": "stop", "method": "animate", "args": [[None], _at_once(0)]},
                ],
            }
        ],
    )
    return figure


def save_html(poses: Poses, path: str | Path, frames: Sequence[int], paint: Paint = "size") -> None:
    """The view as one file, the library's script within it (5 MB): it opens without a network."""
    page = view(poses, frames, paint).to_html(include_plotlyjs=True, full_html=True, auto_play=False)
    write_whole(path, page)


def _at_once(milliseconds: int) -> dict[str, Any]:
    """How a frame takes the place of another."""
    still = {"duration": 0}
    frame = {"duration": milliseconds, "redraw": True}
    return {"mode": "immediate", "frame": frame, "transition": still, "fromcurrent": True}


def _css(rgb: np.ndarray) -> str:
    return "#" + "".join(f"{round(255 * float(part)):02X}" for part in rgb)
