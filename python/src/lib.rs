//! The Python module `paws_twin._native`: the commands of `paws`, called in Python's process.
//!
//! What is said, and the result files, are made into objects by the Python files beside it.

use std::ffi::OsString;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use paws_twin::cli::{self, Called};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// How long a Ctrl-C waits to be seen.
const PATIENCE: Duration = Duration::from_millis(50);
/// What the main thread of a program has on Linux; other threads have a quarter of it.
const STACK_BYTES: usize = 8 << 20;

/// Exit code, standard output, notes and error.
type Said = (u8, String, String, Option<String>);

/// Runs a command in a thread of its own, without Python's lock. `progress(step, done, total)` is called in the calling
/// thread; what it raises, and Ctrl-C, ends the command, which then leaves no files.
#[pyfunction]
#[pyo3(signature = (args, progress=None))]
fn call(py: Python<'_>, args: Vec<OsString>, progress: Option<Py<PyAny>>) -> PyResult<Said> {
    let (sender, mut receiver) = mpsc::channel::<(String, usize, usize)>();
    let stop = Arc::new(AtomicBool::new(false));
    let told_to_stop = Arc::clone(&stop);
    let listener = move |step: &str, done: usize, total: usize| {
        // Nobody receives any more only where the calling thread is gone.
        let _ = sender.send((step.to_owned(), done, total));
        !told_to_stop.load(Ordering::Relaxed)
    };
    let worker = std::thread::Builder::new()
        .name("paws".to_owned())
        .stack_size(STACK_BYTES)
        .spawn(move || cli::call(&args, Arc::new(listener)))?;
    let mut raised: Option<PyErr> = None;
    loop {
        let (back, heard) = py.detach(move || {
            let heard = receiver.recv_timeout(PATIENCE);
            (receiver, heard)
        });
        receiver = back;
        if raised.is_none() {
            let told = match (&heard, &progress) {
                (Ok((step, done, total)), Some(progress)) => {
                    progress.call1(py, (step.as_str(), *done, *total)).map(|_| ())
                }
                _ => Ok(()),
            };
            raised = told.and_then(|()| py.check_signals()).err();
            stop.store(raised.is_some(), Ordering::Relaxed);
        }
        if heard == Err(RecvTimeoutError::Disconnected) {
            break;
        }
    }
    let called = py.detach(move || worker.join());
    if let Some(raised) = raised {
        return Err(raised);
    }
    let Called { code, out, notes, error } =
        called.map_err(|_| PyRuntimeError::new_err("a fault of paws itself: its thread ended"))?;
    Ok((code, out, notes, error))
}

/// Runs the command line `args`, the program's name first, as `paws` does: it prints, and answers with the exit code.
#[pyfunction]
fn main(py: Python<'_>, args: Vec<OsString>) -> u8 {
    py.detach(move || cli::run_with(args))
}

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(call, module)?)?;
    module.add_function(wrap_pyfunction!(main, module)?)
}
