"""What panel data say of a model, ready to be saved and shown."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from calibration.estimating.panel_fit import PanelFit
from kinetics.support.config import write_toml
from kinetics.support.limits import bytes_in
from kinetics.support.tables import counted, in_unit


@dataclass(frozen=True, eq=False)
class PanelStudy:
    """A fit with where its data come from.

    source, table : names of the files of the model and of the data
    kind : of the data: counts or snapshots
    """

    source: str
    kind: str
    table: str
    found: PanelFit

    @property
    def evidence(self) -> dict[str, Any]:
        """Where the estimates come from."""
        data = self.found.data
        observed = {name: {"model": each.name, **asdict(each)} for name, each in data.observations.items()}  # type: ignore[call-overload]
        return {
            "network": Path(self.source).name,
            f"{self.kind}_file": Path(self.table).name,
            "table_sha256": hashlib.sha256(bytes_in(Path(self.table))).hexdigest(),
            "runs": len(data.runs),
            "looks": data.looks,
            "observed": observed,
            "fixed": dict(self.found.fixed),
            "versions": {name: version(name) for name in ("wellmixed", "numpy", "scipy")},
        }

    def to_dict(self) -> dict[str, Any]:
        """Parameters, log-likelihood and evidence, ready for JSON."""
        fit, answer = self.found.fit, self.found.log_likelihood
        return {
            "parameters": fit.to_dict(),
            "log_likelihood": {
                "value": answer.value, "low": answer.low, "high": answer.high, "is_bound": answer.is_bound
            },
            "aic": self.found.aic,
            "covariance_of_logarithms": fit.covariance,
            "notes": list(fit.notes),
            "evaluations": fit.evaluations,
            "evidence": self.evidence,
        }  # fmt: skip

    def save(self, path: str | Path) -> None:
        """Write as TOML, whole or not at all; what the data cannot tell is left out."""
        content = self.to_dict()
        content["parameters"] = {
            name: {key: value for key, value in row.items() if value is not None}
            for name, row in content["parameters"].items()
        }
        covariance = content.pop("covariance_of_logarithms")
        if covariance is not None:
            content["covariance_of_logarithms"] = covariance.tolist()
        write_toml(content, Path(path))

    def __str__(self) -> str:
        data = self.found.data
        unit = self.found.model.network.time_unit
        times = [run.times[-1] - run.start for run in data.runs]
        watched = in_unit(f"{max(times):g}", unit)
        head = f"{Path(self.source).name} from {counted(data.looks, 'look')} at {counted(len(data.runs), 'run')}"
        return f"{head}, up to {watched} each\n{self.found}"
