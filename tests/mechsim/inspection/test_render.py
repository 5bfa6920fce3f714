"""What is drawn from recorded poses: the right faces in the right places, strips, films, a page; damaged poses."""

import re
import sys
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure

from mechsim.inspection.pictures import movie, tank
from mechsim.inspection.poses import Poses, record_at
from mechsim.runs.record import RunRecord, RunSpec, execute
from mechsim.runs.store import RunStore
from wellmixed import main

FAR = np.array([40.0, -30.0, 20.0])


@pytest.fixture(scope="module")
def record(line4):
    return execute(RunSpec(line4, {"monomer": 4, "trimer": 1}, 0.3, seed=1, run=0, poses=0.05))


@pytest.fixture(scope="module")
def poses(record):
    return Poses.of(record)


@pytest.fixture(scope="module")
def stored(record, tmp_path_factory):
    store = RunStore(tmp_path_factory.mktemp("runs"))
    return store.write(record)


def lattice(*places, axes=None):
    """Cubes of edge 0.1 on a lattice, all of one structure."""
    n = len(places)
    own = np.eye(3) if axes is None else axes
    return Poses(
        np.zeros(1), 0.1 * np.array([places], float), np.tile(own, (1, n, 1, 1)), np.zeros((1, n), int),
        np.array([2.0, 2.0, 2.0]), 0.1, ("f1", "f1", "f2", "f2", "f3", "f3"), "made up",
    )  # fmt: skip


def with_arrays(record, **arrays):
    kept = {name: a for name, a in (record.arrays | arrays).items() if a is not None}
    return RunRecord(record.spec, record.outcome, kept, record.facts)


def test_three_faces_of_a_cube_are_seen_and_have_their_type():
    cube = lattice((0, 0, 0))
    polygons, colours = tank.faces_seen(cube, 0, FAR, "type")
    assert polygons.shape == (3, 4, 2)
    wanted = np.array([tank._rgb(tank.FACE_COLOURS[kind]) for kind in ("f1", "f2", "f3")])
    for colour in colours:  # shaded, but of the same hue
        assert np.isclose(colour / colour.max(), wanted / wanted.max(axis=1, keepdims=True)).all(axis=1).sum() == 1


def test_polygons_are_the_convex_outlines_of_faces():
    """Corners go round: the shoelace areas of the seen faces add up to that of the cube's silhouette."""
    from scipy.spatial import ConvexHull

    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    cube = lattice((0, 0, 0), axes=turn)
    polygons, _ = tank.faces_seen(cube, 0, FAR, "size")
    x, y = polygons[..., 0], polygons[..., 1]
    areas = 0.5 * np.abs((x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1)).sum(axis=1))
    corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) * 0.05 @ turn.T
    np.testing.assert_allclose(areas.sum(), ConvexHull(tank._project(corners, FAR)).volume, rtol=1e-12)


def test_nearer_cubes_are_painted_later():
    """Of a block of cubes, no face that is painted may be covered by a cube painted before it: a ray decides."""
    places = [(i, j, k) for i in range(3) for j in range(3) for k in range(2)]
    block = lattice(*places)
    eye = np.array([0.9, -0.7, 0.8])
    order = np.argsort(-np.linalg.norm(block.centres[0] - eye, axis=1), kind="stable").tolist()
    for at, cube in enumerate(order):
        ray = block.centres[0, cube] - eye
        for later in order[:at]:  # painted before `cube`: must not stand between it and the eye
            inverse = 1 / ray
            low, high = np.sort([(block.centres[0, later] + s * 0.0499 - eye) * inverse for s in (-1, 1)], axis=0)
            enters = low.max()
            assert not (enters < high.min() and 0 < enters < 1 - 0.05 / np.linalg.norm(ray))


def test_axis_edges_of_the_tank_lie_before_or_behind():
    edges = np.array(tank.tank_edges(np.ones(3)))
    assert len(edges) == 12
    behind = tank._far_edges(edges, FAR)
    assert behind.sum() == 3  # those that meet in the furthest corner
    np.testing.assert_array_equal((edges[behind] == -np.sign(FAR)).all(axis=2).any(axis=1), True)


def test_a_tank_tells_its_structures_and_its_faces(record):
    ax = tank.draw_tank(record, Figure().add_subplot())
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["1 cube: 4", "3 cubes: 1"]
    assert ax.get_title().startswith("line4, 7 cubes at 0.3 tu")
    ax = tank.draw_tank(record, Figure().add_subplot(), frame=0, paint="type")
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["f1", "f2"]


def test_frames_are_spread_with_both_ends(poses):
    assert poses.spread(3).tolist() == [0, 3, 6]
    assert poses.spread(1).tolist() == [0]
    assert poses.spread(99).tolist() == list(range(7))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pose_times": None, "centres": None, "axes": None, "slots": None}, "no poses were recorded"),
        ({"axes": None}, "it lacks axes"),
        ({"centres": np.zeros((7, 6, 3))}, "centres has shape"),
        ({"centres": np.full((7, 7, 3), np.nan)}, "not finite"),
        ({"axes": np.zeros((7, 7, 3, 3))}, "length one"),
        ({"slots": np.full((7, 7), 7)}, "from 0 to 6"),
        ({"slots": np.zeros((7, 7))}, "whole numbers"),
        ({"pose_times": np.arange(7.0)[::-1]}, "ascend"),
        ({"pose_times": np.arange(6.0)}, "damaged"),
        ({"pose_times": np.array(list("abcdefg"))}, "not finite"),
    ],
)
def test_damaged_poses_are_told_apart_from_none(record, change, message):
    with pytest.raises(ValueError, match=message):
        Poses.of(with_arrays(record, **change))


def test_a_stored_run_is_found_by_its_file_and_its_key(record, stored):
    assert record_at(str(stored), "nowhere").digest == record.digest
    assert record_at(record.spec.key[:6], stored.parent).spec == record.spec
    for name in ("zz", "", "*", "../nowhere"):
        with pytest.raises(ValueError, match="holds no runs"):
            record_at(name, stored.parent)


def test_a_damaged_file_is_named_and_left_alone(stored, tmp_path):
    broken = tmp_path / "broken.run"
    broken.write_bytes(stored.read_bytes()[:-1])
    with pytest.raises(ValueError, match=r"broken\.run is damaged"):
        record_at(str(broken), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["broken.run"]


def test_strip(stored, tmp_path):
    out = tmp_path / "strip.png"
    done = CliRunner().invoke(
        main, ["runs", "render", str(stored), "--out", str(out), "--frames", "3", "--faces", "--json"]
    )
    assert done.exit_code == 0, done.output
    from matplotlib.image import imread

    assert imread(out).shape[1] > 2 * imread(out).shape[0]


def test_gif_shows_all_frames_on_white(stored, tmp_path):
    from PIL import Image

    out = tmp_path / "film.gif"
    done = CliRunner().invoke(main, ["runs", "render", str(stored), "--out", str(out), "--fps", "10", "--quiet"])
    assert done.exit_code == 0, done.output
    with Image.open(out) as film:
        assert (film.n_frames, film.size, film.info["duration"]) == (7, (640, 640), 100)
        film.seek(4)
        assert film.convert("RGB").getpixel((2, 2)) == (255, 255, 255)


def test_mp4_shows_all_frames(poses, tmp_path):
    reader = pytest.importorskip("imageio_ffmpeg")
    movie.save_mp4(movie.images(poses, [0, 3, 6]), tmp_path / "film.mp4", fps=5)
    frames, seconds = reader.count_frames_and_secs(tmp_path / "film.mp4")
    assert (frames, seconds) == (3, pytest.approx(0.6))


def test_page_needs_nothing_else(stored, tmp_path):
    pytest.importorskip("plotly")
    out = tmp_path / "view.html"
    done = CliRunner().invoke(main, ["runs", "render", str(stored), "--out", str(out), "--frames", "2"])
    assert done.exit_code == 0, done.output
    page = out.read_text(encoding="utf-8")
    assert not re.search(r"<(script|link)[^>]*(src|href)=", page)
    assert "0.1496 tu" not in page
    assert '"label":"0 tu"' in page


def test_the_view_has_twelve_triangles_a_cube(poses):
    pytest.importorskip("plotly")
    from mechsim.inspection.pictures.interactive import view

    figure = view(poses, [0, 6], "type")
    mesh = figure.data[0]
    assert (len(mesh.x), len(mesh.i), len(mesh.facecolor)) == (7 * 24, 7 * 12, 7 * 12)
    corners = np.column_stack([mesh.x, mesh.y, mesh.z])
    a, b, c = (corners[np.array(getattr(mesh, name))] for name in "ijk")
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    np.testing.assert_allclose(areas, 0.15**2 / 2, rtol=0.03)  # coordinates are rounded
    outward = np.cross(b - a, c - a) / (2 * areas[:, None])
    own = np.einsum("tij,tj->ti", poses.axes[0][np.array(mesh.i) // 24].transpose(0, 2, 1), outward)
    face = np.array(poses.face_types)[[2 * k + (o[k] < 0) for o in own for k in [int(np.argmax(abs(o)))]]]
    assert {(f, colour) for f, colour in zip(face.tolist(), mesh.facecolor, strict=True)} == {
        (name, tank.FACE_COLOURS[name].upper()) for name in ("f1", "f2")
    }
    assert len(figure.frames) == 2
    by_size = view(poses, [0, 6])
    assert by_size.layout.title.text == "line4 at 0 tu: 1 cube: 4, 3 cubes: 1"
    assert [trace.name for trace in by_size.data[2:]] == ["1 cube", "3 cubes"]


@pytest.mark.parametrize(("kind", "package"), [("mp4", "imageio_ffmpeg"), ("html", "plotly")])
def test_a_missing_library_is_named(stored, tmp_path, monkeypatch, kind, package):
    monkeypatch.delitem(sys.modules, "plotly.graph_objects", raising=False)
    monkeypatch.setitem(sys.modules, package, None)
    out = tmp_path / f"x.{kind}"
    done = CliRunner().invoke(main, ["runs", "render", str(stored), "--out", str(out)])
    assert done.exit_code == 2
    assert "pip install '" in done.output
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--out", "x.txt"], "must end in"),
        (["--out", "nowhere/x.png"], "does not exist"),
        (["--out", "x.gif", "--frames", "0"], "frames"),
    ],
)
def test_bad_requests(stored, arguments, message):
    done = CliRunner().invoke(main, ["runs", "render", str(stored), *arguments])
    assert done.exit_code == 2
    assert message in done.output


def test_a_run_without_poses_cannot_be_shown(record, tmp_path):
    spec = replace(record.spec, poses=None)
    arrays = {name: record.arrays[name] for name in ("initial", "times", "channels")}
    path = RunStore(tmp_path).write(RunRecord(spec, record.outcome, arrays, record.facts))
    done = CliRunner().invoke(main, ["runs", "render", str(path), "--out", str(tmp_path / "x.png")])
    assert done.exit_code == 2
    assert "simulate --poses" in done.output
