use std::process::ExitCode;

fn main() -> ExitCode {
    ctiplan::cli::run(std::env::args_os())
}
