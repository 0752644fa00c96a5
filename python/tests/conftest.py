"""Files of the repository that tests read."""

from pathlib import Path

import pytest

import ctiplan as cp

ROOT = Path(__file__).resolve().parents[2]
PRACTICE = ROOT / "tests" / "practice" / "slow-trap"


@pytest.fixture(scope="module")
def snap() -> cp.Mission:
    return cp.Mission.read(ROOT / "missions" / "snap_l2.toml")


@pytest.fixture(scope="module")
def laboratory() -> cp.Mission:
    return cp.Mission.read(PRACTICE / "mission.toml")


@pytest.fixture(scope="module")
def data(laboratory: cp.Mission) -> list[cp.DataSet]:
    return [cp.DataSet.read(PRACTICE / name, laboratory) for name in ("packets.ecsv", "trails.ecsv")]
