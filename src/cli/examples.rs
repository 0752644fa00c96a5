//! What stands below the help of each command: two examples; below that of the program: its commands by task, and exit statuses.

use clap::Command;

const BELOW_ALL: &str = "By task:
  plan     evaluate, compare, sweep, catalogue, dose, study
  measure  predict, validate, fit, diagnose, effects
  frames   readout, correct, measure
  files    init, schema, completions, man

Exit status:
  0  done
  1  a requirement is not met (evaluate --check), or a result cannot be written
  2  a bad command line or bad input: one message on standard error";

/// Two examples of each command.
const EXAMPLES: [(&str, [&str; 2]); 18] = [
    ("evaluate", ["ctiplan evaluate mission.toml -q", "ctiplan evaluate mission.toml --check --probability 0.9"]),
    (
        "compare",
        [
            "ctiplan compare mission.toml --launch 2030-01-01,2033-01-01",
            "ctiplan compare mission.toml --line-time-ms 5..100:log:8",
        ],
    ),
    ("sweep", ["ctiplan sweep grid.toml --output all.parquet", "ctiplan sweep grid.toml --output all.csv --slurm 16"]),
    (
        "catalogue",
        [
            "ctiplan catalogue mission.toml galaxies.ecsv --at 5 --out changes.ecsv",
            "ctiplan catalogue mission.toml galaxies.csv --at 1 --out changes.ecsv",
        ],
    ),
    ("dose", ["ctiplan dose mission.toml --explain", "ctiplan dose mission.toml --energies 10,30,100"]),
    (
        "validate",
        [
            "ctiplan validate mission.toml trails.ecsv doses.ecsv",
            "ctiplan validate mission.toml trails.ecsv --html fit.html",
        ],
    ),
    (
        "predict",
        [
            "ctiplan predict mission.toml conditions.csv --out expected.ecsv",
            "ctiplan predict mission.toml conditions.csv --noise --out simulated.ecsv",
        ],
    ),
    (
        "fit",
        [
            "ctiplan fit mission.toml trails.ecsv --free detector.well_fill_power",
            "ctiplan fit mission.toml trails.ecsv --write better.toml",
        ],
    ),
    (
        "diagnose",
        [
            "ctiplan diagnose mission.toml trails.ecsv --write better.toml",
            "ctiplan diagnose mission.toml trails.ecsv --html diagnosis.html",
        ],
    ),
    (
        "readout",
        [
            "ctiplan readout in.fits out.fits --mission mission.toml --at 3.5",
            "ctiplan readout *.fits --mission mission.toml --at 5 --out-folder trailed",
        ],
    ),
    (
        "correct",
        [
            "ctiplan correct in.fits out.fits --mission mission.toml --at 3.5",
            "ctiplan correct *.fits --mission mission.toml --at 5 --out-folder clean",
        ],
    ),
    (
        "measure",
        [
            "ctiplan measure eper flat.fits edges.ecsv --overscan-rows 24",
            "ctiplan measure trails dark.fits trails.ecsv",
        ],
    ),
    ("study", ["ctiplan study clock mission.toml", "ctiplan study shielding mission.toml --probability 0.9"]),
    ("effects", ["ctiplan effects", "ctiplan effects annealing"]),
    ("init", ["ctiplan init mission.toml", "ctiplan init mission.toml --overwrite"]),
    ("schema", ["ctiplan schema", "ctiplan schema > ctiplan.schema.json"]),
    ("completions", ["ctiplan completions bash", "ctiplan completions zsh > _ctiplan"]),
    ("man", ["ctiplan man ~/.local/share/man/man1", "ctiplan man pages --overwrite"]),
];

/// The program with what stands below each help.
pub(super) fn below(program: Command) -> Command {
    EXAMPLES.iter().fold(program.after_help(BELOW_ALL), |program, (name, [one, other])| {
        program.mut_subcommand(*name, |command| command.after_help(format!("Examples:\n  {one}\n  {other}")))
    })
}
