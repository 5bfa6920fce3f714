"""Hits that three bodies make together, besides contact values of hard bodies."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinetics.rates.breaks import ShapeParameter
from kinetics.rates.crowding.hard_bodies import HardBodies
from kinetics.support.arrays import Floats

THIRD = "third"


class ThreeBody(HardBodies):
    """The factor of `hard-bodies` times 1 + third z, for hits that need a body or wall behind the one that is struck.

    A structure that a wall or another body holds cannot give way when a third body strikes, and takes more of the blow.
    While two bodies touch, for a time tau, a third one of relative speed v arrives within it in proportion to the
    surface of bodies that passes, v z tau / 4 for convex bodies that are large beside the struck one; so hits of three
    come at a rate lambda z times that of two. lambda, a length, grows with the load asked for, since few hits of two
    are so hard. third = lambda / (1 + lambda z_0), with z_0 the surface that walls add, which depends on no crowd.

    >>> from kinetics.rates.crowding import crowding_model
    >>> crowding_model("three-body").terms([0.5], {"third": 1.0}).round(3).tolist()
    [[0.0, 1.0, 1.5, 0.556, 0.056]]
    """

    name = "three-body"
    parameters = (ShapeParameter(THIRD, 0.0, 50.0, 0.1, is_weight=True),)

    def terms(self, contact: Floats, shape: Mapping[str, float]) -> Floats:
        """The powers of z in the contact value times 1 + third z."""
        pairs = np.pad(super().terms(contact, shape), ((0, 0), (0, 1)))
        found = pairs.copy()
        found[:, 2:] += shape[THIRD] * pairs[:, 1:-1]
        return found
