//! Interactions that nobody named: a language model's words for them, and what they may change.

use crate::common::{SMALL, copy, opened_and_closed, paws, stderr};
use crate::words::{Got, Mock, says};

#[test]
fn interactions_that_were_found_get_names_from_a_model_and_keep_the_way_that_motion_told() {
    let dir = tempfile::tempdir().unwrap();
    let rec = dir.path().join("rec");
    copy(SMALL.path(), &rec);
    std::fs::remove_file(rec.join("clips.json")).unwrap();
    let origin = r#"{"perceived": [{"stream": "hands", "adapter": "a-network", "licence": "CC BY-NC-ND 4.0"}]}"#;
    std::fs::write(rec.join("import.json"), origin).unwrap();
    let is_naming = |got: &Got| got.text().contains("JSON object");
    let mock = Mock::new(move |_, got| match is_naming(got) {
        // It takes everything for a closing, also what opens.
        true => says(r#"{"verb": "close", "noun": "Wardrobes", "before": "open", "after": "closed"}"#),
        false => says("unknown:unknown"),
    });
    let url = mock.url();
    let args = ["twin", "rec", "--no-textures", "--out", "t", "--vlm-model", "m", "--vlm-url", &url];
    let out = paws(&args, dir.path());
    assert!(matches!(out.status.code(), Some(0 | 1)), "{}", stderr(&out));
    let asked: Vec<usize> =
        mock.got.lock().unwrap().iter().filter(|g| is_naming(g)).map(|g| g.pictures().len()).collect();
    assert!(asked.len() >= 2 && asked.iter().all(|n| (1..=4).contains(n)), "{asked:?}");
    let found = opened_and_closed(&dir.path().join("t"));
    assert_eq!(found["joints"][0]["furniture"], "wardrobe", "{found}");
    let page = std::fs::read_to_string(dir.path().join("t/index.html")).unwrap();
    for word in ["open wardrobe", "a-network", "CC BY-NC-ND 4.0"] {
        assert!(page.contains(word), "{word}");
    }
}
