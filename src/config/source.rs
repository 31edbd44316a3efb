//! Where a value is from, in the same words for all rows: "paper B.1", "ours: judgement", "ours: measured", "source", and "ours"
//! alone where the paper has no number and the meaning says why it is this one.

/// What a meaning ends with that says nothing but the kind.
const JUDGED: &str = " Judgement.";

/// Of a value of a block: its section of the paper, or "ours"; then what is said of it, else of its whole block, tells the kind.
pub(super) fn of_block(section: &str, said: &str, block_says: &str) -> String {
    let kind = match section {
        "ours" if said.contains("Source: ") => "source",
        "ours" if said.contains("development seeds") => "ours: measured",
        "ours" if [said, block_says].iter().any(|text| text.contains("udgement")) => "ours: judgement",
        "ours" => "ours",
        _ => return format!("paper {section}"),
    };
    kind.to_owned()
}

/// Of a prior, whose file says "judgement: on what", "measured: how" or "source: its name": the kind, and what stands behind it.
pub(super) fn of_prior(from: &'static str) -> (String, &'static str) {
    let (kind, grounds) = from.split_once(": ").unwrap_or((from, ""));
    let kind = if kind == "source" { kind.to_owned() } else { format!("ours: {kind}") };
    (kind, grounds)
}

/// What is said of a value, without what its source says already.
pub(super) fn meaning(said: &str) -> String {
    said.strip_suffix(JUDGED).unwrap_or(said).to_owned()
}
