//! What is believed of furniture before anything is seen of it. The numbers are data (`assets/priors.toml`), each with its unit,
//! its meaning and where it is from; most have a value beside that says nothing, for whoever asks what they are worth.

use std::sync::LazyLock;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::Row;

/// The file, parsed once: groups of entries.
static FILE: LazyLock<toml::Table> =
    LazyLock::new(|| toml::from_str(include_str!("../../assets/priors.toml")).unwrap_or_default());

/// Which of the values of each entry stand where a file gives none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PriorSet {
    /// How furniture usually is.
    #[default]
    Usual,
    /// Nothing is known of it: no name tells how it is hung, no edge and no size is likelier than another one.
    Uninformed,
}

fn entry(group: &str, key: &str) -> Option<&'static toml::Table> {
    FILE.get(group)?.get(key)?.as_table()
}

/// A word of an entry: its unit, its meaning, where it is from.
fn word(group: &str, key: &str, what: &str) -> &'static str {
    entry(group, key).and_then(|entry| entry.get(what)).and_then(toml::Value::as_str).unwrap_or("-")
}

/// An entry's value; of an entry that is not in the file, which a test excludes, nothing.
fn value<T: DeserializeOwned + Default>(group: &str, key: &str, set: PriorSet) -> T {
    let told = entry(group, key).and_then(|entry| {
        entry.get("uninformed").filter(|_| set == PriorSet::Uninformed).or_else(|| entry.get("value"))
    });
    told.and_then(|value| value.clone().try_into().ok()).unwrap_or_default()
}

/// Declares a group of entries: their names and types. All else stands in the file.
macro_rules! group {
    ($(#[doc = $group_doc:literal])* $group:ident, $name:literal, { $($field:ident: $ty:ty,)* }) => {
        $(#[doc = $group_doc])*
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $group {
            $(#[doc = concat!("`", $name, ".", stringify!($field), "` of `assets/priors.toml`: unit, meaning and source.")]
            pub $field: $ty,)*
        }

        impl $group {
            fn of(set: PriorSet) -> Self {
                Self { $($field: value($name, stringify!($field), set),)* }
            }

            fn rows(&self, rows: &mut Vec<Row>) {
                $(
                    let (source, grounds) = super::source::of_prior(word($name, stringify!($field), "from"));
                    rows.push(Row {
                        key: concat!("priors.", $name, ".", stringify!($field)).to_owned(),
                        value: toml::Value::try_from(&self.$field).map(|v| v.to_string()).unwrap_or_default(),
                        unit: word($name, stringify!($field), "unit"),
                        source,
                        grounds,
                        meaning: word($name, stringify!($field), "meaning").to_owned(),
                    });
                )*
            }
        }

        impl Default for $group {
            fn default() -> Self {
                Self::of(PriorSet::Usual)
            }
        }
    };
}

group! {
    /// How furniture is hung and opens.
    Hanging, "hung", {
        by_name: Vec<Named>,
        usual: Hung,
        lid_far_edge: f64,
        slide_level: f64,
        slide_askew: f64,
    }
}

group! {
    /// Sizes of fronts, where they are held and how they stand.
    Fronts, "fronts", {
        lever_median_m: f64,
        lever_spread: f64,
        lever_counts: f64,
        lever_least_m: f64,
        usual_levers_m: Vec<f64>,
        no_habit: f64,
        grip_edge: f64,
        grip_edge_std: f64,
        grip_middle_std: f64,
        aspect_spread: f64,
        size_median_m: f64,
        size_spread: f64,
        lid_share: f64,
        along_walls_share: f64,
        aslant: f64,
        off_walls: f64,
        nearly_on_walls: f64,
        not_left: f64,
        from_beside: f64,
        assumed_width_m: f64,
        assumed_drawer_m: f64,
        assumed_door_m: f64,
    }
}

group! {
    /// Handles, and how hands hold them.
    Handles, "handles", {
        standoff_m: f64,
        standoff_std_m: f64,
        not_held: f64,
        bar_half_width_m: f64,
        bar_half_length_m: f64,
        from_edge_m: f64,
    }
}

group! {
    /// What furniture is made of.
    Boards, "boards", {
        thickness_m: f64,
        gap_m: f64,
        carcass_depth_m: f64,
        tray_thickness_m: f64,
        tray_height_share: f64,
        density_kg_per_m3: f64,
    }
}

group! {
    /// What joints resist with.
    Resistance, "resistance", {
        hinge_damping: f64,
        hinge_friction: f64,
        slide_damping: f64,
        slide_friction: f64,
    }
}

group! {
    /// The most that moves joints.
    Drives, "drives", {
        hinge_effort: f64,
        hinge_velocity: f64,
        slide_effort: f64,
        slide_velocity: f64,
    }
}

group! {
    /// How far parts open.
    Ranges, "ranges", {
        door_deg: f64,
        front_deg: f64,
        lid_deg: f64,
        drawer_share: f64,
        slider_overlap_m: f64,
        shut_share: f64,
    }
}

/// What is believed of furniture before anything is seen of it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Priors {
    /// What the values that a file leaves out are.
    pub set: PriorSet,
    /// How furniture is hung and opens.
    pub hung: Hanging,
    /// Sizes of fronts, where they are held and how they stand.
    pub fronts: Fronts,
    /// Handles, and how hands hold them.
    pub handles: Handles,
    /// What furniture is made of.
    pub boards: Boards,
    /// What joints resist with.
    pub resistance: Resistance,
    /// The most that moves joints.
    pub drives: Drives,
    /// How far parts open.
    pub ranges: Ranges,
}

impl Priors {
    /// All values of one set.
    #[must_use]
    pub fn of(set: PriorSet) -> Self {
        Self {
            set,
            hung: Hanging::of(set),
            fronts: Fronts::of(set),
            handles: Handles::of(set),
            boards: Boards::of(set),
            resistance: Resistance::of(set),
            drives: Drives::of(set),
            ranges: Ranges::of(set),
        }
    }

    /// Nothing is known of furniture but what it is made of: names tell no edge and no direction, all sizes and places are as
    /// likely.
    #[must_use]
    pub fn uninformed() -> Self {
        Self::of(PriorSet::Uninformed)
    }

    pub(super) fn rows(&self, rows: &mut Vec<Row>) {
        rows.push(Row {
            key: "priors.set".to_owned(),
            value: toml::Value::try_from(self.set).map(|v| v.to_string()).unwrap_or_default(),
            unit: "-",
            source: "ours".to_owned(),
            grounds: "",
            meaning:
                "Defaults of the priors that are not set: \"usual\", or \"uninformed\" (nothing is known of furniture)."
                    .to_owned(),
        });
        self.hung.rows(rows);
        self.fronts.rows(rows);
        self.handles.rows(rows);
        self.boards.rows(rows);
        self.resistance.rows(rows);
        self.drives.rows(rows);
        self.ranges.rows(rows);
    }

    /// Refuses shares that are none, and lists that say nothing.
    pub(super) fn check(&self) -> Result<(), String> {
        let all = self.hung.by_name.iter().map(|named| (named.names.join(", "), named.ways));
        for (names, ways) in all.chain([("usual".to_owned(), self.hung.usual)]) {
            if !ways.shares().iter().all(|share| (0.0..=1.0).contains(share)) {
                return Err(format!("priors.hung ({names}): shares must lie between 0 and 1"));
            }
        }
        let Hung { upright, bottom, top, .. } = self.hung.usual;
        if (upright + bottom + top - 1.0).abs() > 1e-6 {
            return Err("priors.hung.usual: upright, bottom and top must add up to 1".to_owned());
        }
        let levers = &self.fronts.usual_levers_m;
        if levers.is_empty() || levers.len() > 100 || !levers.iter().all(|m| (0.01..=10.0).contains(m)) {
            return Err("priors.fronts.usual_levers_m must list 1 to 100 distances between 0.01 and 10 m".to_owned());
        }
        Ok(())
    }
}

/// Names, lower case, and how what they are said of is hung.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Named {
    /// Of furniture, as `assets/narration.toml` has them.
    pub names: Vec<String>,
    /// How it is hung.
    pub ways: Hung,
}

/// How furniture is hung: shares of all such furniture.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Hung {
    /// Hinged at an upright edge of its front.
    pub upright: f64,
    /// Hinged at the front's lower edge.
    pub bottom: f64,
    /// Hinged at the front's upper edge.
    pub top: f64,
    /// Hinged at the far edge of a level face.
    pub lid: f64,
    /// Slides out of its front.
    pub out: f64,
    /// Slides to the side within its front.
    pub aside: f64,
    /// Slides up or down within its front.
    pub lift: f64,
}

impl Hung {
    /// All shares in the order of the fields.
    #[must_use]
    pub fn shares(&self) -> [f64; 7] {
        let Self { upright, bottom, top, lid, out, aside, lift } = *self;
        [upright, bottom, top, lid, out, aside, lift]
    }
}

impl Hanging {
    /// How furniture of a name is hung, where the name is known; lower case, singular or plural.
    #[must_use]
    pub fn named(&self, furniture: &str) -> Option<Hung> {
        let said = |name: &String| {
            [Some(furniture), furniture.strip_suffix('s'), furniture.strip_suffix("es")].contains(&Some(name.as_str()))
        };
        self.by_name.iter().find(|named| named.names.iter().any(said)).map(|named| named.ways)
    }

    /// Share of the furniture of a name whose moving face is level, where the name is trusted in a share `trust` of all cases;
    /// one half where nothing is known.
    #[must_use]
    pub fn level_share(&self, furniture: Option<&str>, trust: f64) -> f64 {
        furniture.and_then(|name| self.named(name)).map_or(0.5, |ways| trust * ways.lid + (1.0 - trust) * 0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `group.key` of all entries of the file.
    fn entries() -> Vec<(String, &'static toml::Table)> {
        let of_group = |(group, entries): (&String, &'static toml::Value)| {
            let group = group.clone();
            entries
                .as_table()
                .unwrap()
                .iter()
                .map(move |(key, entry)| (format!("{group}.{key}"), entry.as_table().unwrap()))
        };
        FILE.iter().flat_map(of_group).collect()
    }

    #[test]
    fn every_entry_of_the_file_is_a_prior_and_says_where_it_is_from() {
        let mut rows = Vec::new();
        Priors::default().rows(&mut rows);
        let mut keys: Vec<String> = rows.iter().skip(1).map(|r| r.key.replacen("priors.", "", 1)).collect();
        let mut known: Vec<String> = entries().into_iter().map(|(key, _)| key).collect();
        keys.sort();
        known.sort();
        assert_eq!(keys, known);
        for (key, entry) in entries() {
            assert!(entry.contains_key("value"), "{key}");
            for what in ["unit", "meaning", "from"] {
                assert!(
                    entry.get(what).and_then(toml::Value::as_str).is_some_and(|text| !text.is_empty()),
                    "{key}: {what}"
                );
            }
            let from = entry["from"].as_str().unwrap();
            let grounds = ["judgement: ", "measured: ", "source: "].iter().find_map(|kind| from.strip_prefix(kind));
            assert!(grounds.is_some_and(|on_what| on_what.len() > 5), "{key}: {from}");
            let allowed = ["value", "uninformed", "unit", "meaning", "from"];
            assert!(entry.keys().all(|k| allowed.contains(&k.as_str())), "{key}");
        }
    }

    #[test]
    fn values_are_read_as_they_are_written() {
        let [usual, flat] = [PriorSet::Usual, PriorSet::Uninformed].map(Priors::of);
        assert_eq!(usual, Priors::default());
        for (priors, name) in [(&usual, "value"), (&flat, "uninformed")] {
            let mut rows = Vec::new();
            priors.rows(&mut rows);
            for (key, entry) in entries() {
                let row = rows.iter().find(|r| r.key == format!("priors.{key}")).unwrap();
                let (read, written): (toml::Table, _) = (
                    toml::from_str(&format!("v = {}", row.value)).unwrap(),
                    entry.get(name).unwrap_or(&entry["value"]),
                );
                // Shares that the file leaves out are none.
                if !["hung.by_name", "hung.usual"].contains(&key.as_str()) {
                    assert_eq!(&read["v"], written, "{key}");
                }
            }
            priors.check().unwrap();
        }
    }

    #[test]
    fn uninformed_no_edge_and_no_name_is_preferred() {
        let flat = Priors::uninformed();
        assert!(flat.hung.named("dishwasher").is_none());
        let Hung { upright, bottom, top, out, aside, lift, .. } = flat.hung.usual;
        assert!(0.5 * upright == bottom && bottom == top && out == aside && aside == lift);
        assert_eq!(flat.hung.lid_far_edge, 0.25);
        assert_eq!(flat.hung.level_share(Some("chest"), 0.9), 0.5);
        // Every size is as likely, and every part is as likely shut as ajar.
        assert!(flat.fronts.size_spread > 50.0 && flat.ranges.shut_share == 0.5);
        // What furniture is made of is no belief about a joint.
        assert_eq!(flat.boards, Priors::default().boards);
    }

    #[test]
    fn names_are_known_in_singular_and_plural() {
        let hung = Hanging::default();
        assert_eq!(hung.named("dishwashers"), hung.named("dishwasher"));
        assert!(hung.named("dishwasher").is_some_and(|ways| ways.bottom > 0.9));
        assert!(hung.named("bottle").is_none() && hung.level_share(None, 0.9) == 0.5);
        assert!(hung.level_share(Some("chest"), 0.9) > 0.85 && hung.level_share(Some("drawer"), 0.9) < 0.1);
    }
}
