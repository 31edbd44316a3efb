//! Progress on standard error, only where a person watches.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::calls;

/// A bar per step and the time that each took.
pub struct Steps {
    bar: ProgressBar,
    current: Mutex<String>,
    times: Mutex<Vec<(String, Duration)>>,
    started: Mutex<Instant>,
}

impl Steps {
    /// A bar that is hidden where standard error is no terminal, or where a program called.
    pub fn new() -> Self {
        let bar = if calls::is_called() { ProgressBar::hidden() } else { ProgressBar::new(1) };
        if let Ok(style) = ProgressStyle::with_template("{msg:>14} {wide_bar} {pos}/{len} {elapsed} {prefix}") {
            bar.set_style(style);
        }
        Self {
            bar,
            current: Mutex::new(String::new()),
            times: Mutex::new(Vec::new()),
            started: Mutex::new(Instant::now()),
        }
    }

    /// Takes the pipeline's reports.
    pub fn report(&self, step: &str, done: usize, total: usize) {
        if let Ok(mut current) = self.current.lock()
            && *current != step
        {
            self.close(&current);
            step.clone_into(&mut current);
            self.bar.set_message(step.to_owned());
        }
        self.bar.set_length(total as u64);
        self.bar.set_position(done as u64);
        // Last, with nothing locked: a caller may end the command here.
        calls::report(step, done, total);
    }

    /// Something that changes while a step goes on, behind the bar.
    pub fn note(&self, text: String) {
        self.bar.set_prefix(text);
    }

    fn close(&self, step: &str) {
        if let (Ok(mut times), Ok(mut started)) = (self.times.lock(), self.started.lock()) {
            if !step.is_empty() {
                // A step that comes twice is told once.
                match times.iter().position(|(name, _)| name == step) {
                    Some(i) => times[i].1 += started.elapsed(),
                    None => times.push((step.to_owned(), started.elapsed())),
                }
            }
            *started = Instant::now();
        }
    }

    /// Ends the last step, clears the bar and returns the steps with their times.
    pub fn finish(&self) -> Vec<(String, Duration)> {
        if let Ok(mut current) = self.current.lock() {
            self.close(&current);
            current.clear();
        }
        self.bar.finish_and_clear();
        self.times.lock().map(|t| t.clone()).unwrap_or_default()
    }
}
