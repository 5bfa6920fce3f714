"""Rates files of the line of four under every break model."""

import numpy as np

from kinetics.assembly import RuleBook, derive
from kinetics.rates import Rates
from kinetics.rates.breaks import BREAK_MODELS, break_model

LINE = derive(RuleBook.load("line4"))
SHAPES = {law.name: {p.name: p.start for p in law.parameters(LINE.network)} for law in BREAK_MODELS}


def rates_file(model, events=10, **changes):
    """Every channel at 1e-3 with 10 events, of breaks 4 exposures and one to the wall; three points of the shape."""
    law, channels = break_model(model), {}
    weights = law.weights(LINE.network, SHAPES[model])
    for name, ways, order in zip(
        LINE.network.channels, LINE.network.ways, LINE.network.reactants.sum(axis=1), strict=True
    ):
        channels[name] = {"rate": 1e-3, "ways": ways, "events": events, "exposure": 1e4}
        if order == 1 and model != "first-order":
            exposures = np.array([500.0, 300.0, 200.0, 100.0, 50.0])[: weights.size]
            channels[name] |= {"exposures": exposures.tolist(), "exposure": float(weights @ exposures)}
    shape = SHAPES[model]
    breaks = {"model": model, "shape": shape}
    if shape:
        points = [[value * factor for value in shape.values()] for factor in (0.5, 1.0, 1.5)]
        breaks["posterior"] = {"points": points, "weights": [0.25, 0.5, 0.25]}
    data = {"convention": {"combinations": "distinct"}, "tank": [2, 2, 3], "channels": channels, "breaks": breaks}
    return Rates(**data | changes)
