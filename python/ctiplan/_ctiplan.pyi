from collections.abc import Callable, Mapping
from typing import Any, final

import numpy as np

__all__ = [
    "DataSet",
    "Detector",
    "Mission",
    "Outcome",
    "__version__",
    "arctic_readout",
    "command",
    "compare",
    "diagnose",
    "evaluate",
    "fit",
    "measure",
    "set_threads",
    "threads",
    "validate",
]

__version__: str

def command(arguments: list[str]) -> int: ...
def set_threads(threads: int) -> None:
    """Set the number of threads of all work that begins later; 0: one for each processor."""

def threads() -> int:
    """The number of threads that work uses."""

@final
class Mission:
    @staticmethod
    def read(path: str) -> Mission: ...
    @staticmethod
    def parse(text: str) -> Mission: ...
    def set(self, values: dict[str, Any]) -> Mission: ...
    def json(self) -> str: ...
    def to_toml(self) -> str: ...

@final
class DataSet:
    @staticmethod
    def read(path: str, mission: Mission) -> DataSet: ...
    @staticmethod
    def parse(name: str, text: str, mission: Mission) -> DataSet: ...
    @property
    def name(self) -> str: ...
    @property
    def observable(self) -> str: ...
    @property
    def varying(self) -> list[str]: ...
    def values(self) -> tuple[list[float], list[float]]: ...
    def to_ecsv(self) -> str: ...
    def __len__(self) -> int: ...

@final
class Outcome:
    def text(self) -> str: ...
    def json(self) -> str: ...
    def csv(self) -> str: ...
    def page(self) -> str: ...
    def figures(self, format: str) -> list[tuple[str, bytes]]: ...
    def found(self) -> Mission | None: ...

@final
class Detector:
    def __new__(cls, mission: Mission, *, t_yr: float | None, dose_mev_g: float | None) -> Detector: ...
    @property
    def t_yr(self) -> float: ...
    @property
    def dose_mev_g(self) -> float: ...
    @property
    def traps(self) -> list[tuple[str, float, float]]: ...
    def readout(
        self, frame_e: np.ndarray, layout: Mapping[str, Any], trap_map: np.ndarray | None, relative: float
    ) -> np.ndarray: ...
    def correct(
        self, frame_e: np.ndarray, layout: Mapping[str, Any], trap_map: np.ndarray | None, options: Mapping[str, Any]
    ) -> dict[str, Any]: ...

def evaluate(
    mission: Mission,
    *,
    samples: int,
    seed: int | None,
    monte_carlo: int | None,
    confidence: float | None,
    posterior: str | None,
    progress: Callable[[str, int, int], object] | None,
) -> Outcome: ...
def compare(
    missions: list[tuple[str, Mission]],
    values: dict[str, Any],
    *,
    confidence: float | None,
    samples: int,
    progress: Callable[[str, int, int], object] | None,
) -> Outcome: ...
def validate(mission: Mission, data: list[DataSet], *, seed: int | None) -> Outcome: ...
def fit(
    mission: Mission,
    data: list[DataSet],
    *,
    free: list[str] | None,
    starts: int,
    seed: int | None,
    profiles: list[str],
    samples: int | None,
    holdout: str | None,
    progress: Callable[[str, int, int], object] | None,
) -> Outcome: ...
def diagnose(
    mission: Mission,
    data: list[DataSet],
    *,
    free: list[str] | None,
    level: float,
    seed: int | None,
    candidates: dict[str, Any] | None,
    can: list[str],
    evaluations: int | None,
    stability: bool,
    progress: Callable[[str, int, int], object] | None,
) -> Outcome: ...
def measure(
    frames: list[str | tuple[str, np.ndarray, bool]],
    layout: Mapping[str, Any],
    told: Mapping[str, Any],
    way: Mapping[str, Any],
    progress: Callable[[str, int, int], object] | None,
) -> tuple[list[tuple[str, str]], str, str]: ...
def arctic_readout(
    frame_e: np.ndarray, traps: list[dict[str, float]], setting: dict[str, Any]
) -> np.ndarray: ...
