//! The last lines of the tests: how many checks were skipped, and what was missing.

#[allow(dead_code, reason = "the other half is for those who write the list")]
#[path = "../it/skips.rs"]
mod skips;

#[allow(clippy::print_stdout, reason = "this is for whoever runs the tests")]
fn main() {
    // Whoever lists tests finds none here.
    if std::env::args().any(|arg| arg == "--list") {
        return;
    }
    let list = std::fs::read_to_string(skips::list()).unwrap_or_default();
    match skips::reasons(&list, &skips::run()) {
        Some(reasons) => println!("\n{}", skips::sentence(&reasons)),
        None => println!("\nskipped checks: not counted, as the tests of `it` did not all run"),
    }
}
