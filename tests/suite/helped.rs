//! The help of every command: two examples with options that it has; commands by task and exit statuses in that of the program.

use std::process::Command;

fn help(words: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(words).arg("--help").output().unwrap();
    assert!(output.status.success(), "{words:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// Lines below a heading.
fn below<'a>(help: &'a str, heading: &str) -> Vec<&'a str> {
    help.lines().skip_while(|line| *line != heading).skip(1).take_while(|line| line.starts_with("  ")).collect()
}

#[test]
fn every_command_has_a_task_and_two_examples_of_its_options() {
    let all = help(&[]);
    let listed = below(&all, "Commands:");
    let names =
        listed.iter().filter(|line| !line.starts_with("   ")).map(|line| line.split_whitespace().next().unwrap());
    let tasks = below(&all, "By task:").join("\n").replace(',', "");
    let statuses = below(&all, "Exit status:");
    assert_eq!(statuses.iter().map(|line| &line[2..3]).collect::<Vec<_>>(), ["0", "1", "2"]);
    let mut checked = 0;
    for name in names.filter(|name| *name != "help") {
        assert!(tasks.split_whitespace().any(|word| word == name), "{name} has no task:\n{tasks}");
        let own = help(&[name]);
        let examples = below(&own, "Examples:");
        assert_eq!(examples.len(), 2, "{name}: {own}");
        for example in examples {
            let words: Vec<&str> = example.split_whitespace().collect();
            assert_eq!(words[..2], ["ctiplan", name]);
            let options = words.iter().filter(|word| word.starts_with('-'));
            let known = if ["study", "measure"].contains(&name) { help(&[name, words[2]]) } else { own.clone() };
            for option in options {
                let is_known = |word: &str| word.trim_end_matches(',') == *option;
                let listed = known.split("Examples:").next().unwrap();
                assert!(listed.split_whitespace().any(is_known), "{name} has no {option}");
            }
            checked += 1;
        }
    }
    assert!(checked > 30, "{checked}");
}
