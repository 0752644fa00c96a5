"""The five questions."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ctiplan import _ctiplan
from ctiplan._detector import whole
from ctiplan._errors import InputError
from ctiplan._mission import DataSet, Mission, checked
from ctiplan._results import Comparison, Diagnosis, Evaluation, Fit, Validation

#: Called with a stage, the steps done, and their number (0 where it is not known), from the thread that asked.
Progress = Callable[[str, int, int], object]


def evaluate(
    mission: Mission,
    *,
    samples: int = 1000,
    seed: int | None = None,
    monte_carlo: int | None = None,
    confidence: float | None = None,
    posterior: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> Evaluation:
    """Dose and traps per year, change of shape against time, and when the budget is exceeded.

    Parameters
    ----------
    mission : Mission
    samples : int
        Draws of the Sun and of ``[uncertainty]`` for the date as a distribution; 0: none.
    seed : int, optional
        Seed of all that is random, instead of the mission's.
    monte_carlo : int, optional
        Galaxies that are read out with photon and read noise at the end of the mission.
    confidence : float, optional
        The required probability to meet the corrected budget, above 0 and below 1.
    posterior : path, optional
        A sample of ``ctiplan fit --posterior``, whose keys are drawn in place of their uncertainties.
    progress : callable, optional
        ``progress(stage, done, total)``.
    """
    outcome = _ctiplan.evaluate(
        _mission(mission),
        samples=whole("samples", samples, 0, 65_536),
        seed=_seed(seed),
        monte_carlo=None if monte_carlo is None else whole("monte_carlo", monte_carlo, 2, 10_000_000),
        confidence=_probability(confidence),
        posterior=None if posterior is None else os.fspath(posterior),
        progress=progress,
    )
    return Evaluation(outcome)


def compare(
    missions: Mission | Sequence[Mission],
    values: Mapping[str, Any] | None = None,
    *,
    confidence: float | None = None,
    samples: int = 400,
    progress: Progress | None = None,
) -> Comparison:
    """Missions side by side, at every combination of values of keys.

    Parameters
    ----------
    missions : Mission or sequence of Mission
    values : mapping, optional
        Dotted keys with lists of values, such as ``{"readout.line_time_ms": [5, 25]}``.
    confidence : float, optional
        Rank by how long budgets are met with this probability, not as expected.
    samples : int
        Draws of each mission, with `confidence`.
    progress : callable, optional
        ``progress(stage, done, total)``.
    """
    several = [missions] if isinstance(missions, (Mission, str)) else list(missions)
    inner = [_mission(mission) for mission in several]
    named = [(str(mission.path or mission.name), of) for mission, of in zip(several, inner, strict=True)]
    axes = {key: list(of) if _is_many(of) else [of] for key, of in (values or {}).items()}
    count = whole("samples", samples, 20, 65_536)
    outcome = _ctiplan.compare(named, axes, confidence=_probability(confidence), samples=count, progress=progress)
    return Comparison(outcome)


def validate(mission: Mission, data: DataSet | Iterable[DataSet], *, seed: int | None = None) -> Validation:
    """Compare the model with measurements. No parameter is changed.

    Parameters
    ----------
    mission : Mission
    data : DataSet or iterable of DataSet
    seed : int, optional
        Seed of the simulated noise with which residual trends are compared, instead of the mission's.
    """
    return Validation(_ctiplan.validate(_mission(mission), _several(data), seed=_seed(seed)))


def fit(
    mission: Mission,
    data: DataSet | Iterable[DataSet],
    free: Iterable[str] | None = None,
    *,
    starts: int = 1,
    seed: int | None = None,
    profiles: Iterable[str] = (),
    samples: int | None = None,
    holdout: str | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Adjust the values of keys to measurements.

    Parameters
    ----------
    mission : Mission
    data : DataSet or iterable of DataSet
    free : iterable of str, optional
        Dotted keys to adjust; the mission's ``[fit] free`` by default.
    starts : int
        Starting points: the mission's values and random ones around them.
    seed : int, optional
        Seed of these and of the posterior, instead of the mission's.
    profiles : iterable of str
        Free keys along which chi2 is scanned, all others fitted again.
    samples : int, optional
        Independent draws of the posterior.
    holdout : str, optional
        A column: each group of its values is kept out in turn, and predicted.
    progress : callable, optional
        ``progress(stage, done, total)``; the stage tells the best chi2 so far.
    """
    outcome = _ctiplan.fit(
        _mission(mission),
        _several(data),
        free=None if free is None else _names(free),
        starts=whole("starts", starts, 1, 10_000),
        seed=_seed(seed),
        profiles=_names(profiles),
        samples=None if samples is None else whole("samples", samples, 10, 1_000_000),
        holdout=holdout,
        progress=progress,
    )
    return Fit(outcome)


def diagnose(
    mission: Mission,
    data: DataSet | Iterable[DataSet],
    *,
    free: Iterable[str] | None = None,
    level: float = 0.01,
    seed: int | None = None,
    candidates: Mapping[str, Any] | None = None,
    can: Iterable[str] = (),
    evaluations: int | None = None,
    stability: bool = True,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find the physical effect that the model lacks.

    Parameters
    ----------
    mission : Mission
    data : DataSet or iterable of DataSet
    free : iterable of str, optional
        Dotted keys to adjust; the mission's ``[fit] free`` by default.
    level : float
        Level of significance: fraction of complete models to which an effect is added by chance.
    seed : int, optional
        Seed of all simulations, instead of the mission's.
    candidates : mapping, optional
        Additional candidates, ``{"formula": {...}}`` as in a mission's ``[effects]``.
    can : iterable of str
        Observables that could be measured next; all by default.
    evaluations : int, optional
        Evaluations of the model after which no further step of the search begins.
    stability : bool
        Whether the search is repeated with larger errors, another seed, other starts and other free keys.
    progress : callable, optional
        ``progress(stage, done, total)``.
    """
    outcome = _ctiplan.diagnose(
        _mission(mission),
        _several(data),
        free=None if free is None else _names(free),
        level=level,
        seed=_seed(seed),
        candidates=None if candidates is None else dict(candidates),
        can=_names(can),
        evaluations=evaluations,
        stability=stability,
        progress=progress,
    )
    return Diagnosis(outcome)


def _mission(mission: Mission) -> _ctiplan.Mission:
    return checked(mission)._inner


def _several(data: DataSet | Iterable[DataSet]) -> list[_ctiplan.DataSet]:
    several = [data] if isinstance(data, (DataSet, str)) else list(data)
    for each in several:
        if not isinstance(each, DataSet):
            raise TypeError(f"data sets are needed, as DataSet.read(path, mission) gives them; found {type(each).__name__}")
    return [each._inner for each in several if isinstance(each, DataSet)]


def _names(names: Iterable[str]) -> list[str]:
    return [names] if isinstance(names, str) else list(names)


def _seed(seed: int | None) -> int | None:
    return None if seed is None else whole("seed", seed, 0, 2**64 - 1)


def _probability(confidence: float | None) -> float | None:
    if confidence is not None and not 0 < confidence < 1:
        raise InputError(f"cannot use confidence = {confidence}", None, "allowed: a probability above 0 and below 1")
    return confidence


def _is_many(values: Any) -> bool:
    return np.ndim(values) > 0 and not isinstance(values, (str, bytes, Mapping))
