//! Frames of video files, through ffmpeg where it is installed. Each file is decoded once.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::error::{Error, Result};

/// The longest list of frames that a command line takes on every system, bytes.
const MAX_EXPRESSION_BYTES: usize = 100_000;

/// The way out where ffmpeg is not there.
pub const INSTALL: &str =
    "install ffmpeg (https://ffmpeg.org; Debian: apt install ffmpeg), or give it with --ffmpeg PATH";

/// The endings of video files.
pub const ENDINGS: [&str; 4] = ["mp4", "mov", "m4v", "mkv"];

/// Whether a path ends like a video file.
#[must_use]
pub fn is_video(path: &Path) -> bool {
    let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    ENDINGS.contains(&ending.as_str()) && path.is_file()
}

/// ffmpeg, or the program of that name beside it.
fn program(ffmpeg: Option<&Path>, name: &str) -> PathBuf {
    match ffmpeg {
        Some(path) if name == "ffmpeg" => path.to_owned(),
        Some(path) => {
            let ending = path.extension().map(|e| format!(".{}", e.to_string_lossy())).unwrap_or_default();
            path.with_file_name(format!("{name}{ending}"))
        }
        None => PathBuf::from(name),
    }
}

/// A file's name as an argument: one that begins with a dash is no option.
fn argument(path: &Path) -> PathBuf {
    if path.to_string_lossy().starts_with('-') { Path::new(".").join(path) } else { path.to_owned() }
}

fn run(program: &Path, command: &mut Command, file: &Path) -> Result<Vec<u8>> {
    let out = command.stdin(Stdio::null()).output().map_err(|e| {
        let message = match e.kind() {
            std::io::ErrorKind::NotFound => {
                format!("{} is needed to read it and was not found; {INSTALL}", program.display())
            }
            _ => format!("{} cannot be run ({e}); {INSTALL}", program.display()),
        };
        Error::Io { path: file.to_owned(), message }
    })?;
    if !out.status.success() {
        let said = String::from_utf8_lossy(&out.stderr);
        // The first line names the cause, the others what failed because of it.
        let first = said.lines().map(str::trim).find(|l| !l.is_empty()).unwrap_or("no reason given");
        return Err(Error::format(file, "video", format!("{} could not read it: {first}", program.display())));
    }
    Ok(out.stdout)
}

/// The time of each picture in the order of display, seconds from the file's start, however they are spaced. Nothing is decoded.
///
/// # Errors
/// Where ffprobe is not there or finds no video.
pub fn times(ffmpeg: Option<&Path>, file: &Path) -> Result<Vec<f64>> {
    let ffprobe = program(ffmpeg, "ffprobe");
    let mut command = Command::new(&ffprobe);
    command.args(["-v", "error", "-select_streams", "v:0", "-show_entries", "packet=pts_time,flags", "-of", "csv=p=0"]);
    command.arg(argument(file));
    let text = run(&ffprobe, &mut command, file)?;
    let mut times: Vec<f64> = String::from_utf8_lossy(&text)
        .lines()
        .filter_map(|line| {
            let mut cells = line.split(',');
            let time = cells.next()?.trim().parse::<f64>().ok().filter(|t| t.is_finite())?;
            // Packets marked D are decoded and not shown.
            cells.next().is_none_or(|flags| !flags.contains('D')).then_some(time)
        })
        .collect();
    if times.is_empty() {
        return Err(Error::format(file, "video", "ffprobe finds no picture in it; is it a whole video file?"));
    }
    times.sort_by(f64::total_cmp);
    let first = times.first().copied().unwrap_or(0.0);
    times.iter_mut().for_each(|t| *t -= first);
    Ok(times)
}

/// Columns and rows of a file's pictures as they are shown; `None` where ffprobe is not there or finds no video.
#[must_use]
pub fn size(ffmpeg: Option<&Path>, file: &Path) -> Option<[usize; 2]> {
    let ffprobe = program(ffmpeg, "ffprobe");
    let mut command = Command::new(&ffprobe);
    command.args(["-v", "error", "-select_streams", "v:0", "-show_entries", "stream=width,height", "-of", "csv=p=0"]);
    command.arg(argument(file));
    let text = run(&ffprobe, &mut command, file).ok()?;
    let text = String::from_utf8_lossy(&text);
    let mut numbers = text.lines().next()?.split(',').map(|n| n.trim().parse::<usize>().ok());
    Some([numbers.next()??, numbers.next()??])
}

/// ffmpeg's words for a set of frames: equal steps are one term each. `frames` ascends.
fn expression(frames: &[usize]) -> String {
    let mut terms = Vec::new();
    let mut at = 0;
    while let Some(&first) = frames.get(at) {
        let step = frames.get(at + 1).map_or(1, |next| next - first);
        let mut end = at + 1;
        while frames.get(end).is_some_and(|f| *f == frames[end - 1] + step) {
            end += 1;
        }
        let last = frames[end - 1];
        terms.push(match end - at {
            1 => format!("eq(n\\,{first})"),
            _ => format!("between(n\\,{first}\\,{last})*not(mod(n-{first}\\,{step}))"),
        });
        at = end;
    }
    terms.join("+")
}

/// Decodes some pictures of a file (numbers in the order of display, ascending) to JPEG files in a folder that is there, in
/// one run. Returns their paths in the same order; shorter where the video ends before.
///
/// # Errors
/// Where ffmpeg is not there or fails.
pub fn extract(
    ffmpeg: Option<&Path>,
    file: &Path,
    is_upright: bool,
    frames: &[usize],
    folder: &Path,
) -> Result<Vec<PathBuf>> {
    let select = expression(frames);
    if select.len() > MAX_EXPRESSION_BYTES {
        let message =
            format!("{} pictures at uneven steps are too many for one run; ask for fewer with --fps", frames.len());
        return Err(Error::format(file, "video", message));
    }
    let ffmpeg = program(ffmpeg, "ffmpeg");
    let decode = |each_once: &str| {
        let mut command = Command::new(&ffmpeg);
        command.args(["-nostdin", "-v", "error", "-y"]);
        if !is_upright {
            command.arg("-noautorotate");
        }
        command.arg("-i").arg(argument(file));
        command.args(["-map", "0:v:0", "-vf"]).arg(format!("select={select}"));
        // 2 is JPEG's finest quality here.
        command.args([each_once, "passthrough", "-q:v", "2"]).arg(folder.join("%06d.jpg"));
        run(&ffmpeg, &mut command, file)
    };
    // Every picture once, by its own number: the option has another name before ffmpeg 5.1.
    match decode("-fps_mode") {
        Err(error) if error.to_string().contains("fps_mode") => decode("-vsync")?,
        other => other?,
    };
    let paths = (1..=frames.len()).map(|i| folder.join(format!("{i:06}.jpg")));
    Ok(paths.take_while(|p| p.is_file()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_steps_are_one_term() {
        assert_eq!(expression(&[0, 3, 6, 9, 20]), "between(n\\,0\\,9)*not(mod(n-0\\,3))+eq(n\\,20)");
        assert_eq!(expression(&[7]), "eq(n\\,7)");
        assert_eq!(expression(&[]), "");
    }

    #[test]
    fn a_missing_program_is_named_with_the_way_out() {
        let nowhere = Path::new("/nowhere/ffmpeg");
        for error in [
            times(Some(nowhere), Path::new("a.mp4")).unwrap_err(),
            extract(Some(nowhere), Path::new("a.mp4"), true, &[0], Path::new(".")).unwrap_err(),
        ] {
            let text = error.to_string();
            assert!(text.contains("a.mp4") && text.contains("not found") && text.contains("install ffmpeg"), "{text}");
        }
    }
}
