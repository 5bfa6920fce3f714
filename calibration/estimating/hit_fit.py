"""The fit of a model of crowding to logged hits or joins.

Events are Poisson with mean b w E: b a rate constant for each struck species (or join) and engine, w = size^alpha the
weight of a partner and E the exposure under the model of crowding. Given alpha and the parameter of the model, the
rates of largest likelihood are events over exposure.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calibration.estimating.hits import Source
from calibration.estimating.shape_search import least
from kinetics.rates.breaks import ShapeParameter
from kinetics.rates.breaks.collision import EXPONENT
from kinetics.rates.crowding import THIRD
from kinetics.support.arrays import Floats, Ints, divided
from kinetics.support.packages import optimize, special

TINY = 1e-12  # of a share that the parameters make impossible
DROP = 1.92  # of log-likelihood, at the limits of a 95 % interval of one parameter
# Of the coincidences, see `HitFit`; in the unit of length and its inverse.
COINCIDENCES = (
    ShapeParameter("reach", 0.0, 10.0, 0.1, is_weight=True),
    ShapeParameter("beyond", 0.0, 10.0, 0.3, is_weight=True),
)


@dataclass(frozen=True, eq=False)
class HitFit:
    """A model of crowding fitted to the events of one source.

    seen (n, G, P, 2) : events in n runs, alone and shared
    around (n, G, P) : mean surface density z of bodies at the meetings
    exposure : value of the model's parameter -> exposures (n, G, P)
    parameter : of the model; None if it has none
    held : values that are not searched for, by name
    values : all values, at the largest likelihood
    scatter : variance of counts between runs of one tank over that of Poisson counts, at least 1

    Besides the counts, the shares of hits that other bodies shared are used, if `held` or `values` have a reach. Hits
    of three bodies, in units of those of two, are lambda (z + beyond), where `beyond` is the surface that walls add,
    and all are shared. Of ordinary hits a share reach (z + beyond) is shared too, because a third body happens to touch
    in that step. So shared hits beyond coincidence are hits of three. The parameter `third` of a model of crowding is
    lambda / (1 + lambda beyond), since the rates take up the rest.
    """

    source: Source
    seen: Ints
    around: Floats
    exposure: Callable[[float], Floats]
    parameter: ShapeParameter | None
    held: dict[str, float]
    values: dict[str, float]
    scatter: float = 1.0

    @classmethod
    def of(
        cls,
        source: Source,
        seen: Ints,
        around: Floats,
        exposure: Callable[[float], Floats],
        parameter: ShapeParameter | None = None,
        held: Mapping[str, float] | None = None,
    ) -> HitFit:
        """The fit of largest likelihood."""
        known = dict(held or {})
        searched = [EXPONENT] if len(np.unique(source.sizes)) > 1 else []
        searched += [] if parameter is None else [parameter]
        searched += [] if source.name == "joins" else COINCIDENCES
        free = [p for p in searched if p.name not in known]
        start = cls(source, seen, around, exposure, parameter, known, {p.name: p.start for p in searched} | known)

        def costs(table: Floats) -> Floats:
            return np.array([-start.at(dict(zip((p.name for p in free), row, strict=True))).value for row in table])

        names = [p.name for p in free]
        if not seen.any():
            return start.at({p.name: p.low for p in free})
        if parameter is None or parameter.name in known:
            return start.at(dict(zip(names, least(free, [p.start for p in free], costs), strict=True)))
        # The search starts at the model without the effect, so that the fit cannot be worse than that one.
        without = cls.of(source, seen, around, exposure, parameter, known | {parameter.name: parameter.low})
        begin = [parameter.start if name == parameter.name else without.values[name] for name in names]
        found = start.at(dict(zip(names, least(free, begin, costs), strict=True)))
        return found if found.value >= without.value else replace(without, held=known)

    def at(self, values: Mapping[str, float]) -> HitFit:
        """The fit with some values as given."""
        return replace(self, values=self.values | dict(values))

    @property
    def theta(self) -> float:
        """Value of the model's parameter; 0 without one."""
        return 0.0 if self.parameter is None else self.values[self.parameter.name]

    @property
    def coincidence(self) -> dict[str, float]:
        """Reach and beyond; empty for joins."""
        return {p.name: self.values[p.name] for p in COINCIDENCES if p.name in self.values}

    @cached_property
    def expected(self) -> Floats:
        """Events expected (n, G, P): exposures times the rates of largest likelihood."""
        weighted = self.exposure(self.theta) * self.source.sizes ** self.values.get("alpha", 0.0)
        engine = np.unique([run.engine for run in self.source.runs], return_inverse=True)[1]
        found = np.zeros((2, int(engine.max()) + 1, weighted.shape[1]))
        np.add.at(found[0], engine, self.seen.sum(axis=(2, 3)))
        np.add.at(found[1], engine, weighted.sum(axis=2))
        return np.asarray(weighted * divided(*found)[engine][:, :, None])

    @cached_property
    def of_counts(self) -> float:
        """Logarithm of the Poisson likelihood of the counts, up to a term that all models share."""
        return float((special.xlogy(self.seen.sum(axis=3), self.expected) - self.expected).sum())

    @property
    def of_shares(self) -> float:
        """Logarithm of the binomial likelihood of which hits were shared, given the counts; 0 for joins."""
        if "reach" not in self.values:
            return 0.0
        reach, beyond, third = self.values["reach"], self.values["beyond"], self.values.get(THIRD, 0.0)
        rest = max(1.0 - third * beyond, 0.0)  # 1 / (1 + lambda beyond)
        crowd = self.around + beyond
        share = np.clip(divided((reach * rest + third) * crowd, rest + third * crowd), TINY, 1.0 - TINY)
        alone, shared = self.seen[..., 0], self.seen[..., 1]
        return float((special.xlogy(shared, share) + special.xlog1py(alone, -share)).sum())

    @property
    def value(self) -> float:
        """Log-likelihood of counts and shares."""
        return self.of_counts + self.of_shares

    @property
    def aic(self) -> float:
        """Akaike's criterion, the log-likelihood over the scatter (QAIC: Lebreton et al. 1992, doi:10.2307/2937171).

        Rates and partner weights, of which all models have as many, are not counted.
        """
        return 2 * (self.parameter is not None) - 2 * self.value / self.scatter

    @cached_property
    def interval(self) -> tuple[float, float]:
        """95 % limits of the model's parameter by its profile likelihood, widened by the scatter between runs.

        ValueError: a model without a parameter.
        """
        if self.parameter is None:
            raise ValueError("this model of crowding has no parameter; ask for the interval of one that has")
        only, top = self.parameter, self.value

        def short(value: float) -> float:
            held = self.held | {only.name: value}
            profile = HitFit.of(self.source, self.seen, self.around, self.exposure, only, held)
            return top - profile.value - DROP * self.scatter

        low, high = (
            float(optimize.brentq(short, self.theta, end)) if short(end) > 0 else end for end in (only.low, only.high)
        )
        return low, high

    @property
    def own_scatter(self) -> float:
        """The scatter of these counts: Pearson's statistic within tanks over its degrees of freedom.

        McCullagh & Nelder, Generalized Linear Models, 1989, section 4.5.
        """
        kind = self.source.kinds[1]
        seen, mean = self.seen.sum(axis=(2, 3)).astype(float), self.expected.sum(axis=2)
        whole = np.zeros((2, int(kind.max()) + 1, seen.shape[1]))
        np.add.at(whole[0], kind, seen)
        np.add.at(whole[1], kind, mean)
        own = mean * divided(*whole)[kind]
        counts = own > 0
        freedom = int(counts.sum()) - int((whole[0] > 0).sum())
        return max(1.0, float(((seen - own)[counts] ** 2 / own[counts]).sum()) / freedom) if freedom else 1.0
