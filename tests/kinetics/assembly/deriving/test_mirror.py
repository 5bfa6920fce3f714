"""Mirror images: what rules cannot see is the same to them, what has another shape is not."""

from itertools import product
from pathlib import Path

import pytest

from kinetics.assembly import RuleBook, Structure, check
from kinetics.assembly.deriving import mirror
from kinetics.assembly.deriving.mirror import mirrored, same_to_rules

BLOCK = tuple(product(range(2), repeat=3))
SCREW = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1))


def upright(places, letters):
    return Structure(places, (0,) * len(places), tuple(letters))


@pytest.mark.parametrize("scheme", ["one", "two"])
def test_letters_in_mirror_image_are_the_same_to_rules(scheme):
    """A lettered block is its own mirror image in shape, but not in letters."""
    block = upright(BLOCK, "abcdefgh")
    image = mirrored(block)
    assert image.canonical(scheme) != block.canonical(scheme)
    assert same_to_rules(image, block, scheme)
    assert same_to_rules(image.turned(7), block, scheme)
    assert not same_to_rules(upright(BLOCK, "bacdefgh"), block, scheme)
    assert not same_to_rules(upright(BLOCK[:4], "abcd"), block, scheme)


def test_six_faces_tell_left_from_right():
    block = upright(BLOCK, "abcdefgh")
    assert same_to_rules(block.turned(5), block, "six")
    assert not same_to_rules(mirrored(block), block, "six")


def test_another_hand_is_another_shape():
    """A screw has a left and a right hand, whatever its letters."""
    for letters in ("aaaa", "abba", "abcd"):
        screw = upright(SCREW, letters)
        assert mirrored(mirrored(screw)) == screw
        assert not same_to_rules(mirrored(screw), screw, "one")
        assert not same_to_rules(mirrored(screw), screw, "two")


def test_a_growth_may_end_in_either_image(monkeypatch):
    """The cube of eight grown from a corner (R3 of the review): two ends, each the mirror image of the other."""
    book = RuleBook.load(Path(__file__).with_name("block_in_two_images.toml"))
    report = check(book)
    assert report.findings == ()
    assert report.recoverability.searched == (8,)
    monkeypatch.setattr(mirror, "LEFT_AND_RIGHT", ("two", "six"))  # the control: as if the images were told apart
    assert [finding.kind for finding in check(book).findings if finding.is_error] == ["dead end", "trap"]
