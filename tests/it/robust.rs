//! One bad thing costs that thing: words for files of the wrong shape, paths that lead elsewhere, runs that are killed.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use paws_twin::recording::Recording;
use serde_json::{Value, json};

use crate::common::{SMALL, copy, opened_and_closed, paws, stderr};

fn data(folder: &str, name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(folder).join(name).display().to_string()
}

fn edit(path: &Path, change: impl Fn(&mut Value)) {
    let mut value: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    change(&mut value);
    std::fs::write(path, value.to_string()).unwrap();
}

/// A copy of the small recording, changed.
fn recording(change: impl Fn(&Path)) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    copy(SMALL.path(), &dir.path().join("rec"));
    change(&dir.path().join("rec"));
    dir
}

/// All faults of a recording in one text.
fn faults(dir: &Path) -> String {
    Recording::open(&dir.join("rec")).err().map(|e| e.to_string()).unwrap_or_default()
}

#[test]
fn joints_of_the_wrong_shape_are_told_by_joint_and_field() {
    let dir = tempfile::tempdir().unwrap();
    for (file, code, words) in [
        ("box_no_R.json", 2, "joints[0] (wall_door): part_box: the key \"R\" is missing"),
        ("aabb.json", 2, "joints[0] (wall_door): part_box: the key \"center\" is missing"),
        ("no_id.json", 2, "joints[0]: the key \"id\" is missing"),
        (
            "range_scalar.json",
            2,
            "joints[0] (wall_door): range: the number 1.57 is given, a list of 2 values is wanted",
        ),
        ("id_int.json", 2, "joints[0].id: the number 3 is given, a text in quotes is wanted"),
        (
            "box_R_flat.json",
            2,
            "joints[0] (wall_door): part_box.R[0]: the number 1 is given, a list of 3 values is wanted",
        ),
        ("extra_key.json", 2, "the key \"confidence\" is not known here; known are \"id\", \"type\""),
        ("up_str.json", 2, "up: the text \"Y\" is given, a list of numbers"),
        (
            "nan.json",
            2,
            "line 11, column 18, joints[0] (wall_door): origin[0]: expected value; NaN and Infinity are not JSON: write",
        ),
        ("hinge_far.json", 2, "joint wall_door: origin: the hinge passes 29.5 m beside the part"),
        ("bare_list.json", 2, "is a list; an object is wanted"),
        ("cut_off.json", 2, "the file is cut off"),
        ("units_inch.json", 2, "units: the text \"inch\" is given, \"m\", \"cm\", \"mm\" is wanted"),
        ("scene_missing.json", 2, "the key \"scene\" is missing"),
        ("comments.json", 2, "JSON has no comments"),
        ("single_quotes.json", 2, "double quotes"),
        ("yaml.yaml", 2, "YAML"),
        ("x.urdf", 2, "XML"),
        ("bom.json", 0, ""),
    ] {
        let out = paws(&["export", &data("joints", file), "--out", file, "--format", "urdf"], dir.path());
        let message = stderr(&out);
        assert_eq!(out.status.code(), Some(code), "{file}: {message}");
        assert!(message.contains(words), "{file}: \"{words}\" is not in: {message}");
        assert_eq!(dir.path().join(file).exists(), code == 0, "{file}");
    }
}

#[test]
fn a_wrong_joint_among_right_ones_is_left_out_and_told() {
    let dir = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(data("joints", "ok.json")).unwrap();
    let good: Value = serde_json::from_str(&text).unwrap();
    let third = |change: &dyn Fn(&mut Value)| {
        let mut file = good.clone();
        let mut joint = file["joints"][0].clone();
        joint["id"] = json!("third");
        for key in ["part_box", "base_box"] {
            joint[key]["center"][0] = json!(3.0);
        }
        joint["origin"][0] = json!(2.7);
        joint["handle"][0] = json!(3.25);
        change(&mut joint);
        file["joints"].as_array_mut().unwrap().push(joint);
        std::fs::write(dir.path().join("j.json"), file.to_string()).unwrap();
        paws(&["export", "j.json", "--out", "out", "--format", "urdf"], dir.path())
    };
    let out = third(&|_: &mut Value| {});
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    type Change<'a> = &'a dyn Fn(&mut Value);
    let wrong: [(Change, &str); 6] = [
        (&|j: &mut Value| j["axis"] = json!([0, 0, 0]), "third: not built: axis: has length 0.0000"),
        (
            &|j: &mut Value| j["range"] = json!([0, 5]),
            "third: not built: range: opens by 5.0 rad, more than half a turn",
        ),
        (&|j: &mut Value| j["handle"][1] = json!(-0.9), "third: not built: handle: is 0.90 m before"),
        (&|j: &mut Value| j["part_box"]["R"] = json!(1), "third: not built: part_box.R: the number 1 is given"),
        (&|j: &mut Value| j["colour"] = json!("red"), "third: not built: the key \"colour\" is not known here"),
        (&|j: &mut Value| j["id"] = json!("wall_door"), "wall_door: not built: id: is used twice"),
    ];
    for (change, words) in wrong {
        let out = third(change);
        assert_eq!(out.status.code(), Some(1), "{words}: {}", stderr(&out));
        assert!(stderr(&out).contains(words), "{words}: {}", stderr(&out));
        let twin: Value =
            serde_json::from_str(&std::fs::read_to_string(dir.path().join("out/twin.json")).unwrap()).unwrap();
        assert_eq!(twin["furniture"].as_array().unwrap().len(), 2, "{words}");
    }
    // Of two joints one is half.
    for (key, value, words) in [
        ("range", json!([0, 5]), "joint wall_door: range: opens by 5.0 rad, more than half a turn"),
        ("handle", json!([0.25, -0.9, 1.35]), "joint wall_door: handle: is 0.90 m before the part's front"),
    ] {
        let mut file = good.clone();
        file["joints"][0][key] = value;
        std::fs::write(dir.path().join("j.json"), file.to_string()).unwrap();
        let out = paws(&["export", "j.json", "--out", "none"], dir.path());
        assert_eq!(out.status.code(), Some(2), "{}", stderr(&out));
        assert!(stderr(&out).contains(words), "{}", stderr(&out));
    }
    let mut file = good.clone();
    file["joints"][1]["range"] = json!([-3, 0]);
    std::fs::write(dir.path().join("j.json"), file.to_string()).unwrap();
    let out = paws(&["export", "j.json", "--out", "none"], dir.path());
    assert!(stderr(&out).contains("opens by 3.00 m, and what slides is 0.45 m long"), "{}", stderr(&out));
    std::fs::write(dir.path().join("j.json"), "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n")
        .unwrap();
    let out = paws(&["export", "j.json", "--out", "none"], dir.path());
    assert!(out.status.code() == Some(2) && stderr(&out).contains("Git LFS pointer"), "{}", stderr(&out));
}

#[test]
fn answers_in_another_frame_get_no_scores() {
    let dir = recording(|_| {});
    let text = std::fs::read_to_string(dir.path().join("rec/ground_truth.json")).unwrap();
    let truth: Value = serde_json::from_str(&text).unwrap();
    let rows = |shift: f64| -> Vec<Value> {
        let joint = |clip: &Value| truth["joints"].as_array()?.iter().find(|j| j["id"] == clip["joint"]).cloned();
        let row = |clip: &Value| {
            let joint = joint(clip)?;
            let mut origin = joint["origin"].clone();
            origin[0] = json!(origin[0].as_f64()? + shift);
            origin[1] = json!(origin[1].as_f64()? + shift);
            Some(json!({"recording": "rec", "clip": clip["clip"], "type": joint["type"], "axis": joint["axis"],
                "origin": origin}))
        };
        truth["clips"].as_array().unwrap().iter().filter_map(row).collect()
    };
    for (shift, code, words) in [
        (0.0, 0, ""),
        (0.3, 0, ""),
        (20.0, 2, "predictions and truth disagree on the unit (metres) or the world frame"),
        (1e200, 2, "from the world's origin, farther than anything on Earth"),
    ] {
        std::fs::write(dir.path().join("p.json"), json!({"predictions": rows(shift)}).to_string()).unwrap();
        let out = paws(&["evaluate", "p.json", "rec"], dir.path());
        assert_eq!(out.status.code(), Some(code), "{shift}: {}", stderr(&out));
        assert!(stderr(&out).contains(words) && stderr(&out).len() < 400, "{shift}: {}", stderr(&out));
    }
}

#[test]
fn predictions_of_the_wrong_shape_are_told_by_row_and_field() {
    for (file, words) in [
        ("p_no_type.json", "predictions[0] (rec/clip_000): the key \"type\" is missing"),
        ("p_range_pair.json", "predictions[0] (rec/clip_000): range: a list of 2 is given, a number is wanted"),
        (
            "p_rotation_names.json",
            "predictions[0] (rec/clip_000): type: the text \"translation\" is given, \"revolute\" or",
        ),
        ("p_clip_int.json", "predictions[0] (rec): clip: the number 0 is given, a text in quotes is wanted"),
        ("p_bare_list.json", "a list of 7 is given, an object with \"predictions\" is wanted"),
        ("p_lines.json", "line 2, column 1: trailing characters; one value a file is wanted"),
        ("p_opd.json", "a list of 1 is given, an object with \"predictions\" is wanted"),
        (
            "p_deg.json",
            "predictions[3] (rec/clip_003): range: 55.5904067775939 rad is more than a whole turn: are these degrees?",
        ),
        ("p_neg_range.json", "predictions[0] (rec/clip_000): range: -0.38034658190257736 is negative"),
        ("p_origin_nan.json", "predictions[0] (clip_000): origin[0]: expected value; NaN and Infinity"),
    ] {
        let out = paws(&["evaluate", &data("predictions", file), SMALL.path().to_str().unwrap()], SMALL.path());
        let message = stderr(&out);
        assert_eq!(out.status.code(), Some(2), "{file}: {message}");
        assert!(message.contains(words), "{file}: \"{words}\" is not in: {message}");
    }
}

#[test]
fn images_are_found_where_they_are_listed_or_missed_aloud() {
    let listed = |v: &mut Value, name: &dyn Fn(usize) -> Value| {
        for (i, frame) in v["frames"].as_array_mut().unwrap().iter_mut().enumerate() {
            frame["file"] = name(i);
        }
    };
    let dir = recording(|r| {
        std::fs::rename(r.join("frames"), r.join("images")).unwrap();
        edit(&r.join("cameras.json"), |v| listed(v, &|i| json!(format!("images/{i:06}.jpg"))));
    });
    let read = Recording::open(&dir.path().join("rec")).unwrap();
    assert!(read.frames.iter().all(|f| f.files.rgb.is_some()) && read.grey(3).unwrap().is_some());

    let dir = recording(|r| std::fs::remove_dir_all(r.join("frames")).unwrap());
    assert!(
        faults(dir.path()).contains("frame 3: frames/000003.jpg is listed but not there"),
        "{}",
        faults(dir.path())
    );
    edit(&dir.path().join("rec/cameras.json"), |v| listed(v, &|_| Value::Null));
    assert_eq!(faults(dir.path()), "");

    // Nobody lists them, but there they are.
    let dir = recording(|r| edit(&r.join("cameras.json"), |v| listed(v, &|_| Value::Null)));
    assert!(Recording::open(&dir.path().join("rec")).unwrap().frames[3].files.rgb.is_some());
}

#[test]
fn no_path_leads_out_of_a_recording_unless_that_is_allowed() {
    let outside = |name: &str| {
        let dir = recording(|r| {
            std::fs::copy(r.join("frames/000003.jpg"), r.join("../secret.jpg")).unwrap();
            let name = name.replace("HERE", r.parent().unwrap().to_str().unwrap());
            edit(&r.join("cameras.json"), |v| v["frames"][3]["file"] = json!(name));
        });
        let said = faults(dir.path());
        assert!(said.contains("frame 3") && said.contains("leads out of the recording"), "{name}: {said}");
        assert!(said.contains("--follow-links"), "{name}: {said}");
        assert!(Recording::open_following_links(&dir.path().join("rec")).is_ok(), "{name}");
    };
    outside("../secret.jpg");
    outside("frames/../../secret.jpg");
    outside("HERE/secret.jpg");
}

#[cfg(unix)]
#[test]
fn links_that_leave_a_recording_need_the_flag() {
    use std::os::unix::fs::symlink;
    for name in ["depth", "frames", "hands.json"] {
        let dir = recording(|r| {
            std::fs::rename(r.join(name), r.join("../elsewhere")).unwrap();
            symlink("../elsewhere", r.join(name)).unwrap();
        });
        let out = paws(&["infer", "rec"], dir.path());
        assert_eq!(out.status.code(), Some(2), "{name}: {}", stderr(&out));
        assert!(stderr(&out).contains(name) && stderr(&out).contains("--follow-links"), "{name}: {}", stderr(&out));
        assert!(Recording::open_following_links(&dir.path().join("rec")).is_ok(), "{name}");
    }
    // A link to the folder itself is how it was given; one within it stays within it.
    let dir = recording(|r| {
        std::fs::rename(r.join("depth"), r.join("metric")).unwrap();
        symlink("metric", r.join("depth")).unwrap();
        symlink("rec", r.join("../link")).unwrap();
    });
    let read = Recording::open(&dir.path().join("link")).unwrap();
    assert!((0..read.frames.len()).any(|frame| read.has_depth(frame)));
}

#[test]
fn times_increase_and_numbers_do_not_overflow() {
    let said = |change: &dyn Fn(&mut Value)| {
        let dir = recording(|r| edit(&r.join("cameras.json"), |v| change(v)));
        faults(dir.path())
    };
    for (words, change) in [
        (
            "frame 6: timestamp",
            (|v: &mut Value| v["frames"][6]["timestamp"] = v["frames"][4]["timestamp"].clone()) as fn(&mut Value),
        ),
        ("more than a day after", |v| {
            let last = v["frames"].as_array().unwrap().len() - 1;
            v["frames"][last]["timestamp"] = json!(1e200);
        }),
        ("frame 4: position is not finite or overflows", |v| v["frames"][4]["position"][1] = json!(1e200)),
        ("must be focal lengths", |v| v["fx"] = json!(1e200)),
        ("pixels on the image or near it", |v| v["cx"] = json!(-1e200)),
    ] {
        let found = said(&change);
        assert!(found.contains(words), "{words}: {found}");
    }
    let dir = recording(|r| {
        edit(&r.join("hands.json"), |v| v["frames"][0]["hands"][0]["joints_world"][4][0] = json!(1e200));
    });
    let read = Recording::open(&dir.path().join("rec")).unwrap();
    let whole = Recording::open(SMALL.path()).unwrap();
    assert_eq!(read.hands.len() + 1, whole.hands.len());
    let note = read.left_out.notes.first().unwrap();
    assert!(note.contains("1 of ") && note.contains("a fingertip is not finite or overflows"), "{note}");
    // Where most of them do, something went wrong with all.
    let dir = recording(|r| {
        edit(&r.join("hands.json"), |v| {
            for frame in v["frames"].as_array_mut().unwrap() {
                for hand in frame["hands"].as_array_mut().unwrap() {
                    hand["joints_world"][4][0] = json!(1e200);
                }
            }
        });
    });
    assert!(faults(dir.path()).contains("a fingertip is not finite or overflows"), "{}", faults(dir.path()));
}

#[test]
fn two_frames_of_one_time_are_told_and_worked_with() {
    let dir = recording(|r| {
        edit(&r.join("cameras.json"), |v| v["frames"][6]["timestamp"] = v["frames"][5]["timestamp"].clone());
    });
    let out = paws(&["infer", "rec", "--out", "p.json"], dir.path());
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    assert!(stderr(&out).contains("1 frames have the time of the frame before (frame 6"), "{}", stderr(&out));
}

#[test]
fn hands_without_contact_flags_are_as_good() {
    let dir = recording(|r| {
        edit(&r.join("hands.json"), |v| {
            for frame in v["frames"].as_array_mut().unwrap() {
                for hand in frame["hands"].as_array_mut().unwrap() {
                    hand.as_object_mut().unwrap().remove("contact");
                }
            }
        });
    });
    let out = paws(&["infer", "rec", "--out", "p.json"], dir.path());
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    let bare = std::fs::read_to_string(dir.path().join("p.json")).unwrap();
    let bare: Value = serde_json::from_str(&bare).unwrap();
    assert!(bare["predictions"].as_array().is_some_and(|rows| !rows.is_empty()), "{bare}");
}

#[test]
fn interactions_are_found_where_nobody_told_them() {
    let dir = recording(|_| {});
    let clips = dir.path().join("rec/clips.json");
    std::fs::remove_file(&clips).unwrap();
    let out = paws(&["twin", "rec", "--no-textures", "--out", "t"], dir.path());
    assert!(matches!(out.status.code(), Some(0 | 1)), "{}", stderr(&out));
    assert!(stderr(&out).contains("interactions by the hands"), "{}", stderr(&out));
    let found = opened_and_closed(&dir.path().join("t"));
    assert_eq!(found["joints"].as_array().unwrap().len(), 1, "{found}");
}

#[test]
fn a_header_that_announces_more_than_its_file_holds_is_refused() {
    for (header, words) in [
        (
            "element vertex 999999999999\nproperty float x\nproperty float y\nproperty float z\n",
            "more than the file can hold",
        ),
        ("element vertex 3\n", "more than the file can hold"),
    ] {
        let dir = recording(|r| {
            let text = format!("ply\nformat binary_little_endian 1.0\n{header}end_header\n");
            std::fs::write(r.join("reconstruction.ply"), text).unwrap();
        });
        assert!(faults(dir.path()).contains(words), "{header}: {}", faults(dir.path()));
    }
}

#[test]
fn a_clip_that_cannot_be_replayed_costs_itself() {
    let dir = recording(|r| {
        let clips: Value = serde_json::from_str(&std::fs::read_to_string(r.join("clips.json")).unwrap()).unwrap();
        let at = |key: &str| clips["clips"][0][key].as_u64().unwrap();
        let middle = (at("start_frame") + at("end_frame")) / 2;
        edit(&r.join("cameras.json"), |v| {
            for frame in v["frames"].as_array_mut().unwrap() {
                if frame["frame"].as_u64().unwrap() > middle {
                    frame["timestamp"] = json!(frame["timestamp"].as_f64().unwrap() + 700.0);
                }
            }
        });
    });
    // A hold that is told from depth ends where the hand is lost for so long; one of flags alone does not.
    std::fs::write(dir.path().join("flags.toml"), "[hands]\ncontact_from_depth = false\n").unwrap();
    let out = paws(&["twin", "rec", "--config", "flags.toml", "--out", "t"], dir.path());
    assert_eq!(out.status.code(), Some(1), "{}", stderr(&out));
    assert!(stderr(&out).contains("not done: replay of clip clip_000"), "{}", stderr(&out));
    for file in ["scene.urdf", "index.html", "validation.json", "predictions.json"] {
        assert!(dir.path().join("t").join(file).exists(), "{file}");
    }
}

#[test]
fn an_image_that_cannot_be_read_costs_its_frame() {
    let dir = recording(|r| {
        let mut depth: Vec<_> = std::fs::read_dir(r.join("depth")).unwrap().map(|e| e.unwrap().path()).collect();
        depth.sort();
        // Of the middle, and of the views before anything is touched.
        for path in [&depth[1], &depth[depth.len() / 2]] {
            let bytes = std::fs::read(path).unwrap();
            std::fs::write(path, &bytes[..bytes.len() / 2]).unwrap();
        }
    });
    let out = paws(&["infer", "rec", "--out", "p.json"], dir.path());
    assert!(matches!(out.status.code(), Some(0 | 1)), "{}", stderr(&out));
    // Frames that nobody looks at cost nothing.
    assert_eq!(out.status.code() == Some(1), stderr(&out).contains("left out: "), "{}", stderr(&out));
    assert!(dir.path().join("p.json").exists());
}

#[test]
fn clips_with_long_and_with_like_names_have_folders_of_their_own() {
    let dir = recording(|r| {
        edit(&r.join("clips.json"), |v| {
            v["clips"][0]["clip"] = json!("x/".repeat(150));
            v["clips"][1]["clip"] = json!("x_".repeat(150));
        });
    });
    let out = paws(&["twin", "rec", "--out", "t", "--keep"], dir.path());
    assert_ne!(out.status.code(), Some(2), "{}", stderr(&out));
    let clips: Value =
        serde_json::from_str(&std::fs::read_to_string(dir.path().join("rec/clips.json")).unwrap()).unwrap();
    let made = std::fs::read_dir(dir.path().join("t/steps")).unwrap().count();
    assert_eq!(made, clips["clips"].as_array().unwrap().len());
}

#[test]
fn a_killed_run_leaves_the_old_folder_or_the_new_one_and_the_next_one_clears_up() {
    let dir = tempfile::tempdir().unwrap();
    let synth = |seed: u32| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_paws"));
        command
            .args(["synth", "--width", "64", "--parts", "1", "--out", "k", "--seed", &seed.to_string()])
            .current_dir(dir.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        command
    };
    // The seed of the folder, all of whose images are there.
    let seed = || {
        let read = |name: &str| -> Value {
            serde_json::from_str(&std::fs::read_to_string(dir.path().join("k").join(name)).unwrap()).unwrap()
        };
        let listed = read("cameras.json")["frames"].as_array().unwrap().len();
        assert_eq!(std::fs::read_dir(dir.path().join("k/frames")).unwrap().count(), listed);
        read("ground_truth.json")["seed"].as_u64().unwrap()
    };
    let begin = Instant::now();
    assert!(synth(1).status().unwrap().success());
    let whole = begin.elapsed();
    let mut last = 1;
    const MOMENTS: u32 = 24;
    for moment in 0..MOMENTS {
        let next = 2 + moment;
        let mut child = synth(next).spawn().unwrap();
        // To beyond the end of a run: also while the folders change places and the old one is removed.
        std::thread::sleep(whole * moment / (MOMENTS - 6));
        let _ = child.kill();
        child.wait().unwrap();
        let found = seed();
        assert!(found == last || found == u64::from(next), "{found} after {last} and {next}");
        last = found;
    }
    assert!(synth(99).status().unwrap().success());
    assert_eq!(seed(), 99);
    let left: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left, ["k"]);
}
