//! The thin skin: parse, dispatch, print the error once, exit code.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
