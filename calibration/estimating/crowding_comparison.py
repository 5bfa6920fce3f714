"""Models of crowding compared by the hits that runs have logged, and the choice that the hits make."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from calibration import plots
from calibration.estimating.hit_fit import HitFit
from calibration.estimating.hits import RunHits, Source
from calibration.estimating.rate_fit import CLOSE
from kinetics.network import Crowding, Tank
from kinetics.rates.crowding import (
    CROWDING_MODELS,
    SOURCES,
    ConvexBodies,
    CrowdingModel,
    crowding_in,
    crowding_model,
)
from kinetics.rates.crowding.base import SourceName
from kinetics.rates.crowding_terms import BodyGeometry, CrowdingTerms
from kinetics.support.arrays import Floats
from kinetics.support.cli.progress import stage
from kinetics.support.intervals import exact_limits
from kinetics.support.packages import special
from kinetics.support.shown import ResultTable, Shown, on_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FEWEST = 5.0  # events expected in a tank that enters chi-square


@dataclass(frozen=True)
class TankRatio:
    """Events of one kind of tank over those expected at one rate for all tanks, with 95 % limits.

    The limits are those of a Poisson count, widened by the scatter between runs.
    """

    tank: str
    engine: str
    runs: int
    events: int
    expected: float
    ratio: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class CrowdingFit:
    """One model, one source and one range of loads."""

    source: SourceName
    model: str
    above: float
    fit: HitFit

    @cached_property
    def tanks(self) -> list[TankRatio]:
        """One row a kind of tank."""
        names, kind = self.fit.source.kinds
        seen = np.bincount(kind, self.fit.seen.sum(axis=(1, 2, 3)))
        mean = np.bincount(kind, self.fit.expected.sum(axis=(1, 2)))
        low, high = exact_limits(seen / self.fit.scatter, mean / self.fit.scatter)
        rows = zip(names, np.bincount(kind), seen, mean, low, high, strict=True)
        return [
            TankRatio(tank, engine, int(runs), int(n), float(m), float(n / m) if m > 0 else np.nan, float(a), float(b))
            for (tank, engine), runs, n, m, a, b in rows
        ]

    @property
    def chi_square(self) -> tuple[float, int, float]:
        """Pearson's statistic of the tanks, its degrees of freedom, and the p-value given the scatter between runs."""
        rows = [row for row in self.tanks if row.expected >= FEWEST]
        value = sum((row.events - row.expected) ** 2 / row.expected for row in rows)
        engines = len({row.engine for row in rows})
        freedom = len(rows) - engines - (self.fit.parameter is not None)
        if freedom < 1:
            return value, 0, float("nan")
        return value, freedom, float(special.chdtrc(freedom, value / self.fit.scatter))

    def as_dict(self) -> dict[str, Any]:
        """For programs."""
        value, freedom, p_value = self.chi_square
        only = self.fit.parameter
        low, high = (None, None) if only is None else self.fit.interval
        return {
            "source": self.source,
            "above": self.above,
            "model": self.model,
            "events": int(self.fit.seen.sum()),
            "shared": int(self.fit.seen[..., 1].sum()),
            "parameter": None if only is None else only.name,
            "value": None if only is None else self.fit.theta,
            "low": low,
            "high": high,
            "log_likelihood": self.fit.value,
            "aic": self.fit.aic,
            "coincidence": self.fit.coincidence,
            "scatter": self.fit.scatter,
            "chi_square": value,
            "freedom": freedom,
            "p": p_value,
            "tanks": [vars(row) for row in self.tanks],
        }


@dataclass(frozen=True, eq=False, repr=False)
class CrowdingComparison(Shown):
    """Models of crowding fitted to the same hits and joins.

    runs : the runs and their logs
    bodies : geometry of each species
    levels : loads, ascending; the first is that of the logs, one is the threshold of breaks
    models : those compared

    How often a third body touches by coincidence is measured with all hits logged and held above higher loads. The
    choice is by hits that broke nothing and hits that broke a bond, together, since rates differ between them and the
    parameter may: the fewest parameters of all models whose AIC is within 2 of the smallest.
    """

    runs: tuple[RunHits, ...]
    bodies: ConvexBodies
    levels: tuple[float, ...]
    models: tuple[CrowdingModel, ...] = CROWDING_MODELS

    @classmethod
    def of(cls, runs: Sequence[RunHits], bodies: ConvexBodies, levels: Sequence[float] = ()) -> CrowdingComparison:
        """Compare all models.

        levels : loads above which hits are counted, besides all that are logged and those that break a bond
        runs : at least one
        ValueError: logs of several kinds, or a level below them.
        """
        kinds = {(run.log_above, run.threshold) for run in runs}
        if len(kinds) > 1:
            shown = ", ".join(f"{low:g} with threshold {high:g}" for low, high in sorted(kinds))
            raise ValueError(f"logs above {shown}; expected runs of one kind: analyse them separately")
        ((log_above, threshold),) = kinds
        for level in levels:
            if level < log_above:
                raise ValueError(f"hits above {level:g} were asked for; the logs begin at {log_above:g}")
        return cls(tuple(runs), bodies, tuple(sorted({log_above, threshold, *levels})))

    @cached_property
    def _sources(self) -> dict[SourceName, Source]:
        return {name: Source.of(name, self.runs) for name in SOURCES}

    @cached_property
    def _exposures(self) -> dict[tuple[SourceName, str], Callable[[float], Floats]]:
        return {
            (name, model.name): self._exposure(source, model)
            for name, source in self._sources.items()
            for model in self.models
        }

    def _exposure(self, source: Source, model: CrowdingModel) -> Callable[[float], Floats]:
        """Exposures at a value of the model's parameter; the last ones are kept."""
        known: dict[float, Floats] = {}

        def at(theta: float) -> Floats:
            if theta not in known:
                shape = {parameter.name: theta for parameter in model.parameters}
                known.clear()
                known[theta] = source.exposure(self._crowdings(source, model, shape))
            return known[theta]

        return at

    def _fit(
        self, name: SourceName, model: CrowdingModel, loads: tuple[float, float], held: Mapping[str, float]
    ) -> HitFit:
        source, parameter = self._sources[name], next(iter(model.parameters), None)
        exposure = self._exposures[name, model.name]
        return HitFit.of(source, source.events(*loads), self._around[name], exposure, parameter, held)

    @cached_property
    def _around(self) -> dict[SourceName, Floats]:
        plain = crowding_model("none")
        return {name: source.around(self._crowdings(source, plain, {})) for name, source in self._sources.items()}

    def _crowdings(self, source: Source, model: CrowdingModel, shape: Mapping[str, float]) -> list[Crowding]:
        """The factors of each run, in its tank."""
        tanks: dict[Tank, Crowding] = {}
        for tank in {run.size for run in self.runs}:
            tanks[tank] = crowding_in(source.expansion, self.bodies, tank, {source.name: (model, shape)})
        return [tanks[run.size] for run in self.runs]

    @cached_property
    def _known(self) -> dict[tuple[SourceName, float, float], list[CrowdingFit]]:
        return {}

    def _fitted(self, name: SourceName, above: float, up_to: float = np.inf) -> list[CrowdingFit]:
        """All models on the events of one source, with the scatter of these events; what was fitted is kept."""
        key = name, above, up_to
        if key not in self._known:
            coincidences: list[dict[str, float]] = [{}] * len(self.models)
            if name != "joins" and above > self.levels[0]:
                coincidences = [row.fit.coincidence for row in self._fitted(name, self.levels[0])]
            pairs = zip(self.models, coincidences, strict=True)
            fits = [self._fit(name, model, (above, up_to), held) for model, held in pairs]
            scatter = fits[0].own_scatter
            rows = zip(self.models, fits, strict=True)
            self._known[key] = [
                CrowdingFit(name, model.name, above, replace(fit, scatter=scatter)) for model, fit in rows
            ]
        return self._known[key]

    @cached_property
    def fits(self) -> list[CrowdingFit]:
        """Every source, level and model."""
        stage("fitting models of crowding")
        return [
            fit
            for name in SOURCES
            for above in (self.levels if name != "joins" else (0.0,))
            for fit in self._fitted(name, above)
        ]

    @cached_property
    def chosen(self) -> dict[SourceName, CrowdingFit]:
        """Source -> the model chosen, fitted to the hits that broke a bond, or to all joins."""
        found: dict[SourceName, CrowdingFit] = {}
        for name in SOURCES:
            *others, last = self._classes(name)
            total = [fit.fit.aic + sum(rows[i].fit.aic for rows in others) for i, fit in enumerate(last)]
            near = [i for i, aic in enumerate(total) if aic <= min(total) + CLOSE]
            found[name] = last[min(near, key=lambda i: (last[i].fit.parameter is not None, total[i]))]
        return found

    def fitted(self, model: str) -> dict[SourceName, CrowdingFit]:
        """One model for hits by bodies and walls, and none for joins."""
        names: dict[SourceName, str] = {"bodies": model, "walls": model, "joins": "none"}
        return {
            source: next(fit for fit in self._classes(source)[-1] if fit.model == name)
            for source, name in names.items()
        }

    @property
    def reason(self) -> str:
        """What the hits chose, in a sentence."""
        shown = []
        for source, fit in self.chosen.items():
            value = "" if fit.fit.parameter is None else f" ({fit.fit.parameter.name} = {fit.fit.theta:.3g})"
            shown.append(f"{fit.model}{value} for {source}")
        return f"{', '.join(shown)}, by {sum(len(run.load) for run in self.runs)} logged hits and the joins"

    def _classes(self, name: SourceName) -> list[list[CrowdingFit]]:
        """Fits to disjoint ranges of loads, the last one of what broke a bond."""
        if name == "joins":
            return [self._fitted(name, 0.0)]
        log_above, threshold = self.runs[0].log_above, self.runs[0].threshold
        below = [self._fitted(name, log_above, threshold)] if log_above < threshold else []
        return [*below, self._fitted(name, threshold)]

    @property
    def headline(self) -> str:
        """How many runs, in how many kinds of tank."""
        kinds = len({(run.tank, run.engine) for run in self.runs})
        return f"events per exposure in {len(self.runs)} runs in {kinds} kinds of tank"

    def summary(self) -> ResultTable:
        """One row a source, level and model: its parameter, and chi-square of the tanks."""
        rows = []
        for fit in self.fits:
            data = fit.as_dict()
            ratios = [row.ratio for row in fit.tanks if row.expected >= FEWEST]
            what = "" if data["parameter"] is None else f"{data['value']:.3g} [{data['low']:.3g}, {data['high']:.3g}]"
            rows.append(
                (
                    fit.source, f"{fit.above:g}" if fit.above else "", fit.model, str(data["events"]), what,
                    f"{data['chi_square']:.1f} / {data['freedom']}" if data["freedom"] else "-",
                    f"{data['p']:.2g}" if data["freedom"] else "-",
                    f"{min(ratios):.2f} to {max(ratios):.2f}" if ratios else "",
                )
            )  # fmt: skip
        titles = ("events by", "above", "crowding", "events", "parameter", "chi-square / freedom", "p", "tanks")
        notes = [f"chosen for {name}: {fit.model}" for name, fit in self.chosen.items()]
        return ResultTable(self.headline, titles, rows, notes)

    @on_axes
    def plot(self, ax: Axes) -> Axes:
        """Events per exposure by tank and model, of all hits logged and all joins; returns `ax`."""
        shown = [fit for fit in self.fits if fit.above in (0.0, self.levels[0])]
        names = [f"{fit.source}, {row.tank}" for fit in shown if fit.model == self.models[0].name for row in fit.tanks]
        sets = {}
        for model in self.models:
            rows = [row for fit in shown if fit.model == model.name for row in fit.tanks]
            sets[model.name] = plots.Limited(*([getattr(row, key) for row in rows] for key in ("ratio", "low", "high")))
        ax.axvline(1.0, color="0.7", linewidth=0.8)
        return plots.forest(ax, names, sets, "events over those expected at one rate for all tanks")

    def to_dict(self) -> dict[str, Any]:
        """Choice, coincidences and all fits, ready for JSON."""
        return {
            "runs": len(self.runs),
            "chosen": {name: fit.model for name, fit in self.chosen.items()},
            "fits": [fit.as_dict() for fit in self.fits],
        }

    def table(self) -> list[dict[str, Any]]:
        """One row a source, level, model and kind of tank."""
        return [
            {"source": fit.source, "above": fit.above, "model": fit.model} | vars(row)
            for fit in self.fits
            for row in fit.tanks
        ]


def crowding_terms(
    name: str, compared: CrowdingComparison | None, bodies: ConvexBodies | None, species: Sequence[str]
) -> CrowdingTerms | None:
    """What a rates file says of crowding; None for mass action.

    name : of a model, for breaks by bodies and walls; or `auto` for those that logged hits choose: without them, none
    compared : fits to logged hits; None if there are none

    ValueError: a model with a parameter, and no logged hits to fit it to; or no geometry of bodies
    """
    fits = {} if compared is None else compared.chosen if name == "auto" else compared.fitted(name)
    models = {source: fit.model for source, fit in fits.items()}
    if compared is None and name != "auto":
        if crowding_model(name).parameters:
            raise ValueError(
                f"model of crowding {name!r} has a parameter that logged hits must tell, and no run has a log of them; "
                "expected runs of a scene whose effect breaking has log_above, or crowding hard-bodies or none"
            )
        models = {"bodies": name, "walls": name}
    if set(models.values()) <= {"none"}:
        return None
    if bodies is None:
        raise ValueError(f"crowding {name!r} needs the geometry of bodies; expected mechanics runs: take crowding none")
    shape = {
        str(source): {p.name: fit.fit.theta} for source, fit in fits.items() if (p := fit.fit.parameter) is not None
    }
    rows = zip(species, bodies.radius.tolist(), bodies.surface.tolist(), bodies.volume.tolist(), strict=True)
    geometry = {who: BodyGeometry(radius=r, surface=s, volume=v) for who, r, s, v in rows}
    return CrowdingTerms(**models, shape=shape, species=geometry)
