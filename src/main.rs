//! The `paws` command.

fn main() -> std::process::ExitCode {
    paws_twin::cli::run()
}
