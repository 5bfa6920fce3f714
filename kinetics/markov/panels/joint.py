"""Several sets of data with one model: groups with parameters of their own, or data of several kinds."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from kinetics.markov.panels.base import Likelihood, Observed, Scored
from kinetics.network import Model
from kinetics.support.answer import Answer, weakest


@dataclass(frozen=True, eq=False)
class JointLikelihood(Likelihood):
    """The log-likelihood of independent sets of data: the sum of theirs.

    parts : by the name of the group or set, all with one model
    own : parameters of which each part has its own, called `k[part]`; all others are shared

    ValueError: no parts, or a parameter that the model lacks

    >>> from kinetics import Model, Network
    >>> from kinetics.markov.panels import JointLikelihood, PanelData, PanelLikelihood, PanelRun
    >>> decay = Model.of(Network.from_text("A -> B, k", k=1))
    >>> part = {n: PanelLikelihood(decay, PanelData({"A": {"A": 1}}, [PanelRun([9, 0], [1.0], [[n]])])) for n in (3, 5)}
    >>> both = JointLikelihood({"warm": part[3], "cold": part[5]}, own=["k"])
    >>> both.usually_free, round(both.value({"k[warm]": 1.1, "k[cold]": 0.6}).value, 6)
    (('k[warm]', 'k[cold]'), -2.645015)
    """

    parts: Mapping[str, Likelihood]
    own: Sequence[str] = ()

    def __post_init__(self) -> None:
        if not self.parts:
            raise ValueError("no data: there is nothing to learn from")
        known = next(iter(self.parts.values())).parameters
        for name in self.own:
            if name not in known:
                raise ValueError(f"unknown parameter {name!r}; expected one of {', '.join(known)}")

    @property
    def model(self) -> Model:  # type: ignore[override]
        """The model of all parts."""
        return next(iter(self.parts.values())).model

    @property
    def groups(self) -> Mapping[str, Likelihood]:
        """The parts."""
        return self.parts

    @property
    def size(self) -> dict[str, Any]:
        """The numbers of all parts together."""
        found: dict[str, Any] = {}
        for part in self.parts.values():
            for name, value in part.size.items():
                found[name] = value if isinstance(value, dict) else found.get(name, 0) + value
        return found

    @property
    def longest(self) -> float:
        """The time, tu, of the longest run of all."""
        return max(part.longest for part in self.parts.values())

    @property
    def data_digest(self) -> str:
        """SHA-256 of the data of all parts."""
        told = sorted(each.data_digest for each in self.parts.values())
        return hashlib.sha256(repr(told).encode()).hexdigest()

    @cached_property
    def observed(self) -> Mapping[str, Observed]:
        """The parameters of observations, and those that each part has for itself: a model takes neither."""
        found: dict[str, Observed] = {}
        for part, likelihood in self.parts.items():
            for name, value in likelihood.parameters.items():
                most = likelihood.observed[name].most if name in likelihood.observed else np.inf
                if name in self.own:
                    found[f"{name}[{part}]"] = Observed(value, most)
                elif name in likelihood.observed:
                    found[name] = likelihood.observed[name]
        return found

    @property
    def parameters(self) -> dict[str, float]:
        """Name -> value of all that may be free."""
        whole: dict[str, float] = {}
        for part in self.parts.values():
            whole |= part.parameters
        shared = {name: value for name, value in whole.items() if name not in self.own}
        return {**shared, **{name: each.value for name, each in self.observed.items()}}

    @property
    def usually_free(self) -> tuple[str, ...]:
        """The parameters of the model; several, one for each part, if each part has its own."""
        return self.each(next(iter(self.parts.values())).usually_free)

    def each(self, names: Sequence[str]) -> tuple[str, ...]:
        """Parameters of the model as they are called here: several for one of which each part has its own."""
        return tuple(dict.fromkeys(self.called(name, part) for name in names for part in self.parts))

    def scored(self, point: Mapping[str, float] | None, names: Sequence[str]) -> Scored:
        """The log-likelihood and its derivatives by the logarithms of the parameters `names`."""
        answers, gradient = [], np.zeros(len(names))
        for part, likelihood in self.parts.items():
            here = {self.called(name, part): name for name in likelihood.parameters}
            places = [p for p, name in enumerate(names) if name in here]
            found = likelihood.scored(self.point_of(part, point or {}), [here[names[p]] for p in places])
            answers.append(found.answer)
            gradient[places] += found.gradient
        value, low, high, seconds = (
            sum(getattr(each, field) for each in answers) for field in ("value", "low", "high", "cpu_seconds")
        )
        why = f"{len(answers)} sets of data"
        return Scored(Answer(value, low, high, weakest(*answers), answers[0].method, seconds, why), gradient)

    def shared(self, name: str) -> str:
        """What a parameter is called where groups share it."""
        return next((each for each in self.own for part in self.parts if name == self.called(each, part)), name)

    def called(self, name: str, part: str) -> str:
        """What a parameter of a part is called here."""
        return f"{name}[{part}]" if name in self.own else name

    def point_of(self, part: str, point: Mapping[str, float]) -> dict[str, float]:
        """The values of the parameters of a part."""
        names = {self.called(name, part): name for name in self.parts[part].parameters}
        return {names[name]: value for name, value in point.items() if name in names}
