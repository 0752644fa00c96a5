//! `ctiplan evaluate` begins with its verdict, in every form, and colours it on terminals alone.

use std::process::Command;

const MISSIONS: [&str; 4] = [
    "missions/snap_l2.toml",
    "missions/hst_leo.toml",
    "missions/survey_nchannel_l2.toml",
    "docs/population/snap_two_galaxies.toml",
];

fn said(mission: &str, more: &[&str]) -> String {
    let words = ["evaluate", mission, "--samples", "0"];
    let output =
        Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(words).args(more).env("NO_COLOR", "1").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Words of a text, however its lines are broken.
fn words(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn every_form_begins_with_the_verdict_and_has_the_warnings() {
    for mission in MISSIONS {
        let (brief, short, whole) = (said(mission, &["-q"]), said(mission, &[]), said(mission, &["-v"]));
        let lines: Vec<&str> = brief.lines().collect();
        assert!(lines[0].starts_with("  uncorrected ") && lines[1].starts_with("  corrected, factor "), "{brief}");
        assert!(words(&brief).contains("conditions "), "{brief}");
        for text in [&short, &whole] {
            assert!(text.contains(&brief), "{mission}: the verdict is not in\n{text}");
            // After the title, at most two lines, and a gap.
            let place = text.lines().position(|line| line == lines[0]).unwrap();
            assert!(place <= 3, "{mission}: the verdict is in line {place}");
        }
        assert_eq!(brief, said(mission, &["--brief"]));
        assert!(short.lines().count() < whole.lines().count());
        assert!(whole.contains("Release times at the end of the mission"), "{whole}");
        // Only the pointer to the rest, and tables of all years in place of the last, differ.
        for line in short.lines().filter(|line| !line.contains(": -v") && !line.starts_with("next")) {
            assert!(words(&whole).contains(&words(line)), "{mission}: -v has lost {line}");
        }
    }
}

#[test]
fn the_whole_and_the_brief_exclude_each_other_and_formats() {
    for more in [&["-q", "-v"][..], &["-q", "--json"], &["-v", "--csv"]] {
        let output =
            Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(["evaluate", MISSIONS[0]]).args(more).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{more:?}");
        assert!(output.stdout.is_empty(), "{more:?}");
    }
}

#[test]
fn colours_are_those_of_the_verdict_and_change_no_word() {
    let run = |set: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ctiplan"));
        command.args(["evaluate", MISSIONS[0], "--samples", "0"]).env_remove("NO_COLOR").env(set, "1");
        String::from_utf8(command.output().unwrap().stdout).unwrap()
    };
    let (plain, coloured) = (run("NO_COLOR"), run("CLICOLOR_FORCE"));
    assert!(!plain.contains('\u{1b}') && !run("UNRELATED").contains('\u{1b}'), "a pipe takes no colours");
    let (met, exceeded) = ("\u{1b}[32m", "\u{1b}[31m");
    assert!(coloured.contains(met) && coloured.contains(exceeded), "{coloured}");
    let stripped = ["\u{1b}[32m", "\u{1b}[31m", "\u{1b}[33m", "\u{1b}[0m"]
        .iter()
        .fold(coloured, |text, code| text.replace(code, ""));
    assert_eq!(stripped, plain);
}
