"""Answers: of evaluate, compare, validate, fit and diagnose."""

from __future__ import annotations

import datetime
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from ctiplan import _ctiplan, _files, _tables
from ctiplan._errors import InputError
from ctiplan._mission import Mission

if TYPE_CHECKING:
    import pandas
    from astropy.table import QTable


@dataclass(frozen=True)
class _Kept:
    """What is printed, drawn and read of a result, in another process than that which computed it."""

    document: str
    table: str
    words: str
    html: str
    svg: list[tuple[str, bytes]]
    mission: _ctiplan.Mission | None

    @classmethod
    def of(cls, outcome: _ctiplan.Outcome | _Kept) -> _Kept:
        if isinstance(outcome, _Kept):
            return outcome
        return cls(outcome.json(), outcome.csv(), outcome.text(), outcome.page(), outcome.figures("svg"), outcome.found())

    def json(self) -> str:
        return self.document

    def csv(self) -> str:
        return self.table

    def text(self) -> str:
        return self.words

    def page(self) -> str:
        return self.html

    def figures(self, format: str) -> list[tuple[str, bytes]]:
        if format != "svg":
            problem = "a result that was sent to another process or stored keeps its figures as svg"
            raise InputError(f'cannot draw as "{format}"', None, problem, "draw it where it was computed")
        return self.svg

    def found(self) -> _ctiplan.Mission | None:
        return self.mission


class Result:
    """What all answers have: text, tables, a page, figures, and the JSON document of the command line.

    Attributes
    ----------
    document : dict
        What ``--json`` prints, with all that has no attribute of its own.
    """

    __slots__ = ("_outcome", "document")

    document: dict[str, Any]

    def __init__(self, outcome: _ctiplan.Outcome | _Kept) -> None:
        self._outcome = outcome
        self.document = json.loads(outcome.json())

    def to_json(self) -> str:
        """What ``--json`` prints."""
        return self._outcome.json()

    def to_csv(self) -> str:
        """What ``--csv`` prints; names of columns carry units."""
        return self._outcome.csv()

    def to_table(self) -> QTable:
        """The table of ``--csv`` as an astropy QTable with units. Needs astropy."""
        return _tables.to_qtable(self._outcome.csv(), {"ctiplan": self.document.get("version", _ctiplan.__version__)})

    def to_pandas(self) -> pandas.DataFrame:
        """The table of ``--csv`` as a pandas DataFrame. Needs pandas."""
        return _tables.to_pandas(self._outcome.csv())

    def to_html(self, path: str | os.PathLike[str] | None = None, *, overwrite: bool = False) -> str | None:
        """The page of ``--html``, which needs no other file; where `path` is given, it is written there instead. An existing file
        is replaced only with `overwrite`."""
        page = self._outcome.page()
        if path is None:
            return page
        _files.write(path, page, overwrite=overwrite)
        return None

    def figures(self, format: str = "svg") -> dict[str, bytes]:
        """Figures by name, as the contents of files.

        Parameters
        ----------
        format : {"svg", "pdf", "png"}
        """
        return dict(self._outcome.figures(format))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (_Kept.of(self._outcome),)

    def __str__(self) -> str:
        return self._outcome.text()

    def _repr_html_(self) -> str:
        # The page has a style of its own, which must not become the notebook's.
        page = escape(self._outcome.page(), quote=True)
        return f'<iframe srcdoc="{page}" style="width: 100%; height: 40em; border: 0"></iframe>'


@dataclass(frozen=True)
class Crossing:
    """When a budget is exceeded."""

    #: Whether it is, within the mission.
    exceeded: bool
    #: The first time, years since launch; None where it is not.
    t_yr: float | None
    #: The same as a date.
    date: datetime.date | None
    #: All times at which the budget is crossed, up and down, years since launch.
    crossings_yr: tuple[float, ...]
    #: The change of ellipticity that is allowed.
    limit_delta_e: float
    #: What is left of it at the end of the mission; negative where it is exceeded; None where no shape is left.
    margin_delta_e: float | None
    #: Factor of the software correction.
    factor: float

    @classmethod
    def _of(cls, said: Mapping[str, Any]) -> Crossing:
        return cls(
            exceeded=said["exceeded"],
            t_yr=said["t_yr"],
            date=said["date"] and datetime.date.fromisoformat(said["date"]),
            crossings_yr=tuple(said["crossings"]),
            limit_delta_e=said["limit_delta_e"],
            margin_delta_e=said["margin_delta_e"],
            factor=said.get("factor", 1.0),
        )


@dataclass(frozen=True)
class Verdict:
    """When the budget of the judged galaxy is exceeded, without and with the software correction; None where shear biases alone are limited."""

    uncorrected: Crossing | None
    corrected: Crossing | None

    @classmethod
    def _of(cls, said: Mapping[str, Any]) -> Verdict:
        uncorrected, corrected = said["uncorrected"], said["corrected"]
        return cls(uncorrected and Crossing._of(uncorrected), corrected and Crossing._of(corrected))


class Evaluation(Result):
    """Dose, traps and shapes of a mission over time, and when its budgets are exceeded."""

    __slots__ = ()

    @property
    def mission(self) -> str:
        """Name of the mission."""
        return self.document["mission"]

    @property
    def verdict(self) -> Verdict:
        """When the budget is exceeded, without noise."""
        return Verdict._of(self.document["budget"])

    @property
    def verdict_with_noise(self) -> Verdict | None:
        """The same with the noise of one exposure; None where that was not computed."""
        noise = self.document["budget"].get("noise")
        return noise and Verdict._of(noise)

    @property
    def budget_delta_e(self) -> float | None:
        """The change of ellipticity that is allowed."""
        return self.document["budget"]["delta_e"]

    @property
    def galaxy(self) -> str:
        """The galaxy whose shape is judged."""
        return self.document["budget"]["galaxy"]

    @property
    def passes(self) -> bool:
        """Whether all corrected budgets are met."""
        return self.document["passes"]

    @property
    def years(self) -> list[dict[str, Any]]:
        """Each year: ``t_yr``, ``date``, ``dose_mev_g``, ``traps`` and ``galaxies``."""
        return self.document["years"]

    @property
    def distribution(self) -> dict[str, Any] | None:
        """The date as a distribution: probabilities, quantiles and shares; None without samples."""
        return self.document.get("distribution")

    @property
    def compliance(self) -> list[dict[str, Any]]:
        """Each requirement with its limit, its value at the end of the mission, and whether it is met."""
        return self.document["compliance"]

    @property
    def warnings(self) -> list[Any]:
        """What is doubtful about the result."""
        return self.document["warnings"]

    def __repr__(self) -> str:
        return f"<Evaluation of {self.mission!r}, {_when(self.verdict.uncorrected)} without, {_when(self.verdict.corrected)} with correction>"


def _when(crossing: Crossing | None) -> str:
    if crossing is None:
        return "no budget of one galaxy"
    return f"budget exceeded after {crossing.t_yr:.3f} yr" if crossing.t_yr is not None else "budget met"


class Comparison(Result):
    """Missions side by side."""

    __slots__ = ()

    @property
    def scenarios(self) -> list[dict[str, Any]]:
        """Each scenario: ``settings``, ``dose_mev_g``, ``delta_e``, ``uncorrected``, ``corrected``."""
        return self.document["scenarios"]

    @property
    def best(self) -> list[int]:
        """Places of the best scenarios."""
        return self.document["best"]

    @property
    def worst(self) -> list[int]:
        """Places of the worst scenarios."""
        return self.document["worst"]

    def __repr__(self) -> str:
        return f"<Comparison of {len(self.scenarios)} scenarios>"


class Validation(Result):
    """A mission's model compared with measurements."""

    __slots__ = ()

    @property
    def chi2(self) -> float:
        """Sum of ((value - model)/sigma)^2 over all rows."""
        return self.document["chi2"]

    @property
    def n(self) -> int:
        """Number of rows."""
        return self.document["n"]

    @property
    def rms_sigma(self) -> float:
        """Root mean square of (value - model)/sigma."""
        return self.document["rms_sigma"]

    @property
    def datasets(self) -> list[dict[str, Any]]:
        """Each data set with its ``chi2``, ``n`` and ``rows`` (``value``, ``sigma``, ``model``)."""
        return self.document["datasets"]

    @property
    def residuals(self) -> np.ndarray:
        """(value - model)/sigma of all rows, shape (n,), in the order of the data sets."""
        rows = [row for dataset in self.datasets for row in dataset["rows"]]
        return np.array([(row["value"] - row["model"]) / row["sigma"] for row in rows])

    def __repr__(self) -> str:
        return f"<Validation, chi2 {self.chi2:.2f} of {self.n} rows>"


@dataclass(frozen=True)
class Parameter:
    """A fitted parameter."""

    #: Dotted key of the mission.
    key: str
    #: Unit of the values; empty for pure numbers.
    unit: str
    #: Value at the optimum.
    value: float
    #: 1-sigma error; None where the data do not constrain it.
    sigma: float | None
    #: Value in the mission as it was.
    before: float | None = None

    @classmethod
    def _of(cls, said: Mapping[str, Any]) -> Parameter:
        return cls(said["key"], said["unit"], said["value"], said["sigma"], said.get("before"))


class Fit(Result):
    """Values of free keys, with errors."""

    __slots__ = ()

    @property
    def mission(self) -> Mission:
        """The mission with the fitted values."""
        found = self._outcome.found()
        assert found is not None, "a fit has a mission"
        return Mission(found)

    @property
    def chi2(self) -> float:
        """chi2 at the optimum."""
        return self.document["chi2"]

    @property
    def n(self) -> int:
        """Number of rows."""
        return self.document["n"]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Free parameters, in the order requested."""
        return tuple(Parameter._of(said) for said in self.document["parameters"])

    @property
    def correlation(self) -> np.ndarray:
        """Correlation of the parameters, shape (free, free); NaN where one is not constrained."""
        return np.array(self.document["correlation"], dtype=np.float64)

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the parameters, shape (free, free), in their units; NaN where one is not constrained."""
        sigma = np.array([np.nan if each.sigma is None else each.sigma for each in self.parameters])
        return self.correlation * np.outer(sigma, sigma)

    @property
    def advice(self) -> list[Any]:
        """What the data do not determine, in words."""
        return self.document["advice"]

    def __repr__(self) -> str:
        return f"<Fit of {len(self.parameters)} parameters, chi2 {self.chi2:.2f} of {self.n} rows>"


@dataclass(frozen=True)
class Rung:
    """A model that was fitted on the way to a diagnosis."""

    #: The effect that was added last; None for the mission's own model.
    effect: str | None
    #: chi2 at the optimum.
    chi2: float
    #: Number of rows.
    n: int
    #: Number of free parameters.
    free: int
    #: Root mean square of (value - model)/sigma.
    rms_sigma: float
    #: The same on rows that were kept out of the fit; None where none could be.
    holdout_rms_sigma: float | None
    #: p-value: the probability that noise alone, over all that was tried, looks as good; None for the mission's own model.
    false_alarm: float | None
    #: Parameters of the effect: ``value``, ``sigma``, ``unit``.
    parameters: dict[str, dict[str, Any]]

    @classmethod
    def _of(cls, said: Mapping[str, Any]) -> Rung:
        return cls(
            effect=said.get("effect"),
            chi2=said["chi2"],
            n=said["n"],
            free=said["free"],
            rms_sigma=said["rms_sigma"],
            holdout_rms_sigma=said.get("holdout_rms_sigma"),
            false_alarm=said.get("false_alarm"),
            parameters=said.get("parameters", {}),
        )


class Diagnosis(Result):
    """The effect that a mission's model lacks."""

    __slots__ = ()

    @property
    def verdict(self) -> str:
        """``complete``, ``missing``, ``ambiguous``, ``unexplained`` or ``unfit``."""
        return self.document["verdict"]

    @property
    def reason(self) -> str | None:
        """Why, in a sentence."""
        return self.document["reason"]

    @property
    def added(self) -> tuple[str, ...]:
        """Effects that were added, best first."""
        return tuple(step["effect"] for step in self.document["steps"])

    @property
    def mission(self) -> Mission:
        """The mission with fitted values and the added effects."""
        found = self._outcome.found()
        assert found is not None, "a diagnosis has a mission"
        return Mission(found)

    @property
    def ladder(self) -> tuple[Rung, ...]:
        """The mission's own model, then each effect added."""
        return tuple(Rung._of(said) for said in [self.document["baseline"], *self.document["steps"]])

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Keys that were free from the start, with their values in the mission found."""
        return tuple(Parameter._of(said) for said in self.document["parameters"])

    @property
    def alternatives(self) -> list[list[str]]:
        """Sets of effects that these data cannot distinguish, the adopted one first."""
        return self.document["alternatives"]

    @property
    def covariates(self) -> list[dict[str, Any]]:
        """Conditions on which the residuals still depend."""
        return self.document["covariates"]

    @property
    def next_measurement(self) -> dict[str, Any] | None:
        """The measurement that would separate the alternatives."""
        return self.document["next_measurement"]

    @property
    def detection_limits(self) -> dict[str, Any] | None:
        """For each effect, the parameter value that these data would have shown; None unless the verdict is ``complete``."""
        return self.document.get("detection_limits")

    def __repr__(self) -> str:
        return f"<Diagnosis: {self.verdict}{': ' + ', '.join(self.added) if self.added else ''}>"
