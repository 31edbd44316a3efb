//! Broken recordings: a message that names file, place and remedy, exit code 2, nothing left behind.

use std::path::Path;

use serde_json::{Value, json};

use crate::common::{SMALL, copy, paws, stderr};

fn edit(path: &Path, change: impl Fn(&mut Value)) {
    let mut value: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    change(&mut value);
    std::fs::write(path, value.to_string()).unwrap();
}

/// Breaks a copy of a good recording and expects `paws twin` to name all of `words`.
fn check(name: &str, words: &[&str], break_it: impl Fn(&Path)) {
    let dir = tempfile::tempdir().unwrap();
    let recording = dir.path().join("rec");
    copy(SMALL.path(), &recording);
    break_it(&recording);
    let out = paws(&["twin", "rec", "--out", "out"], dir.path());
    let message = stderr(&out);
    assert_eq!(out.status.code(), Some(2), "{name}: {message}");
    for word in words {
        assert!(message.contains(word), "{name}: \"{word}\" is not in: {message}");
    }
    assert!(!message.contains("panicked"), "{name}: {message}");
    let left: Vec<String> = std::fs::read_dir(dir.path())
        .unwrap()
        .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
        .filter(|n| n != "rec")
        .collect();
    assert!(left.is_empty(), "{name}: left behind {left:?}");
}

#[test]
fn missing_files_are_named() {
    check("no cameras", &["cameras.json", "no such file", "intrinsics"], |r| {
        std::fs::remove_file(r.join("cameras.json")).unwrap();
    });
    check("no hands", &["hands.json", "fingertips.csv"], |r| std::fs::remove_file(r.join("hands.json")).unwrap());
    check("a listed image", &["frame 3", "frames/000003.jpg", "not there"], |r| {
        std::fs::remove_file(r.join("frames/000003.jpg")).unwrap();
    });
    let dir = tempfile::tempdir().unwrap();
    let out = paws(&["twin", "nowhere", "--out", "out"], dir.path());
    assert_eq!(out.status.code(), Some(2));
    assert!(stderr(&out).contains("nowhere: no such folder"), "{}", stderr(&out));
}

#[test]
fn broken_images_are_named() {
    check("truncated depth", &["depth/", ".png", "cannot be decoded"], |r| {
        for entry in std::fs::read_dir(r.join("depth")).unwrap() {
            let path = entry.unwrap().path();
            let bytes = std::fs::read(&path).unwrap();
            std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        }
    });
    check("Git LFS pointers", &["depth/", ".png", "git lfs pull"], |r| {
        for entry in std::fs::read_dir(r.join("depth")).unwrap() {
            let text = "version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n";
            std::fs::write(entry.unwrap().path(), text).unwrap();
        }
    });
    check("8-bit depth", &["depth/", "16-bit grey in millimetres"], |r| {
        for entry in std::fs::read_dir(r.join("depth")).unwrap() {
            let path = entry.unwrap().path();
            image::open(&path).unwrap().to_luma8().save(&path).unwrap();
        }
    });
    check("wrong size", &["depth/", "cameras.json says 160 x 120", "resize"], |r| {
        for entry in std::fs::read_dir(r.join("depth")).unwrap() {
            let path = entry.unwrap().path();
            let small = image::open(&path).unwrap().resize_exact(80, 60, image::imageops::FilterType::Nearest);
            small.to_luma16().save(&path).unwrap();
        }
    });
    check("zero depth everywhere", &["every value is 0", "millimetres"], |r| {
        for entry in std::fs::read_dir(r.join("depth")).unwrap() {
            let path = entry.unwrap().path();
            image::ImageBuffer::<image::Luma<u16>, _>::new(160, 120).save(&path).unwrap();
        }
    });
}

#[test]
fn impossible_poses_are_named_with_their_frame() {
    check("NaN", &["cameras.json", "frame 5", "NaN", "leave the frame out"], |r| {
        let path = r.join("cameras.json");
        let mut value: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        value["frames"][5]["position"] = json!([0, "NUMBER", 0]);
        std::fs::write(&path, value.to_string().replace("\"NUMBER\"", "NaN")).unwrap();
    });
    check("non-unit quaternions", &["frame 4: rotation_wxyz has norm 2.0", "frame 7"], |r| {
        edit(&r.join("cameras.json"), |v| {
            for frame in [4, 7] {
                v["frames"][frame]["rotation_wxyz"] = json!([2.0, 0.0, 0.0, 0.0]);
            }
        });
    });
    check("time that goes back", &["frame 6: timestamp"], |r| {
        edit(&r.join("cameras.json"), |v| v["frames"][6]["timestamp"] = json!(-1.0));
    });
    check("milliseconds", &["cameras.json", "write seconds"], |r| {
        edit(&r.join("cameras.json"), |v| {
            for frame in v["frames"].as_array_mut().unwrap() {
                frame["timestamp"] = json!(frame["timestamp"].as_f64().unwrap() * 1e3);
            }
        });
    });
    check("no focal length", &["focal lengths in pixels"], |r| edit(&r.join("cameras.json"), |v| v["fx"] = json!(0.0)));
    check("no frames", &["cameras.json", "no frames"], |r| edit(&r.join("cameras.json"), |v| v["frames"] = json!([])));
    check("not JSON", &["cameras.json", "line 1"], |r| std::fs::write(r.join("cameras.json"), "{").unwrap());
}

#[test]
fn clips_of_which_none_fits_the_video_are_named() {
    check("outside", &["clips.json", "clip_000", "outside the video"], |r| {
        edit(&r.join("clips.json"), |v| {
            for clip in v["clips"].as_array_mut().unwrap() {
                clip["end_frame"] = json!(99999);
            }
        });
    });
    check("backwards", &["clip_000", "is after end_frame"], |r| {
        edit(&r.join("clips.json"), |v| {
            for clip in v["clips"].as_array_mut().unwrap() {
                (clip["start_frame"], clip["end_frame"]) = (json!(50), json!(10));
            }
        });
    });
}

#[test]
fn a_clip_that_does_not_fit_the_video_costs_only_itself() {
    for (name, word, change) in [
        (
            "clip_000",
            "lie outside the video",
            (|v: &mut Value| v["clips"][0]["end_frame"] = json!(99999)) as fn(&mut Value),
        ),
        ("clip_000", "is after end_frame 0", |v| v["clips"][0]["end_frame"] = json!(0)),
        ("clip_000 (2)", "the name is used twice", |v| v["clips"][1]["clip"] = v["clips"][0]["clip"].clone()),
    ] {
        let dir = tempfile::tempdir().unwrap();
        copy(SMALL.path(), &dir.path().join("rec"));
        edit(&dir.path().join("rec/clips.json"), change);
        let out = paws(&["infer", "rec", "--out", "p.json"], dir.path());
        let text = String::from_utf8_lossy(&out.stdout).into_owned();
        assert_eq!(out.status.code(), Some(1), "{text}{}", stderr(&out));
        let row = text.lines().find(|l| l.contains(word)).unwrap_or_default();
        assert!(row.contains(name), "{word}: {text}");
        let written: Value = serde_json::from_slice(&std::fs::read(dir.path().join("p.json")).unwrap()).unwrap();
        let rows = written["predictions"].as_array().unwrap();
        let of = |n: &str| rows.iter().find(|r| r["clip"] == n).unwrap();
        assert!(of(name)["type"].is_null() && of(name)["reason"].as_str().unwrap().contains(word), "{written}");
        assert!(rows.iter().any(|r| !r["type"].is_null()), "{written}");
        assert_eq!(rows.len(), 3);
    }
}

#[test]
fn hands_that_cannot_be_used_are_named() {
    check("millimetres", &["apart (median)", "metres"], |r| scale_hands(r, 1000.0));
    check("too few joints", &["hands.json: frame", "expected 21"], |r| {
        edit(&r.join("hands.json"), |v| v["frames"][0]["hands"][0]["joints_world"] = json!([[0, 0, 0]]));
    });
    check("another world", &["from the camera (median)", "one world frame"], |r| {
        edit(&r.join("hands.json"), |v| {
            for frame in v["frames"].as_array_mut().unwrap() {
                for joint in frame["hands"][0]["joints_world"].as_array_mut().unwrap() {
                    joint[0] = json!(joint[0].as_f64().unwrap() + 50.0);
                }
            }
        });
    });
}

fn scale_hands(recording: &Path, factor: f64) {
    edit(&recording.join("hands.json"), |v| {
        for frame in v["frames"].as_array_mut().unwrap() {
            for joint in frame["hands"][0]["joints_world"].as_array_mut().unwrap() {
                for c in joint.as_array_mut().unwrap() {
                    *c = json!(c.as_f64().unwrap() * factor);
                }
            }
        }
    });
}

#[test]
fn of_two_recordings_the_one_in_another_unit_is_named_and_costs_only_itself() {
    let dir = tempfile::tempdir().unwrap();
    copy(SMALL.path(), &dir.path().join("good"));
    copy(SMALL.path(), &dir.path().join("odd"));
    scale_hands(&dir.path().join("odd"), 1000.0);
    edit(&dir.path().join("odd/cameras.json"), |v| {
        for frame in v["frames"].as_array_mut().unwrap() {
            for c in frame["position"].as_array_mut().unwrap() {
                *c = json!(c.as_f64().unwrap() * 1000.0);
            }
        }
    });
    let out = paws(&["infer", "good", "odd", "--out", "p.json"], dir.path());
    assert_eq!(out.status.code(), Some(1));
    assert!(stderr(&out).contains("odd") && stderr(&out).contains("metres"), "{}", stderr(&out));
    // The good one has its answer.
    let text = std::fs::read_to_string(dir.path().join("p.json")).unwrap();
    assert!(text.contains("\"good\"") && !text.contains("\"odd\"") && text.contains("revolute"), "{text}");
    assert!(String::from_utf8_lossy(&out.stdout).contains("clip_000"));
    let out = paws(&["infer", "odd", "nothing.json", "--out", "q.json"], dir.path());
    assert_eq!(out.status.code(), Some(2));
    std::fs::create_dir(dir.path().join("empty")).unwrap();
    let out = paws(&["infer", "odd", "empty", "--out", "q.json"], dir.path());
    assert!(out.status.code() == Some(2) && stderr(&out).contains("none of the 2 recordings"), "{}", stderr(&out));
    assert!(!dir.path().join("q.json").exists());
}

#[test]
fn tables_with_hostile_lines_are_refused() {
    check("a line without end", &["fingertips.csv", "line 2", "64 KiB"], |r| {
        std::fs::remove_file(r.join("hands.json")).unwrap();
        let header = "frame,timestamp,side,contact,score,thumb_x,thumb_y,thumb_z,index_x,index_y,index_z,middle_x,middle_y,middle_z";
        std::fs::write(r.join("fingertips.csv"), format!("{header}\n{}", "1,".repeat(1 << 20))).unwrap();
    });
    check("a missing column", &["fingertips.csv", "line 1", "thumb_x"], |r| {
        std::fs::remove_file(r.join("hands.json")).unwrap();
        std::fs::write(r.join("fingertips.csv"), "frame,side,contact\n").unwrap();
    });
}

#[test]
fn a_folder_that_is_not_ours_is_never_replaced() {
    let dir = tempfile::tempdir().unwrap();
    copy(SMALL.path(), &dir.path().join("rec"));
    std::fs::create_dir(dir.path().join("mine")).unwrap();
    std::fs::write(dir.path().join("mine/thesis.txt"), "years of work").unwrap();
    let out = paws(&["twin", "rec", "--out", "mine"], dir.path());
    assert_eq!(out.status.code(), Some(2));
    assert!(stderr(&out).contains("was not made by paws"), "{}", stderr(&out));
    assert_eq!(std::fs::read_to_string(dir.path().join("mine/thesis.txt")).unwrap(), "years of work");
}

#[test]
fn the_input_is_never_the_output() {
    let dir = tempfile::tempdir().unwrap();
    let made = paws(&["synth", "--width", "64", "--parts", "1", "--out", "k"], dir.path());
    assert!(made.status.success(), "{}", stderr(&made));
    for out in ["k", "."] {
        let result = paws(&["twin", "k", "--out", out], dir.path());
        assert_eq!(result.status.code(), Some(2));
        assert!(stderr(&result).contains("is or contains the input"), "{}", stderr(&result));
    }
    assert!(dir.path().join("k/cameras.json").exists());
}

#[test]
fn a_clip_with_the_name_of_a_path_stays_inside_the_output() {
    let dir = tempfile::tempdir().unwrap();
    copy(SMALL.path(), &dir.path().join("a/rec"));
    edit(&dir.path().join("a/rec/clips.json"), |v| v["clips"][0]["clip"] = json!("../../../escaped"));
    let out = paws(&["twin", "rec", "--out", "out", "--keep"], &dir.path().join("a"));
    assert_ne!(out.status.code(), Some(2), "{}", stderr(&out));
    let outside: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(outside, ["a"]);
}

#[test]
fn hands_that_cannot_be_replayed_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let out = paws(&["twin", SMALL.path().to_str().unwrap(), "--out", "t"], dir.path());
    assert_ne!(out.status.code(), Some(2), "{}", stderr(&out));
    let path = dir.path().join("t/trajectories.json");
    let good = std::fs::read_to_string(&path).unwrap();
    for (word, change) in [
        ("no samples", (|s: &mut Value| *s = json!([])) as fn(&mut Value)),
        ("time goes back", |s| s[1]["time_secs"] = json!(-1.0)),
        ("time stamps must be seconds", |s| {
            let last = s.as_array().unwrap().len() - 1;
            s[last]["time_secs"] = json!(1e9);
        }),
    ] {
        std::fs::write(&path, &good).unwrap();
        edit(&path, |v| change(&mut v[0]["clips"][0][1]["samples"]));
        let out = paws(&["validate", "t"], dir.path());
        assert_eq!(out.status.code(), Some(2), "{word}: {}", stderr(&out));
        assert!(stderr(&out).contains(word), "{word}: {}", stderr(&out));
    }
}

#[test]
fn a_config_that_cannot_be_used_is_named() {
    let dir = tempfile::tempdir().unwrap();
    copy(SMALL.path(), &dir.path().join("rec"));
    std::fs::write(dir.path().join("c.toml"), "[hands]\nobservation_std_m = 0.0\n").unwrap();
    let out = paws(&["twin", "rec", "--out", "out", "--config", "c.toml"], dir.path());
    assert_eq!(out.status.code(), Some(2));
    assert!(stderr(&out).contains("hands.observation_std_m"), "{}", stderr(&out));
}

#[test]
fn a_clip_that_moves_nothing_is_an_answer_not_a_crash() {
    let dir = tempfile::tempdir().unwrap();
    copy(SMALL.path(), &dir.path().join("rec"));
    edit(&dir.path().join("rec/clips.json"), |v| {
        for clip in v["clips"].as_array_mut().unwrap() {
            clip["narration"] = json!("wash the dishes");
            clip["verb"] = json!("wash");
            clip["noun"] = json!("dishes");
        }
    });
    let out = paws(&["twin", "rec", "--out", "out"], dir.path());
    assert_eq!(out.status.code(), Some(1), "{}", stderr(&out));
    let text = String::from_utf8_lossy(&out.stdout);
    assert!(text.contains("no joint was found") && text.contains("moves no door or drawer"), "{text}");
    assert!(dir.path().join("out/articulations.json").exists());
}
