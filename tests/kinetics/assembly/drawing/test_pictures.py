"""Pictures of structures: what is in front hides what is behind, and every file is the same each time."""

import re
import xml.etree.ElementTree as ET
from collections import Counter
from itertools import product

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.path import Path

from kinetics.assembly import FACE_NORMALS, SCHEMES, Placement, RuleBook, Structure, derive
from kinetics.assembly.drawing.pictures import (
    CAMERA,
    FACE_COLOURS,
    Camera,
    posed,
    shaded,
    species_sheet,
    strip,
    structure_drawing,
)

LINE4, T5, PYRAMID = (RuleBook.load(name) for name in ("line4", "t5", "pyramid45"))
CAMERAS = [CAMERA, Camera(30, 20), Camera(135, 60), Camera(-130, -40), Camera(0, 0), Camera(45, 35.264389682754654)]


def structure(places, letters=None):
    n = len(places)
    return Structure(tuple(places), (0,) * n, tuple(letters or "a" * n))


def random_polycube(rng, n):
    places = [(0, 0, 0)]
    while len(places) < n:
        place = tuple(np.add(places[rng.integers(len(places))], FACE_NORMALS[rng.integers(6)]).tolist())
        if place not in places:
            places.append(place)
    return structure(places)


def nearest_face(places, spot, camera):
    """The (cube, direction) of all six faces of all cubes that the eye meets first at a point of the picture."""
    right, up = camera.screen
    start, towards = spot[0] * right + spot[1] * up, camera.towards
    met = []
    for cube, direction in product(range(len(places)), range(6)):
        normal = FACE_NORMALS[direction]
        slope = normal @ towards
        if abs(slope) < 1e-12:
            continue
        distance = normal @ (np.array(places[cube]) + normal / 2 - start) / slope
        offset = np.abs(start + distance * towards - places[cube] - normal / 2)
        if (offset <= 0.5 + 1e-12).all():
            met.append((distance, (cube, direction)))
    return max(met)[1] if met else None


def painted_last(drawing, spot):
    """The face that was painted last over a point."""
    found = None
    for shape in drawing.shapes:
        if shape.tag and shape.tag[0] == "face" and Path(shape.points, shape.codes).contains_point(spot):
            found = shape.tag[1:]
    return found


@pytest.mark.parametrize("camera", CAMERAS)
def test_what_is_in_front_hides_what_is_behind(camera):
    rng = np.random.default_rng(1)
    for n in (2, 5, 9, 14):
        shape = random_polycube(rng, n)
        drawing = structure_drawing(shape, camera=camera)
        left, bottom, right, top = drawing.bounds
        for spot in rng.uniform((left, bottom), (right, top), size=(60, 2)):
            assert painted_last(drawing, spot) == nearest_face(shape.positions, spot, camera)


def test_painting_in_another_order_is_seen_to_be_wrong():
    """The control of the test above."""
    drawing = structure_drawing(PYRAMID.target)
    drawing.shapes.reverse()
    left, bottom, right, top = drawing.bounds
    spots = np.random.default_rng(1).uniform((left, bottom), (right, top), size=(60, 2))
    wrong = [painted_last(drawing, s) != nearest_face(PYRAMID.target.positions, s, CAMERA) for s in spots]
    assert sum(wrong) > 10


def test_every_outer_face_towards_the_eye_is_painted_once():
    drawn = Counter(s.tag for s in structure_drawing(PYRAMID.target).shapes if s.tag and s.tag[0] == "face")
    target = PYRAMID.target
    expected = {
        ("face", cube, direction)
        for cube, place in enumerate(target.positions)
        for direction in (0, 3, 4)
        if target.cube_at(tuple(np.add(place, FACE_NORMALS[direction]).tolist())) is None
    }
    assert set(drawn) == expected
    assert set(drawn.values()) == {1}


def test_letters_stand_where_nothing_hides_them():
    rng = np.random.default_rng(2)
    for shape in (random_polycube(rng, 9), random_polycube(rng, 14), PYRAMID.target):
        drawing = structure_drawing(shape, labels=[str(cube) for cube in range(len(shape))])
        assert len({words.text for words in drawing.words}) == len(drawing.words) > 5
        for text, (left, bottom, right, top) in drawing.words:
            cube, _ = nearest_face(shape.positions, ((left + right) / 2, (bottom + top) / 2), CAMERA)
            assert str(cube) == text


def test_a_line_shows_all_its_letters_however_it_lies():
    for rotation in range(24):
        line = LINE4.target.moved(Placement(rotation, (3, -1, 2)))
        assert sorted(words.text for words in structure_drawing(posed(line)).words) == list("bbdd")


def test_long_letters_fit_onto_their_face():
    drawing = structure_drawing(structure([(0, 0, 0)], ["finished"]))
    face = next(s for s in drawing.shapes if s.tag == ("face", 0, 3))
    outline = next(s for s in drawing.shapes if s.tag == ("text", "finished"))
    assert Path(face.points, face.codes).contains_points(outline.points).all()


def test_face_types_have_their_colours():
    types = SCHEMES["six"].types
    for shape in structure_drawing(structure([(0, 0, 0)]), scheme="six").shapes:
        if shape.tag[0] == "face":
            assert shape.fill == shaded(FACE_COLOURS[types[shape.tag[2]]], shape.tag[2])


def test_letters_are_legible_and_colours_differ_without_hue_vision():
    """Black on each face has the contrast that WCAG 2 asks of large text (3); types differ for deuteranopes too."""
    # Machado, Oliveira & Fernandes (2009), deuteranomaly of severity 1
    deutan = np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    )
    for direction in (0, 3, 4):
        seen = {}
        for name, colour in FACE_COLOURS.items():
            rgb = np.array(to_rgb(shaded(colour, direction)))
            linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
            assert (linear @ (0.2126, 0.7152, 0.0722) + 0.05) / 0.05 > 3
            seen[name] = deutan @ linear
        for first, second in product(seen, repeat=2):
            assert first == second or np.abs(seen[first] - seen[second]).max() > 0.05


def test_highlight_and_legend():
    drawing = structure_drawing(T5.target, highlight=[4])
    assert {shape.tag[1] for shape in drawing.shapes if shape.tag[0] == "rim"} == {4}
    sheet = species_sheet(derive(T5).structures)
    texts = [words.text for words in sheet.words]
    assert {"monomer", "trimer.c", "pentamer", "f1", "f2"} <= set(texts)


def test_nothing_overlaps_in_a_strip():
    frames = [LINE4.target, T5.target, structure([(0, 0, 0)])]
    made = strip(frames, ["a caption much longer than its picture is wide", "t = 12.5 tu", "end"], most_wide=9)
    captions = [words for words in made.words if len(words.text) > 1]
    assert len(captions) == 3
    for first, second in product(captions, repeat=2):
        (a, b, c, d), (e, f, g, h) = first.box, second.box
        assert first is second or c < e or g < a or d < f or h < b


@pytest.mark.parametrize("suffix", [".svg", ".png", ".pdf"])
def test_the_same_drawing_gives_the_same_bytes(tmp_path, suffix):
    for name in ("one", "two"):
        structure_drawing(T5.target).save(str(tmp_path / (name + suffix)))
    one, two = ((tmp_path / (name + suffix)).read_bytes() for name in ("one", "two"))
    assert one == two
    if suffix == ".svg":
        ET.fromstring(one)  # well-formed
        assert not re.search(rb"<dc:date>", one)


def test_a_structure_plots_itself_onto_given_axes():
    ax = Figure().add_subplot()
    assert T5.target.plot(ax, highlight=[0]) is ax
    assert len(ax.collections) == 1
    assert ax.get_aspect() == 1


def test_wrong_input():
    for camera in ((np.nan, 0), (0, 91)):
        with pytest.raises(ValueError, match="expected finite degrees"):
            Camera(*camera)
    with pytest.raises(ValueError, match="labels has 1 texts for 5 cubes"):
        structure_drawing(T5.target, labels=["a"])
    with pytest.raises(ValueError, match="highlight names cube 5"):
        structure_drawing(T5.target, highlight=[5])
    with pytest.raises(ValueError, match="unknown face scheme"):
        structure_drawing(T5.target, scheme="three")
    with pytest.raises(ValueError, match="captions has 1 entries for 2"):
        strip([T5.target, T5.target], ["x"])
    with pytest.raises(ValueError, match="no structure"):
        strip([])
