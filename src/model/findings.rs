//! What the readers of one point of "simulation-ready" find: faults, remarks, and whether the point applies at all.

/// Faults and remarks of one point.
#[derive(Default)]
pub(super) struct Findings {
    pub(super) concerned: bool,
    /// Whether something that it is about was not looked at.
    pub(super) unjudged: bool,
    pub(super) faults: Vec<String>,
    pub(super) told: Vec<String>,
}

impl Findings {
    pub(super) fn about(concerned: bool) -> Self {
        Self { concerned, ..Self::default() }
    }

    pub(super) fn fault(&mut self, text: String) {
        self.faults.push(text);
    }

    pub(super) fn tell(&mut self, text: String) {
        self.told.push(text);
    }
}
