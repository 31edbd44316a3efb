//! `paws evaluate` and `paws ablate` as commands.

use std::path::Path;

use serde_json::{Value, json};

use crate::common::{SMALL, paws, stderr};

fn read(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// The truth of the small recording as predictions.
fn perfect() -> Vec<Value> {
    let dir = SMALL.path().canonicalize().unwrap();
    let truth = read(&dir.join("ground_truth.json"));
    let joints = truth["joints"].as_array().unwrap();
    let row = |clip: &Value| {
        let joint = joints.iter().find(|j| j["id"] == clip["joint"]).unwrap();
        let openings: Vec<f64> = clip["x"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
        let [low, high] = [f64::min, f64::max].map(|pick| openings.iter().copied().reduce(pick).unwrap());
        json!({"recording": dir.file_name().unwrap().to_str().unwrap(), "clip": clip["clip"], "type": joint["type"],
            "axis": joint["axis"], "origin": joint["origin"], "contact_pivot": joint["origin_handle"],
            "range": high - low, "part_box": joint["part_box"], "joint": joint["id"], "confidence": 0.9,
            "joint_confidence": 0.8})
    };
    truth["clips"].as_array().unwrap().iter().map(row).collect()
}

fn write(dir: &Path, name: &str, rows: &[Value]) {
    std::fs::write(dir.join(name), json!({ "predictions": rows }).to_string()).unwrap();
}

#[test]
fn evaluate_tells_rules_failures_and_differences() {
    let dir = tempfile::tempdir().unwrap();
    let recording = SMALL.path().to_str().unwrap();
    let perfect = perfect();
    write(dir.path(), "perfect.json", &perfect);
    let mut lost = perfect.clone();
    lost[0] = json!({"recording": perfect[0]["recording"], "clip": perfect[0]["clip"], "type": null, "stage": "hands"});
    write(dir.path(), "lost.json", &lost);
    let mut args = vec!["evaluate", "lost.json", recording, "--details", "--against", "perfect.json"];
    args.extend(["--json", "r.json", "--csv", "r.csv"]);
    let out = paws(&args, dir.path());
    assert!(out.status.success(), "{}", stderr(&out));
    let text = String::from_utf8(out.stdout).unwrap();
    assert!(["USDNet MAO_ST", "no hand", "ECE", "minus perfect.json"].iter().all(|w| text.contains(w)), "{text}");
    let report = read(&dir.path().join("r.json"));
    let clips = perfect.len() as f64;
    for rule in report["rules"].as_array().unwrap() {
        // No rule but the missing answer stands between the truth and 1.
        assert!((rule["micro"]["mao"].as_f64().unwrap() - (clips - 1.0) / clips).abs() < 1e-12, "{rule}");
    }
    let worse = report["against"].as_array().unwrap().iter().all(|p| p["worse"] == 1 && p["better"] == 0);
    assert!(worse, "{}", report["against"]);
    let csv = std::fs::read_to_string(dir.path().join("r.csv")).unwrap();
    assert!(csv.starts_with("recording,clip,joint,type,") && csv.lines().count() == perfect.len() + 1, "{csv}");
}

#[test]
fn several_predictions_go_with_truth_by_name_and_share_no_clip() {
    let dir = tempfile::tempdir().unwrap();
    let recording = SMALL.path().to_str().unwrap();
    let perfect = perfect();
    write(dir.path(), "a.json", &perfect[..1]);
    write(dir.path(), "b.json", &perfect[1..]);
    let out = paws(&["evaluate", "a.json", "b.json", "--truth", recording], dir.path());
    assert!(out.status.success(), "{}", stderr(&out));
    assert!(String::from_utf8(out.stdout).unwrap().contains("= 1.000 micro"));
    let twice = paws(&["evaluate", "a.json", "a.json", "--truth", recording], dir.path());
    assert!(twice.status.code() == Some(2) && stderr(&twice).contains("earlier file"), "{}", stderr(&twice));
    let none = paws(&["evaluate", "a.json"], dir.path());
    assert!(none.status.code() == Some(2) && stderr(&none).contains("no truth"), "{}", stderr(&none));
}

#[test]
fn ablate_compares_with_the_first_configuration() {
    let dir = tempfile::tempdir().unwrap();
    let recording = SMALL.path().to_str().unwrap();
    std::fs::write(dir.path().join("same.toml"), "method = \"ours\"\n").unwrap();
    let args = ["ablate", recording, "--config", "first=same.toml", "--config", "again=same.toml", "--json", "a.json"];
    let out = paws(&args, dir.path());
    assert!(out.status.success(), "{}", stderr(&out));
    let rows = read(&dir.path().join("a.json"));
    assert_eq!((&rows[0]["config"], &rows[1]["config"]), (&json!("first"), &json!("again")));
    assert!(rows[0].get("against_first").is_none());
    let difference = rows[1]["against_first"].as_array().unwrap();
    assert!(difference.iter().all(|p| p["difference"]["mao"] == 0.0 && p["better"] == 0), "{difference:?}");
    let text = String::from_utf8(out.stdout).unwrap();
    assert!(text.lines().any(|l| l.starts_with("again") && l.contains("+0.000")), "{text}");
}
