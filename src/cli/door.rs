//! A recording is held against itself before anything is made of it.

use std::path::Path;

use anyhow::bail;
use clap::Args;

use super::{Answer, Opening, print, shown};
use crate::recording::Recording;
use crate::recording::conventions::{Finding, Subject, findings, repaired};

/// Corrections may uncover what they hid: up, after poses that were inverted.
const ROUNDS: usize = 3;

/// What is done about a recording whose poses, hands or clocks contradict each other.
#[derive(Debug, Clone, Copy, Default, Args)]
pub struct Door {
    /// Correct faults found for certain in the recording's conventions (camera axes, directions, units, up, lags); the files
    /// stay as they are
    #[arg(long, conflicts_with = "as_is")]
    fix: bool,
    /// Ignore faults found for certain in the recording's conventions, and go on with it as it is
    #[arg(long)]
    as_is: bool,
}

impl Door {
    /// The options as a command line has them.
    pub fn flags(self) -> Vec<&'static str> {
        let all = [(self.fix, "--fix"), (self.as_is, "--as-is")];
        all.into_iter().filter(|(is_set, _)| *is_set).map(|(_, flag)| flag).collect()
    }

    /// Opens a recording, says what is doubtful about it, and corrects it where that was asked for.
    pub fn open(self, opening: Opening, dir: &Path) -> anyhow::Result<Recording> {
        let (mut recording, refused) = match opening.open(dir) {
            Ok(recording) => (recording, None),
            // Hands out of reach have a cause, which may be known.
            Err(error) => match Recording::open_unjudged(dir, opening.follow_links) {
                Ok(recording) => (recording, Some(error)),
                Err(_) => return Err(error.into()),
            },
        };
        let mut found = findings(&Subject::of(&recording));
        for _ in 0..ROUNDS {
            if !self.fix || !found.iter().any(Finding::can_be_fixed) {
                break;
            }
            let (next, done) = repaired(recording, &found);
            for what in done {
                eprintln!("{}: corrected: {what}", shown(dir));
            }
            recording = next;
            found = findings(&Subject::of(&recording));
        }
        self.judged(dir, &found, refused)?;
        Ok(super::with_clips(recording, dir))
    }

    /// Says what was found; an error where it is certain and leaves nothing to infer.
    fn judged(self, dir: &Path, found: &[Finding], refused: Option<crate::error::Error>) -> anyhow::Result<()> {
        let grave: Vec<String> = found.iter().filter(|f| f.ruinous && f.is_certain()).map(told).collect();
        if let Some(error) = refused.filter(|_| !self.fix || !grave.is_empty()) {
            match found {
                [] => return Err(error.into()),
                _ => bail!("{error}\nwhat is found:\n{}", found.iter().map(told).collect::<String>()),
            }
        }
        if !grave.is_empty() && !self.as_is {
            bail!(
                "{}: the recording contradicts itself:\n{}--fix corrects what can be corrected, --as-is goes on",
                shown(dir),
                grave.concat()
            );
        }
        for finding in found {
            eprintln!("{}: doubtful:\n{}", shown(dir), told(finding).trim_end());
        }
        Ok(())
    }
}

/// A finding for people, two lines.
fn told(finding: &Finding) -> String {
    format!("  {}\n    {}\n", finding.sentence(), finding.remedy)
}

/// `paws import --check`: prints what is found about recordings.
pub fn check(recordings: &[std::path::PathBuf]) -> anyhow::Result<Answer> {
    let mut answer = Answer::Yes;
    for dir in recordings {
        let recording = match Recording::open_unjudged(dir, true) {
            Ok(recording) => recording,
            Err(error) if recordings.len() == 1 => return Err(error.into()),
            Err(error) => {
                eprintln!("{error}");
                answer = Answer::No;
                continue;
            }
        };
        let found = findings(&Subject::of(&recording));
        if found.is_empty() {
            print(&format!("{}: poses, depth, hands and up agree, as far as the recording has them\n", shown(dir)))?;
            continue;
        }
        answer = Answer::No;
        print(&format!("{}:\n{}", shown(dir), found.iter().map(told).collect::<String>()))?;
    }
    Ok(answer)
}
