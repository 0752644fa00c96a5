#!/usr/bin/env python3
"""Cases with known answers for `ctiplan diagnose`, by a second simulator.

    python3 tests/corpus/other/make.py DIR [--seed N] [--only NAME]

writes each case into DIR/NAME: mission.toml (what is believed), measurements (*.ecsv), truth.json (what is true) and,
where the catalogue has all that is true, true.toml (the mission as it is). Four minutes on one core. Needs numpy and
a C compiler. The same seed gives the same files, whatever --only leaves out.
`cargo run --release --example corpus -- DIR` has the cases diagnosed, and counts.

Everything here was written from the contract's physics alone, not from the program's source: dose, traps, temperatures,
the charge cloud, capture and release, shapes. How it differs from tests/corpus/make.py:

    read-out    a simulator of its own (simulator.c), in which every packet passes every pixel between it and the
                register; there it is ArCTIc's. A continuum of release times is 48 species by Gauss-Hermite quadrature;
                there 21 evenly spaced ones.
    serial      blocks and galaxies pass the serial register as well; there packets only.
    galaxies    drawn by their Fourier transforms, averaged over 3 by 7 even positions in the pixel; there GalSim's, at
                Gauss-Legendre positions in y.
    cases       five other detectors, other arrangements, more pairs (among them some in which neither effect does much
                alone), and errors scaled so that each case is as hard as is asked for.

model.py holds the physics, cases.py the cases, simulator.c the columns.

truth.json
    case, group, verdict, effects, accept (lists of effects that are right answers), parameters (true values, by name;
    not those whose name two hidden effects share), files, note, covariates (outside the catalogue: what residuals
    should lean on), and
    free             true values of the keys that the mission file lets fit
    delta_chi2       chi2 that the noise-free values have against the mission, after its free keys have been adjusted to
                     them in linear approximation
    delta_chi2_each  pairs: the same against the mission that lacks one of the effects, with all others adjusted as well
"""
import argparse
import dataclasses
import json
import math
import pathlib
import subprocess
import tempfile
import time
import zlib

import numpy as np

import cases
from cases import changed, value_of
from model import Predictor, World

HERE = pathlib.Path(__file__).parent
INTEGERS = {"transfers", "trail_px", "block_px"}
# Step by which parameters are moved to see what the measurements do.
SLOPE_STEP = 0.02


def compiled(folder):
    """simulator.c as a shared library in a folder."""
    library = pathlib.Path(folder) / "simulator.so"
    command = ["cc", "-std=c11", "-O2", "-shared", "-fPIC", "-o", str(library), str(HERE / "simulator.c"), "-lm"]
    subprocess.run(command, check=True)
    return library


# --------------------------------------------------------------------------------------------------- values and errors


def stream_of(name, seed):
    """Random numbers of a case, the same whichever other cases are made."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def with_random_columns(case, rng):
    """The case with a value drawn in each row for every random column."""
    files = []
    for file in case.files:
        rows = [{**row, **{name: values[rng.integers(len(values))] for name, values in file.random_columns.items()}}
                for row in file.rows]
        files.append(dataclasses.replace(file, rows=rows))
    return dataclasses.replace(case, files=files)


def all_conditions(file):
    """Rows of a file with what stands in its header."""
    return [{**file.fixed, **row} for row in file.rows]


def predicted(predictor, mission, effects, files):
    """Values of all files without noise, one array for each."""
    world = World(mission, effects)
    return [predictor.values(world, file.observable, all_conditions(file)) for file in files]


def true_values(predictor, case):
    """What a perfect measurement would give, with all that is outside the catalogue."""
    files = case.files
    if case.true_conditions:
        files = [dataclasses.replace(file, fixed={}, rows=[case.true_conditions(row) for row in all_conditions(file)])
                 for file in files]
    values = predicted(predictor, case.mission, case.true_effects, files)
    if case.reading:
        values = [np.array([case.reading(value, row) for value, row in zip(of_file, all_conditions(file))])
                  for of_file, file in zip(values, case.files)]
    return values


def errors_of(case, values):
    """Errors of each file, before the case's factor."""
    return [np.hypot(file.sigma[0], file.sigma[1] * np.abs(of_file)) for file, of_file in zip(case.files, values)]


def neighbours(case, effects):
    """(mission, effects) with one free key or one parameter of an effect moved; days of events are not."""
    for key in case.free:
        yield changed(case.mission, {key: value_of(case.mission, key) * (1.0 + SLOPE_STEP)}), effects
    for index, (kind, parameters) in enumerate(effects):
        for name, value in parameters.items():
            if isinstance(value, float) and name != "t_yr":
                moved = (kind, {**parameters, name: value * (1.0 + SLOPE_STEP)})
                yield case.mission, effects[:index] + [moved] + effects[index + 1:]


def missed_chi2(predictor, case, values, errors, known, adjusted=()):
    """chi2 of the true values against the mission with some effects that stay as they are, and others that are adjusted
    as the free keys are."""
    known, adjusted = list(known), list(adjusted)

    def in_errors(mission, effects):
        return np.concatenate(predicted(predictor, mission, effects, case.files)) / np.concatenate(errors)
    base = in_errors(case.mission, known + adjusted)
    missed = np.concatenate(values) / np.concatenate(errors) - base
    slopes = [in_errors(mission, known + moved) - base for mission, moved in neighbours(case, adjusted)]
    if slopes:
        slopes = np.array(slopes).T
        missed = missed - slopes @ np.linalg.lstsq(slopes, missed, rcond=None)[0]
    return float(missed @ missed)


@dataclasses.dataclass
class Simulated:
    """A case without noise."""
    case: cases.Case
    values: list
    errors: list
    delta_chi2: float = 0.0
    delta_chi2_each: dict = dataclasses.field(default_factory=dict)


def simulated(predictor, case):
    values = true_values(predictor, case)
    errors = errors_of(case, values)
    factor, gain = case.sigma_factor, 0.0
    if case.group not in ("complete", "unfit"):
        gain = missed_chi2(predictor, case, values, errors, case.known)
    if case.chi2_gain:
        factor = math.sqrt(gain / case.chi2_gain)
    each = {}
    if case.group == "pair":
        for index, (kind, parameters) in enumerate(case.hidden):
            others = case.hidden[:index] + case.hidden[index + 1:]
            name = parameters.get("name", kind)
            each[name] = missed_chi2(predictor, case, values, errors, case.known, others) / factor ** 2
    errors = [np.array([rounded(factor * error) for error in of_file]) for of_file in errors]
    return Simulated(case, values, errors, gain / factor ** 2, each)


def rounded(value, digits=4):
    return float(f"{value:.{digits}g}")


# ------------------------------------------------------------------------------------------------------------- noise


@dataclasses.dataclass
class Measured:
    """What is written of one file."""
    file: cases.File
    values: np.ndarray
    sigmas: np.ndarray


def measure(file, case, values, errors, rng):
    """Noise, and what makes data unfit."""
    values = values + errors * rng.standard_normal(len(values))
    if case.outlier_sigma:
        wrong = len(values) // 3
        values[wrong] += case.outlier_sigma * errors[wrong]
    if case.contradiction_sigma:
        # The second half repeats the first: too high to begin with, too low later.
        again = len(values) // 2
        signs = np.where(np.arange(len(values) - again) < again // 2, 1.0, -1.0)
        values[again:] += signs * case.contradiction_sigma * errors[again:]
    if case.copied:
        return Measured(dataclasses.replace(file, rows=2 * file.rows), np.tile(values, 2), np.tile(errors, 2))
    return Measured(file, values, case.quoted_factor * errors)


# ------------------------------------------------------------------------------------------------------------- files


def toml_value(value):
    if isinstance(value, (str, list)):
        return json.dumps(value)
    return value.isoformat() if hasattr(value, "isoformat") else repr(value)


def toml_lines(table, path=""):
    """A table, then the tables in it."""
    inner = {name: value for name, value in table.items()
             if isinstance(value, dict) or isinstance(value, list) and value and isinstance(value[0], dict)}
    lines = [f"{name} = {toml_value(value)}" for name, value in table.items() if name not in inner]
    for name, value in inner.items():
        key = f"{path}.{name}" if path else name
        for entry in value if isinstance(value, list) else [value]:
            lines += ["", f"[[{key}]]" if isinstance(value, list) else f"[{key}]", *toml_lines(entry, key)]
    return lines


def write_mission(path, mission, effects, free=()):
    tables = dict(mission)
    if effects:
        by_kind = {kind: [parameters for other, parameters in effects if other == kind] for kind, _ in effects}
        tables["effects"] = {kind: found if len(found) > 1 else found[0] for kind, found in by_kind.items()}
    if free:
        tables["fit"] = {"free": list(free)}
    path.write_text("\n".join(toml_lines(tables)).lstrip() + "\n")


def write_measurements(path, measured):
    file = measured.file
    columns = list(file.rows[0])

    def type_of(name):
        if name in INTEGERS:
            return "int64"
        return "string" if isinstance(file.rows[0].get(name), str) else "float64"
    meta = {**file.fixed, "observable": file.observable}
    lines = ["# %ECSV 1.0", "# ---", "# datatype:",
             *(f"# - {{name: {name}, datatype: {type_of(name)}}}" for name in [*columns, "value", "sigma"]),
             "# delimiter: ','", f"# meta: {{{', '.join(f'{name}: {value}' for name, value in meta.items())}}}",
             "# schema: astropy-2.0", ",".join([*columns, "value", "sigma"])]
    for row, value, sigma in zip(file.rows, measured.values, measured.sigmas):
        lines.append(",".join([*(str(row[name]) for name in columns), f"{value:.8g}", f"{sigma:.4g}"]))
    path.write_text("\n".join(lines) + "\n")


def flat_parameters(hidden):
    """Values of the hidden effects by name; a name that stands for two of them is left out."""
    found = {}
    for kind, parameters in hidden:
        if kind == "serial-traps":
            trap, = parameters["traps"]
            parameters = {name: parameters[name] for name in ("pixel_time_ms", "transfers")} | {
                name: trap[name] for name in ("density_per_px", "release_ms")}
        for name, value in parameters.items():
            if not isinstance(value, str):
                found.setdefault(name, []).append(value)
    return {name: values[0] for name, values in found.items() if len(values) == 1}


def truth_of(result, measured):
    case = result.case
    kinds = sorted(kind for kind, _ in case.hidden)
    truth = {"case": case.name, "group": case.group, "verdict": case.verdict, "effects": kinds, "accept": [kinds],
             "parameters": flat_parameters(case.hidden), "files": [of_file.file.name for of_file in measured],
             "note": case.note}
    if case.covariates:
        truth["covariates"] = case.covariates
    truth["free"] = {key: value_of(case.mission, key) for key in case.free}
    truth["delta_chi2"] = rounded(result.delta_chi2)
    if result.delta_chi2_each:
        truth["delta_chi2_each"] = {kind: rounded(chi2) for kind, chi2 in result.delta_chi2_each.items()}
    return truth


def believed_mission(case):
    """The mission file's numbers: those that may be fitted can be off."""
    return changed(case.mission, {key: rounded(factor * value_of(case.mission, key))
                                  for key, factor in case.believed.items()})


def write_case(predictor, case, folder, seed):
    """Writes a case; returns its number of rows and its delta_chi2."""
    rng = stream_of(case.name, seed)
    result = simulated(predictor, with_random_columns(case, rng))
    case = result.case
    measured = [measure(file, case, values, errors, rng)
                for file, values, errors in zip(case.files, result.values, result.errors)]
    folder.mkdir(parents=True, exist_ok=True)
    for of_file in measured:
        write_measurements(folder / of_file.file.name, of_file)
    write_mission(folder / "mission.toml", believed_mission(case), case.known, case.free)
    if not (case.beyond or case.true_conditions or case.reading or case.group == "unfit"):
        write_mission(folder / "true.toml", case.mission, case.true_effects)
    (folder / "truth.json").write_text(json.dumps(truth_of(result, measured), indent=1) + "\n")
    return sum(len(of_file.values) for of_file in measured), result.delta_chi2


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("folder", metavar="DIR", type=pathlib.Path, help="where to make one folder for each case")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the noise; 1 by default")
    parser.add_argument("--only", default="", metavar="NAME", help="cases whose name contains this")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        predictor = Predictor(compiled(temporary))
        print(f"{'case':44} {'rows':>5} {'delta chi2':>11} {'s':>6}")
        for case in cases.all_cases():
            if arguments.only in case.name:
                start = time.monotonic()
                rows, delta_chi2 = write_case(predictor, case, arguments.folder / case.name, arguments.seed)
                print(f"{case.name:44} {rows:5} {delta_chi2:11.4g} {time.monotonic() - start:6.1f}", flush=True)
                predictor.forget()


if __name__ == "__main__":
    main()
