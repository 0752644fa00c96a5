"""When radiation damage to CCDs has spoiled the shapes of galaxies, and which effect a model of it lacks.

A mission goes in, an answer comes out::

    import ctiplan as cp

    mission = cp.Mission.read("missions/snap_l2.toml")
    print(cp.evaluate(mission))

All computation is that of the command ``ctiplan``; see docs/python.md.
"""

from ctiplan import measure
from ctiplan._ctiplan import __version__, set_threads, threads
from ctiplan._detector import Corrected, Detector, Residual
from ctiplan._errors import InputError, InternalError
from ctiplan._mission import DataSet, Mission
from ctiplan._questions import compare, diagnose, evaluate, fit, validate
from ctiplan._results import Comparison, Crossing, Diagnosis, Evaluation, Fit, Parameter, Result, Rung, Validation, Verdict

__all__ = [
    "Comparison",
    "Corrected",
    "Crossing",
    "DataSet",
    "Detector",
    "Diagnosis",
    "Evaluation",
    "Fit",
    "InputError",
    "InternalError",
    "Mission",
    "Parameter",
    "Residual",
    "Result",
    "Rung",
    "Validation",
    "Verdict",
    "__version__",
    "compare",
    "diagnose",
    "evaluate",
    "fit",
    "measure",
    "set_threads",
    "threads",
    "validate",
]
