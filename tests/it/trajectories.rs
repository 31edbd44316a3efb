//! Trajectories as people have them, alone and against models of others: what is read, inferred, refused, and said.

use std::path::{Path, PathBuf};

use paws_twin::articulation::JointKind;
use paws_twin::config::Config;
use paws_twin::inference::bare;
use paws_twin::recording::trajectory::{self, LengthUnit};

use crate::common::{paws, stderr};

fn data(folder: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(folder)
}

/// What is right about a file.
enum Right {
    /// A hinge, with its range in degrees.
    Hinge(f64),
    /// A slide, with its range in centimetres.
    Slide(f64),
    /// Line and circle explain it equally well.
    Ambiguous,
    /// No answer, with a word of the reason.
    Nothing(&'static str),
    /// Not read, with a word of the error.
    Refused(&'static str),
}

use Right::{Ambiguous, Hinge, Nothing, Refused, Slide};

const FILES: &[(&str, Right)] = &[
    ("csv_header.csv", Hinge(68.75)),
    ("csv_bom_nohdr.csv", Hinge(68.75)),
    ("csv_quoted.csv", Hinge(68.75)),
    ("csv_blank_first.csv", Hinge(68.75)),
    ("csv_header_after_comment.csv", Hinge(68.75)),
    ("csv_two_headers.csv", Hinge(68.75)),
    ("csv_xyz_order.csv", Hinge(68.75)),
    ("tabs.tsv", Hinge(68.75)),
    ("two_comment_percent.txt", Hinge(68.75)),
    ("ms.csv", Hinge(68.75)),
    ("tum.txt", Hinge(68.75)),
    ("quat_identity.txt", Hinge(68.75)),
    ("wxyz.txt", Hinge(68.75)),
    ("quat_flip.txt", Hinge(68.75)),
    ("quat_3digits.txt", Hinge(68.75)),
    ("tum_epoch.txt", Hinge(68.75)),
    ("lidar_up_y.txt", Hinge(68.75)),
    ("two_cycles.csv", Hinge(68.75)),
    ("far.txt", Hinge(68.75)),
    ("five_points.txt", Hinge(68.75)),
    ("zeros_when_lost.csv", Hinge(68.2)),
    ("minus1_when_lost.csv", Hinge(68.75)),
    ("arc25.txt", Hinge(26.0)),
    ("units_row.csv", Hinge(80.0)),
    ("title_with_number.csv", Hinge(80.0)),
    ("camel_case.csv", Hinge(80.0)),
    ("nameless_index.csv", Hinge(80.0)),
    ("one_point_when_lost.csv", Hinge(80.0)),
    ("half_lost.csv", Hinge(80.0)),
    ("idx_t_xyz.csv", Slide(29.5)),
    ("order_quat_first.csv", Slide(29.5)),
    ("arc5.txt", Ambiguous),
    ("arc10.txt", Ambiguous),
    ("arc15.txt", Ambiguous),
    ("arc20.txt", Ambiguous),
    ("still_noise.txt", Nothing("nothing moved")),
    ("still_noise2.txt", Nothing("nothing moved")),
    ("still_drift.txt", Nothing("nothing moved")),
    ("four_points.txt", Nothing("at least 5 are needed")),
    ("only_xy.csv", Refused("does not name all of x, y, z")),
    ("conf_col.csv", Refused("column confidence is not understood")),
    ("six_cols_rpy.csv", Refused("column roll is not understood")),
    ("id_xyz_two_hands.csv", Refused("column hand is not understood")),
    ("kitti.txt", Refused("4th, 8th and 12th")),
    ("mm.csv", Refused("--units mm")),
    ("cm.csv", Refused("--units cm")),
    ("decimal_comma.csv", Refused("decimal commas")),
    ("decimal_comma_ws.txt", Refused("decimal commas")),
    ("decimal_comma_quoted.csv", Refused("decimal commas")),
    ("decimal_comma_commas.csv", Refused("are these decimal commas?")),
    ("mm_short.txt", Refused("--units mm")),
    ("matrix.txt", Refused("4th, 8th and 12th")),
    ("pipes.txt", Refused("line 2: \"0.0000|")),
    ("na.csv", Refused("line 32: a value is missing")),
    ("gz.csv.gz", Refused("gunzip")),
    ("utf16.csv", Refused("UTF-16")),
    ("arr.json", Refused("is JSON")),
    ("list.json", Refused("is JSON")),
    ("jsonl.jsonl", Refused("is JSON")),
    ("html.html", Refused("HTML")),
    ("bracket.txt", Refused("leave the brackets out")),
    ("hex.txt", Refused("write numbers as decimals")),
    ("iso_time.csv", Refused("time stamps must be seconds")),
    ("empty_cells.csv", Refused("line 2: a cell is empty")),
    ("nan_rows.csv", Refused("line 2: a value is not finite")),
    ("two_points.txt", Nothing("at least 5 are needed")),
    ("pointer.csv", Refused("git lfs pull")),
    ("list.yaml", Refused("is YAML")),
    ("header_only.csv", Refused("it is a header, and no row follows")),
    ("time_last.csv", Refused("is the time last?")),
];

#[test]
fn orientations_are_told_to_have_turned_as_far_as_the_part() {
    for file in ["tum.txt", "tum_epoch.txt", "wxyz.txt", "quat_flip.txt", "quat_3digits.txt"] {
        let path = trajectory::read(&data("trajectories").join(file)).unwrap();
        let outcome = bare::infer(&path, &Config::default().inference);
        let reason = &outcome.found().unwrap().reason;
        let told = reason.strip_prefix("the part itself turned by ").and_then(|r| Some(r.split_once(" deg")?.0));
        let degrees: f64 = told.unwrap_or_else(|| panic!("{file}: {reason}")).parse().unwrap();
        // Where each quaternion has three digits the ends are told less well.
        assert!((degrees - 69.0).abs() <= 2.0, "{file}: {reason}");
    }
}

#[test]
fn every_table_is_understood_or_refused_with_the_way_out() {
    let mut wrong = Vec::new();
    for (file, right) in FILES {
        let read = trajectory::read(&data("trajectories").join(file));
        let said = match (&read, right) {
            (Err(error), Refused(word)) if error.to_string().contains(*word) => continue,
            (Err(error), _) => error.to_string(),
            (Ok(path), _) => {
                let outcome = bare::infer(path, &Config::default().inference);
                let is_right = match (outcome.found(), right) {
                    (Some(j), Hinge(deg)) => {
                        j.joint.kind == JointKind::Revolute && !j.ambiguous && (j.range.to_degrees() - deg).abs() < 0.5
                    }
                    (Some(j), Slide(cm)) => {
                        j.joint.kind == JointKind::Prismatic && !j.ambiguous && (100.0 * j.range - cm).abs() < 0.2
                    }
                    (Some(j), Ambiguous) => j.ambiguous,
                    (None, Nothing(word)) => outcome.reason().is_some_and(|r| r.contains(*word)),
                    _ => false,
                };
                if is_right {
                    continue;
                }
                format!("{outcome:?}")
            }
        };
        wrong.push(format!("{file}: {said}"));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_unit_sets_millimetres_right_and_a_header_of_another_unit_is_a_contradiction() {
    let path = trajectory::read_in(&data("trajectories").join("mm.csv"), Some(LengthUnit::Millimetre)).unwrap();
    let outcome = bare::infer(&path, &Config::default().inference);
    assert!((outcome.found().unwrap().range.to_degrees() - 68.75).abs() < 0.5);
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("t.csv"), "x_mm,y_mm,z_mm\n1,2,3\n").unwrap();
    let out = paws(&["infer", "t.csv", "--units", "cm"], dir.path());
    assert!(stderr(&out).contains("the header says mm, --units cm"), "{}", stderr(&out));
}

#[test]
fn what_is_ambiguous_is_told_in_the_table_and_one_bad_file_costs_only_itself() {
    let out = paws(&["infer", "arc10.txt", "utf16.csv", "minus1_when_lost.csv"], &data("trajectories"));
    let text = String::from_utf8_lossy(&out.stdout);
    assert_eq!(out.status.code(), Some(1), "{text}");
    assert!(text.contains("slide (ambiguous)") && text.contains("both explain the points"), "{text}");
    assert!(text.contains("minus1_when_lost.csv  hinge"), "{text}");
    let said = stderr(&out);
    assert!(said.contains("utf16.csv") && said.contains("rows of -1 -1 -1 are left out"), "{said}");
}

/// What `paws validate` has to say of a model and a path.
enum Told {
    /// A verdict among these, whose reason holds a word.
    Verdict(&'static [&'static str], &'static str),
    /// An error that holds a word.
    Error(&'static str),
}

use Told::{Error, Verdict};

const NOT_REFUTED: &[&str] = &["pass", "undetermined"];

const REPLAYS: &[(&str, &str, Told)] = &[
    ("door.xml", "handle.txt", Verdict(&["pass"], "follows the recorded hand")),
    ("door.xml", "mid.txt", Verdict(NOT_REFUTED, "")),
    ("door.xml", "back.txt", Verdict(&["fail"], "opens it the other way")),
    ("drawer.xml", "marker_on_front.txt", Verdict(&["pass"], "")),
    ("drawer.xml", "marker_inside.txt", Verdict(NOT_REFUTED, "")),
    ("exclude_welded.xml", "exclude_path.txt", Verdict(&["pass"], "")),
    ("m0.005.xml", "light.txt", Verdict(NOT_REFUTED, "")),
    ("m0.02.xml", "light.txt", Verdict(NOT_REFUTED, "")),
    ("m0.1.xml", "light.txt", Verdict(&["pass"], "")),
    ("m4.xml", "light.txt", Verdict(&["pass"], "")),
    ("two_fingers.xml", "two_fingers.txt", Verdict(NOT_REFUTED, "")),
    // Shared space of 1.15 mm holds a door, of 0.05 mm it does not.
    ("g0.0010.xml", "hairline.txt", Verdict(&["fail"], "runs into above")),
    ("g0.0021.xml", "hairline.txt", Verdict(&["pass"], "")),
    ("g0.0022.xml", "hairline.txt", Verdict(&["pass"], "")),
    ("g0.004.xml", "hairline.txt", Verdict(&["pass"], "")),
    ("../mjcf/12_mjcf/equality_weld.xml", "handle.txt", Error("<weld> holds it fast: no hand can move it")),
    ("../mjcf/12_mjcf/equality_weld.xml", "hinge=handle.txt", Error("<weld> holds it fast")),
    ("b_range_deg_in_rad.xml", "handle.txt", Error("write its limits in radians")),
    ("b_range_rad_in_deg.xml", "handle.txt", Error("<compiler angle=\"radian\"/>")),
    ("door.xml", "../trajectories/mm.csv", Error("--units mm")),
    ("door.xml", "../trajectories/far.txt", Error("the model's world frame")),
    ("door.xml", "../trajectories/only_xy.csv", Error("does not name all of x, y, z")),
    // A few places without times say little, and refute nothing.
    ("door.xml", "../trajectories/two_points.txt", Verdict(NOT_REFUTED, "")),
    ("door.xml", "../trajectories/four_points.txt", Verdict(NOT_REFUTED, "")),
    ("door.xml", "../trajectories/five_points.txt", Verdict(NOT_REFUTED, "")),
    (
        "door.xml",
        "../trajectories/lidar_up_y.txt",
        Error("(is another axis up?); it must be in the model's world frame"),
    ),
];

#[test]
fn paths_against_the_models_of_others_get_the_right_verdict() {
    let mut wrong = Vec::new();
    for (model, path, right) in REPLAYS {
        let out = paws(&["validate", *model, "--trajectory", *path], &data("validate"));
        let text = String::from_utf8_lossy(&out.stdout).into_owned();
        let is_right = match right {
            Error(word) => out.status.code() == Some(2) && stderr(&out).contains(*word),
            // The verdicts stand below the table; a joint without a path has no word in them.
            Verdict(words, reason) => text
                .lines()
                .filter(|line| line.contains(": ") && !line.contains("no recorded hand"))
                .any(|line| words.iter().any(|w| line.contains(&format!(": {w}"))) && line.contains(*reason)),
        };
        if !is_right {
            wrong.push(format!("{model} {path}: {text}{}", stderr(&out)));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

/// The door's own path with each row's time and place changed, replayed on the door: what is said, and the exit code.
fn replayed(change: &dyn Fn(f64, [f64; 3]) -> (f64, [f64; 3])) -> (String, Option<i32>) {
    let dir = tempfile::tempdir().unwrap();
    std::fs::copy(data("validate").join("door.xml"), dir.path().join("door.xml")).unwrap();
    let text = std::fs::read_to_string(data("validate").join("handle.txt")).unwrap();
    let row = |line: &str| {
        let v: Vec<f64> = line.split_whitespace().map(|c| c.parse().unwrap()).collect();
        let (t, [x, y, z]) = change(v[0], [v[1], v[2], v[3]]);
        format!("{t} {x} {y} {z}\n")
    };
    let rows: String = text.lines().filter(|l| !l.trim().is_empty()).map(row).collect();
    std::fs::write(dir.path().join("p.txt"), rows).unwrap();
    let out = paws(&["validate", "door.xml", "--trajectory", "p.txt"], dir.path());
    (format!("{}{}", String::from_utf8_lossy(&out.stdout), stderr(&out)), out.status.code())
}

#[test]
fn a_path_that_is_nowhere_on_the_part_proves_and_refutes_nothing() {
    for (name, word, change) in [
        ("above", "never comes nearer", (|[x, y, z]| [x, y, z + 1.2]) as fn([f64; 3]) -> [f64; 3]),
        ("aside", "1.0 m beside its hinge", |[x, y, z]| [x + 1.0, y, z]),
        ("turned by 90 degrees", "turned or moved?", |[x, y, z]| [-y, x, z]),
        ("turned by 180 degrees", "turned or moved?", |[x, y, z]| [-x, -y, z]),
        ("y up", "is another axis up?", |[x, y, z]| [x, z, -y]),
    ] {
        let (said, code) = replayed(&|t, p| (t, change(p)));
        assert_eq!(code, Some(2), "{name}: {said}");
        assert!(said.contains(word) && said.contains("must be in the model's world frame"), "{name}: {said}");
    }
    // Some centimetres beside are told, and no more.
    let (said, code) = replayed(&|t, [x, y, z]| (t, [x, y, z + 0.475]));
    assert_ne!(code, Some(2), "{said}");
    assert!(said.contains("never comes nearer to hinge than 8 cm"), "{said}");
}

#[test]
fn a_hand_that_is_too_fast_for_any_refutes_nothing_and_noise_cuts_no_path() {
    let (said, code) = replayed(&|t, p| (0.02 * t, p));
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("hinge: undetermined") && said.contains("its times are off"), "{said}");
    // Pulled away from the hinge, shaken by millimetres.
    let shaken = |t: f64, by: f64| 0.006 * ((t * 30.0 * by).rem_euclid(11.0) / 10.0 - 0.5);
    let (said, code) = replayed(&|t, _| (t, [0.2 + 0.2 * t, shaken(t, 7.0), 0.5 + shaken(t, 5.0)]));
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("explains the recorded hand better") && !said.contains("there and back"), "{said}");
}

#[test]
fn a_part_that_nothing_can_touch_is_told_as_such() {
    let model = "../mjcf/12_mjcf/contype0.xml";
    let out = paws(&["validate", model, "--trajectory", "handle.txt"], &data("validate"));
    assert!(stderr(&out).contains("hinge: none of its part's shapes takes part in contacts"), "{}", stderr(&out));
}

#[test]
fn time_stamps_that_no_motion_has_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::copy(data("validate").join("door.xml"), dir.path().join("door.xml")).unwrap();
    let text = std::fs::read_to_string(data("validate").join("handle.txt")).unwrap();
    let with = |time: &dyn Fn(f64) -> f64| -> String {
        let row = |line: &str| {
            let (t, rest) = line.split_once(' ').unwrap();
            format!("{} {rest}\n", time(t.parse().unwrap()))
        };
        text.lines().filter(|l| !l.trim().is_empty()).map(row).collect()
    };
    for (times, word) in [
        (with(&|_| 0.0), "have the time stamp of the one before"),
        (with(&f64::floor), "have the time stamp of the one before"),
        (with(&|t| 1e-3 * t), "time stamps must be seconds"),
        (with(&|t| 1e9 * t), "time stamps must be seconds"),
    ] {
        std::fs::write(dir.path().join("t.txt"), times).unwrap();
        let out = paws(&["validate", "door.xml", "--trajectory", "t.txt"], dir.path());
        assert_eq!(out.status.code(), Some(2), "{word}");
        assert!(stderr(&out).contains(word), "{}", stderr(&out));
    }
}
