//! What an assembled recording says against the conventions it was read with.
//!
//! Each check looks at an [`Imported`] (poses, hands, frames, its captures, images when asked for) and names what it found with
//! its evidence and the option that sets it right. It changes nothing.

use serde::Serialize;

use super::Imported;
use super::joints::PALM;
use crate::math::stats;

/// Something that does not fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// What is probably wrong.
    pub what: String,
    /// The numbers that say so.
    pub evidence: String,
    /// The option that sets it right.
    pub option: String,
}

/// Length of a grown person's palm from the wrist to the middle knuckle, metres, with room for children and errors.
const PALM_M: std::ops::Range<f64> = 0.04..0.16;

/// All findings.
#[must_use]
pub fn findings(imported: &Imported) -> Vec<Finding> {
    palm(imported).into_iter().collect()
}

/// A hand's own size tells the unit of the hands.
fn palm(imported: &Imported) -> Option<Finding> {
    let lengths: Vec<f64> = imported
        .hands
        .iter()
        .filter_map(|h| {
            let [wrist, knuckle] = PALM.map(|i| h.joints.get(i).copied().flatten());
            Some((knuckle? - wrist?).norm())
        })
        .collect();
    let length = stats::median(&lengths)?;
    (!PALM_M.contains(&length)).then(|| Finding {
        what: "the hands are not in metres".to_owned(),
        evidence: format!(
            "from the wrist to the middle knuckle are {length:.4} m (median), a hand's palm is 0.07 to 0.11"
        ),
        option: "--unit METRES for hands in the poses' world, else convert the hands".to_owned(),
    })
}
