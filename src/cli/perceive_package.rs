//! The Python package `perceive/`: it travels in the binary, is put where uv can use it, and is started from there.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, bail};
use sha2::{Digest, Sha256};

use super::shown;

/// A file of the package: where it lies, and its text.
macro_rules! files {
    ($($name:literal),* $(,)?) => {
        [$(($name, include_str!(concat!("../../perceive/", $name)))),*]
    };
}

const FILES: [(&str, &str); 29] = files![
    "pyproject.toml",
    "uv.lock",
    "src/paws_perceive/__init__.py",
    "src/paws_perceive/__main__.py",
    "src/paws_perceive/adapters/__init__.py",
    "src/paws_perceive/adapters/deeplsd_lines.py",
    "src/paws_perceive/adapters/depth_anything_poses.py",
    "src/paws_perceive/adapters/limap_lines.py",
    "src/paws_perceive/adapters/mapanything_poses.py",
    "src/paws_perceive/adapters/mediapipe_hands.py",
    "src/paws_perceive/adapters/moge_depth.py",
    "src/paws_perceive/adapters/pycolmap_poses.py",
    "src/paws_perceive/adapters/transformers_depth.py",
    "src/paws_perceive/adapters/transformers_masks.py",
    "src/paws_perceive/adapters/wilor_hands.py",
    "src/paws_perceive/batches.py",
    "src/paws_perceive/cache.py",
    "src/paws_perceive/colmap_text.py",
    "src/paws_perceive/depth.py",
    "src/paws_perceive/exr.py",
    "src/paws_perceive/geometry.py",
    "src/paws_perceive/hands.py",
    "src/paws_perceive/lines.py",
    "src/paws_perceive/masks.py",
    "src/paws_perceive/plan.py",
    "src/paws_perceive/poses.py",
    "src/paws_perceive/poses_io.py",
    "src/paws_perceive/recording.py",
    "src/paws_perceive/tracks.py",
];

/// The way out where nothing can run Python.
const INSTALL: &str = "install uv (https://docs.astral.sh/uv), which gets Python and the packages; or Python 3.10 to 3.12, and \
                       name it with --python PATH";

/// Who runs the package.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Runner {
    /// uv, which gets the packages of an extra.
    Uv,
    /// A Python that has what it has.
    Python(PathBuf),
}

/// The package, and who runs it.
#[derive(Debug)]
pub struct Python {
    runner: Runner,
    package: PathBuf,
}

impl Python {
    /// For networks: the given Python, else uv, else the installed Python, which then has to have the packages.
    pub fn find(given: Option<&Path>) -> anyhow::Result<Self> {
        let runner = match given {
            Some(python) => Runner::Python(checked(python)?),
            None if runs("uv") => Runner::Uv,
            None => Runner::Python(installed()?),
        };
        Ok(Self { runner, package: unpacked()? })
    }

    /// For what needs the standard library alone.
    pub fn plain(given: Option<&Path>) -> anyhow::Result<Self> {
        let runner = match given {
            Some(python) => Runner::Python(checked(python)?),
            None => match installed() {
                Ok(python) => Runner::Python(python),
                Err(_) if runs("uv") => Runner::Uv,
                Err(error) => return Err(error),
            },
        };
        Ok(Self { runner, package: unpacked()? })
    }

    /// Whether uv runs the package, and gets what its extras name.
    pub fn is_uv(&self) -> bool {
        self.runner == Runner::Uv
    }

    /// The package's command, without arguments. `extra`: whose packages it needs, of `pyproject.toml`; `None`: none.
    pub fn command(&self, extra: Option<&str>) -> Command {
        let mut command = match (&self.runner, extra) {
            (Runner::Python(python), _) => Command::new(python),
            (Runner::Uv, None) => {
                let mut uv = Command::new("uv");
                uv.args(["run", "--no-project", "--quiet", "--", "python"]);
                uv
            }
            (Runner::Uv, Some(extra)) => {
                if !self.package.join(".venv").is_dir() {
                    eprintln!("uv gets Python packages for {extra} now (uv.lock in {})", shown(&self.package));
                }
                let mut uv = Command::new("uv");
                uv.args(["run", "--frozen", "--no-dev", "--extra", extra, "--project"]).arg(&self.package);
                uv.args(["--", "python"]);
                uv
            }
        };
        command.args(["-m", "paws_perceive"]).env("PYTHONPATH", self.package.join("src")).stdin(Stdio::null());
        command
    }

    /// Runs a stream, its progress on standard error; whether it found anything.
    pub fn run(&self, mut command: Command, stream: &str, cache: &Path) -> anyhow::Result<bool> {
        // Standard output is for the result alone.
        let status = command.stdout(Stdio::null()).status().with_context(|| format!("{stream}: {INSTALL}"))?;
        match status.code() {
            Some(0) => Ok(true),
            Some(1) => Ok(false),
            Some(_) => bail!(
                "{stream}: could not be made, the reason stands above; what is finished stays in {}",
                shown(cache)
            ),
            None => bail!(
                "{stream}: was stopped by the system (too little memory?); what is finished stays in {}, the same command goes \
                 on there",
                shown(cache)
            ),
        }
    }
}

/// What a command prints; an error is what it said.
pub fn said(mut command: Command) -> anyhow::Result<String> {
    let out = command.output().context(INSTALL)?;
    if !out.status.success() {
        bail!("{}", String::from_utf8_lossy(&out.stderr).trim());
    }
    Ok(String::from_utf8_lossy(&out.stdout).into_owned())
}

/// Whether a program is there and runs.
fn runs(program: &str) -> bool {
    let mut command = Command::new(program);
    command.arg("--version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|s| s.success())
}

fn checked(python: &Path) -> anyhow::Result<PathBuf> {
    let mut command = Command::new(python);
    command.arg("--version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    match command.status() {
        Ok(status) if status.success() => Ok(python.to_owned()),
        Ok(status) => bail!("{}: is no Python that runs ({status}); {INSTALL}", shown(python)),
        Err(error) => bail!("{}: cannot be started ({error}); {INSTALL}", shown(python)),
    }
}

/// The installed Python 3.
fn installed() -> anyhow::Result<PathBuf> {
    match ["python3", "python"].into_iter().find(|name| runs(name)) {
        Some(name) => Ok(PathBuf::from(name)),
        None => bail!("neither uv nor Python is here, and networks run in Python: {INSTALL}"),
    }
}

/// The folder of the package's files, made on first use and named by what is in it.
fn unpacked() -> anyhow::Result<PathBuf> {
    let mut hash = Sha256::new();
    for (name, text) in FILES {
        for bytes in [name.as_bytes(), text.as_bytes()] {
            hash.update((bytes.len() as u64).to_le_bytes());
            hash.update(bytes);
        }
    }
    let digits: String = hash.finalize().iter().take(8).map(|byte| format!("{byte:02x}")).collect();
    let home = home();
    let folder = home.join(format!("perceive-{digits}"));
    if is_whole(&folder) {
        return Ok(folder);
    }
    let staging = home.join(format!(".perceive-{digits}.partial-{}", std::process::id()));
    for (name, text) in FILES {
        let path = staging.join(name);
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).with_context(|| shown(parent))?;
        }
        std::fs::write(&path, text).with_context(|| shown(&path))?;
    }
    // What somebody damaged goes; what another run has put there meanwhile is as good.
    let _ = std::fs::remove_dir_all(&folder);
    let moved = std::fs::rename(&staging, &folder);
    if moved.is_err() {
        let _ = std::fs::remove_dir_all(&staging);
    }
    if !is_whole(&folder) {
        moved.with_context(|| shown(&folder))?;
    }
    Ok(folder)
}

fn is_whole(folder: &Path) -> bool {
    FILES.iter().all(|(name, text)| std::fs::read(folder.join(name)).is_ok_and(|bytes| bytes == text.as_bytes()))
}

/// The folder for what can be made again.
fn home() -> PathBuf {
    let of = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    of("XDG_CACHE_HOME")
        .or_else(|| of("LOCALAPPDATA"))
        .or_else(|| of("HOME").map(|home| home.join(".cache")))
        .unwrap_or_else(std::env::temp_dir)
        .join("paws")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_module_of_the_package_travels_with_the_binary() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("perceive");
        let mut wanted = Vec::new();
        for folder in ["src/paws_perceive", "src/paws_perceive/adapters"] {
            for entry in std::fs::read_dir(root.join(folder)).unwrap() {
                let name = entry.unwrap().file_name().to_string_lossy().into_owned();
                if name.ends_with(".py") {
                    wanted.push(format!("{folder}/{name}"));
                }
            }
        }
        for name in wanted {
            assert!(FILES.iter().any(|(file, _)| *file == name), "{name} is not among FILES");
        }
    }
}
