//! Arguments and subcommands: the only place that writes files and prints.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command prints; the library does not")]

/// Standard error, or what a calling program collects (`calls`). It hides std's macro from all commands, so that none of them
/// prints past its caller.
macro_rules! eprintln {
    ($($part:tt)*) => { $crate::cli::calls::note(&format!($($part)*)) };
}

mod ablate;
mod batch;
mod cache;
mod calls;
mod check;
mod compare;
mod config;
mod demo;
mod door;
mod evaluate;
mod evaluate_joints;
mod export;
mod foreign;
mod frames;
mod import;
mod infer;
mod joints;
mod keep;
mod look;
mod many;
mod measure;
mod moved;
mod output;
mod perceive;
mod perceive_package;
mod perceive_streams;
mod primitives;
mod progress;
mod synth;
mod twin;
mod units;
mod validate;
mod words;
mod workers;

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::{Args, Parser, Subcommand};

pub use self::calls::{Called, Listener, call};
use crate::config::Config;
use crate::hands::find;
use crate::recording::Recording;

/// What a command answers, as an exit code: 0 done, 1 ran but the answer is no, 2 error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// Done.
    Yes,
    /// It ran, but a joint failed or nothing was found.
    No,
}

impl Answer {
    fn code(self) -> u8 {
        match self {
            Self::Yes => 0,
            Self::No => 1,
        }
    }
}

#[derive(Debug, Parser)]
#[command(
    name = "paws",
    version,
    about = "Turns a recording of somebody opening doors and drawers into a simulated kitchen",
    after_help = "Start with `paws demo`. Your own recording: `paws perceive SCAN --out rec`, then `paws twin rec --out twin`.\n\
                  Exit codes: 0 done; 1 done, but a joint failed, a check did, nothing was found or something was left out; \
                  2 error."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    // The help lists them in this order: what makes a twin, what uses one, what measures the method.
    /// Render a recording of a kitchen, make its twin and say where to look
    Demo(demo::DemoArgs),
    /// Make a recording: convert files of devices, data sets and networks, which hold poses and hands
    Import(Box<import::ImportArgs>),
    /// Make a recording: convert such files, or a video, and find missing hands, poses and depth by open networks
    Perceive(Box<perceive::PerceiveArgs>),
    /// Make a simulated, validated twin from a recording
    Twin(twin::TwinArgs),
    /// Make the twins of many recordings; a run that was killed goes on where it was
    Batch(batch::BatchArgs),
    /// List the frames of a recording that `paws twin` reads: networks need see no others
    Frames(frames::FramesArgs),
    /// Infer joints alone, without a twin, from recordings or from a bare trajectory
    Infer(infer::InferArgs),
    /// Use a twin: write it, or joints that another program found, as URDF, MJCF, glTF and USD
    Export(export::ExportArgs),
    /// Use a twin or any model: check its file without simulating it (limits, masses, names, collisions, missing files)
    Check(check::CheckArgs),
    /// Use a twin or any model: replay recorded hands on its joints in a physics engine
    Validate(validate::ValidateArgs),
    /// Use a twin: measure how it looks beside the recorded frames, and its shape beside a truth
    Compare(compare::CompareArgs),
    /// Research: count how many predicted joints are right, by a truth
    Evaluate(evaluate::EvaluateArgs),
    /// Research: run several configurations on recordings with a truth, to see what each choice is worth
    Ablate(ablate::AblateArgs),
    /// Research: measure the steps before the joint (hands, contact, lines, faces) by a truth
    Measure(measure::MeasureArgs),
    /// Research: write a recording of a synthetic kitchen with its truth
    Synth(synth::SynthArgs),
    /// Print every parameter with its value, unit, source and meaning
    Config(config::ConfigArgs),
}

/// Arguments of all commands that run steps of the pipeline.
#[derive(Debug, Clone, Default, Args)]
pub struct ConfigFile {
    /// Parameters to change: a TOML file (`paws config --toml` prints all of them), or `paper` (the paper's method, each clip
    /// alone), or `paper_s` (the paper's, clips of one part together)
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

impl ConfigFile {
    fn read(&self) -> crate::error::Result<Config> {
        match self.config.as_deref() {
            None => Ok(Config::default()),
            Some(word) if word == Path::new("paper") && !word.exists() => Ok(Config::paper()),
            Some(word) if word == Path::new("paper_s") && !word.exists() => Ok(Config::paper_s()),
            Some(file) => Config::read(file),
        }
    }
}

/// Arguments of all commands that read recordings.
#[derive(Debug, Clone, Copy, Default, Args)]
pub struct Opening {
    /// Also read files outside the recording's folder, where links or the paths in cameras.json lead there; otherwise they are
    /// an error, because pictures may be sent to a language model
    #[arg(long)]
    follow_links: bool,
}

impl Opening {
    /// Opens a recording, and says what it leaves open.
    fn open(self, dir: &Path) -> crate::error::Result<Recording> {
        let recording = if self.follow_links { Recording::open_following_links(dir) } else { Recording::open(dir) }?;
        let repeated = recording.repeated_times();
        if let Some(first) = repeated.first() {
            eprintln!(
                "{}: cameras.json: {} frames have the time of the frame before (frame {first} is the first): there no speed is \
                 to be had; give each frame its own time",
                shown(dir),
                repeated.len()
            );
        }
        for note in &recording.left_out.notes {
            eprintln!("{}: {note}", shown(dir));
        }
        for (clip, why) in &recording.left_out.clips {
            eprintln!("{}: clips.json: clip {} is left out: {why}", shown(dir), clip.clip);
        }
        Ok(recording)
    }
}

/// The recording with the interactions that are found in it, where nobody said when they are.
fn with_clips(mut recording: Recording, dir: &Path) -> Recording {
    if recording.clips.is_empty() {
        recording.clips = find::interactions(&recording, &crate::config::Hands::default());
        eprintln!("{}: no clips.json: found {} interactions by the hands", shown(dir), recording.clips.len());
    }
    recording
}

/// Whether this process is the program `paws`: then its executable is.
static IS_PROGRAM: AtomicBool = AtomicBool::new(false);

fn is_program() -> bool {
    IS_PROGRAM.load(Ordering::Relaxed)
}

/// Runs the command line of this process, which is the program `paws`.
#[must_use]
pub fn run() -> ExitCode {
    IS_PROGRAM.store(true, Ordering::Relaxed);
    ExitCode::from(run_with(std::env::args_os()))
}

/// Runs a command line in any program, the name of `paws` first, and answers with the exit code. It prints, help and errors included.
#[must_use]
pub fn run_with(args: impl IntoIterator<Item = OsString>) -> u8 {
    let cli = match Cli::try_parse_from(args) {
        Ok(cli) => cli,
        Err(error) => {
            // Where that cannot be printed there is nobody to tell.
            let _ = error.print();
            return if error.use_stderr() { 2 } else { 0 };
        }
    };
    match answer_of(cli) {
        Ok(answer) => answer.code(),
        Err(error) => {
            // A closed pipe (`paws config | head`) is the reader's choice.
            if error
                .chain()
                .any(|e| e.downcast_ref::<std::io::Error>().is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe))
            {
                return 0;
            }
            eprintln!("error: {error:#}");
            2
        }
    }
}

fn answer_of(cli: Cli) -> anyhow::Result<Answer> {
    match cli.command {
        Command::Demo(args) => demo::run(&args),
        Command::Import(args) => import::run(&args),
        Command::Perceive(args) => perceive::run(&args),
        Command::Twin(args) => twin::run(&args),
        Command::Batch(args) => batch::run(&args),
        Command::Frames(args) => frames::run(&args),
        Command::Infer(args) => infer::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Check(args) => check::run(&args),
        Command::Validate(args) => validate::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Evaluate(args) => evaluate::run(&args),
        Command::Ablate(args) => ablate::run(&args),
        Command::Measure(args) => measure::run(&args),
        Command::Synth(args) => synth::run(&args),
        Command::Config(args) => config::run(&args),
    }
}

/// Prints to standard output; a closed pipe is an error that [`run`] takes for success.
fn print(text: &str) -> anyhow::Result<()> {
    use std::io::Write;
    if calls::took(text) {
        return Ok(());
    }
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.flush()?;
    Ok(())
}

/// A path as it is told to people.
fn shown(path: &Path) -> String {
    path.display().to_string()
}
