//! Which column of a table of positions is what: by the names in its header, else by their number.

/// Unit of the positions in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LengthUnit {
    /// Metres.
    Metre,
    /// Centimetres.
    Centimetre,
    /// Millimetres.
    Millimetre,
}

impl LengthUnit {
    /// Metres in one of it.
    #[must_use]
    pub fn metres(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Centimetre => 1e-2,
            Self::Millimetre => 1e-3,
        }
    }

    /// Its sign: "m", "cm", "mm".
    #[must_use]
    pub fn sign(self) -> &'static str {
        match self {
            Self::Metre => "m",
            Self::Centimetre => "cm",
            Self::Millimetre => "mm",
        }
    }
}

/// What one column holds.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Column {
    /// Time, and the seconds in one of its units.
    Time(f64),
    /// A number that only counts lines or frames.
    Index,
    /// x, y or z (0 to 2), and the unit where the name has one.
    Position(usize, Option<LengthUnit>),
    /// x, y, z or w (0 to 3) of the quaternion.
    Orientation(usize),
}

/// Where everything stands in a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Layout {
    /// Columns in a row.
    pub(super) count: usize,
    /// Column of the time stamp, and seconds in one of its units.
    pub(super) time: Option<(usize, f64)>,
    /// Columns of x, y, z.
    pub(super) position: [usize; 3],
    /// Columns of the quaternion's x, y, z, w.
    pub(super) orientation: Option<[usize; 4]>,
    /// Unit of the positions where the names have one.
    pub(super) unit: Option<LengthUnit>,
}

/// The columns that are understood, for messages.
pub(super) const EXPECTED: &str = "expected x y z [qx qy qz qw], with or without a time stamp in front";

impl Layout {
    /// A row without names: x y z [qx qy qz qw], with a time stamp in front where there is one column more. `None` for any
    /// other number of columns.
    pub(super) fn by_count(count: usize) -> Option<Self> {
        let first = match count {
            3 | 7 => 0,
            4 | 8 => 1,
            _ => return None,
        };
        Some(Self {
            count,
            time: (first == 1).then_some((0, 1.0)),
            position: [0, 1, 2].map(|k| first + k),
            orientation: (count > 4).then_some([3, 4, 5, 6].map(|k| first + k)),
            unit: None,
        })
    }

    /// The columns of a header; `Err` says which name is not understood or missing.
    pub(super) fn by_names(names: &[&str]) -> Result<Self, String> {
        let mut time = None;
        let mut position: [Option<usize>; 3] = [None; 3];
        let mut orientation: [Option<usize>; 4] = [None; 4];
        let mut units = Vec::new();
        for (i, name) in names.iter().enumerate() {
            // A nameless first column numbers the rows of a data frame.
            let found = if i == 0 && is_nameless(name) { Some(Column::Index) } else { column(name) };
            let Some(column) = found else {
                let shown = if name.is_empty() { format!("{} (without a name)", i + 1) } else { (*name).to_owned() };
                return Err(format!(
                    "column {shown} is not understood; keep time, x, y, z, qx, qy, qz, qw (in any order) and leave out the rest"
                ));
            };
            let twice = match column {
                Column::Time(seconds) => time.replace((i, seconds)).is_some(),
                Column::Index => false,
                Column::Position(k, unit) => {
                    units.push(unit);
                    position.get_mut(k).is_some_and(|slot| slot.replace(i).is_some())
                }
                Column::Orientation(k) => orientation.get_mut(k).is_some_and(|slot| slot.replace(i).is_some()),
            };
            if twice {
                return Err(format!("column {name} is there twice; one point a file"));
            }
        }
        let [Some(x), Some(y), Some(z)] = position else {
            return Err(format!("the header {} does not name all of x, y, z", names.join(" ")));
        };
        let orientation = match orientation {
            [Some(x), Some(y), Some(z), Some(w)] => Some([x, y, z, w]),
            [None, None, None, None] => None,
            _ => return Err(format!("the header {} does not name all of qx, qy, qz, qw", names.join(" "))),
        };
        let unit = units.first().copied().flatten();
        if units.iter().any(|u| *u != unit) {
            return Err("x, y and z are in different units".to_owned());
        }
        Ok(Self { count: names.len(), time, position: [x, y, z], orientation, unit })
    }
}

/// How many of these names are understood.
pub(super) fn understood(names: &[&str]) -> usize {
    names.iter().filter(|n| column(n).is_some()).count()
}

/// Whether these are the units of columns rather than their names: `s`, `[mm]`, nothing or `[]` for what has none.
pub(super) fn are_units(names: &[&str]) -> bool {
    let bare = |name: &str| name.trim_matches(|c: char| !c.is_ascii_alphanumeric()).to_ascii_lowercase();
    let units: Vec<String> = names.iter().map(|n| bare(n)).collect();
    let is_unit = |u: &String| u.is_empty() || length(u).is_some() || seconds(u).is_some();
    units.iter().any(|u| !u.is_empty()) && units.iter().all(is_unit)
}

fn is_nameless(name: &str) -> bool {
    name.is_empty() || name.to_ascii_lowercase().starts_with("unnamed")
}

/// `posX` as `pos_x`: a capital behind a small letter begins a word.
fn with_words_apart(name: &str) -> String {
    let mut apart = String::with_capacity(name.len() + 4);
    let mut after_small = false;
    for c in name.chars() {
        if after_small && c.is_ascii_uppercase() {
            apart.push('_');
        }
        after_small = c.is_ascii_lowercase();
        apart.push(c.to_ascii_lowercase());
    }
    apart
}

/// What a column of this name holds: `x`, `tx`, `pos_x`, `p_RS_R_x [m]`, `pose.position.x`, `x (mm)`, `q_w`, `timestamp [ns]`.
fn column(name: &str) -> Option<Column> {
    let name = with_words_apart(name);
    let mut words: Vec<&str> = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty()).collect();
    // A unit stands behind the name.
    let unit = words.last().copied().filter(|w| words.len() > 1 && (length(w).is_some() || seconds(w).is_some()));
    if unit.is_some() {
        words.pop();
    }
    const COUNTERS: [&str; 11] =
        ["frame", "frames", "index", "idx", "seq", "number", "row", "line", "no", "sample", "step"];
    // An id alone may be that of a hand or marker.
    if words.iter().any(|w| COUNTERS.contains(w)) && words.iter().all(|w| *w == "id" || COUNTERS.contains(w)) {
        return Some(Column::Index);
    }
    const TIMES: [&str; 9] = ["t", "time", "times", "timestamp", "timestamps", "stamp", "sec", "secs", "seconds"];
    if words.iter().all(|w| TIMES.contains(w) || AROUND.contains(w)) && words.iter().any(|w| TIMES.contains(w)) {
        return match unit {
            None => Some(Column::Time(1.0)),
            Some(unit) => seconds(unit).map(Column::Time),
        };
    }
    let (last, before) = words.split_last()?;
    let (stem, axis) = last.split_at_checked(last.len().checked_sub(1)?)?;
    let k = ["x", "y", "z", "w"].iter().position(|a| *a == axis)?;
    let all = || before.iter().copied().filter(|w| !AROUND.contains(w)).chain((!stem.is_empty()).then_some(stem));
    const POINTS: [&str; 15] = [
        "p",
        "t",
        "pos",
        "position",
        "trans",
        "translation",
        "loc",
        "location",
        "point",
        "coord",
        "hand",
        "handle",
        "marker",
        "tip",
        "wrist",
    ];
    const TURNS: [&str; 7] = ["q", "quat", "quaternion", "orientation", "ori", "rot", "rotation"];
    if all().any(|w| TURNS.contains(&w)) || k == 3 {
        return all().all(|w| TURNS.contains(&w)).then_some(Column::Orientation(k));
    }
    if !all().all(|w| POINTS.contains(&w)) {
        return None;
    }
    match unit {
        None => Some(Column::Position(k, None)),
        Some(unit) => length(unit).map(|unit| Column::Position(k, Some(unit))),
    }
}

/// Words around a name that say nothing about what it is: message fields and the names of frames.
const AROUND: [&str; 10] = ["pose", "transform", "field", "header", "data", "msg", "world", "r", "s", "rs"];

fn length(word: &str) -> Option<LengthUnit> {
    match word {
        "m" | "metre" | "metres" | "meter" | "meters" => Some(LengthUnit::Metre),
        "cm" => Some(LengthUnit::Centimetre),
        "mm" => Some(LengthUnit::Millimetre),
        _ => None,
    }
}

/// Seconds in one of a unit of time.
fn seconds(word: &str) -> Option<f64> {
    match word {
        "s" | "sec" | "secs" | "second" | "seconds" => Some(1.0),
        "ms" | "msec" => Some(1e-3),
        "us" | "usec" => Some(1e-6),
        "ns" | "nsec" => Some(1e-9),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_in_any_order_and_dress_are_understood() {
        let layout = Layout::by_names(&["t", "qw", "qx", "qy", "qz", "x", "y", "z"]).unwrap();
        assert_eq!((layout.position, layout.orientation), ([5, 6, 7], Some([2, 3, 4, 1])));
        let names = [
            "timestamp [ns]",
            "p_RS_R_x [m]",
            "p_RS_R_y [m]",
            "p_RS_R_z [m]",
            "q_RS_w []",
            "q_RS_x []",
            "q_RS_y []",
            "q_RS_z []",
        ];
        let layout = Layout::by_names(&names).unwrap();
        assert_eq!(
            (layout.time, layout.position, layout.orientation),
            (Some((0, 1e-9)), [1, 2, 3], Some([5, 6, 7, 4]))
        );
        assert_eq!(layout.unit, Some(LengthUnit::Metre));
        let layout = Layout::by_names(&["x_mm", "y_mm", "z_mm", "t_ms"]).unwrap();
        assert_eq!((layout.time, layout.unit), (Some((3, 1e-3)), Some(LengthUnit::Millimetre)));
        let layout = Layout::by_names(&["frame", "Pose.Position.X", "pose.position.y", "pose.position.z"]).unwrap();
        assert_eq!((layout.time, layout.position), (None, [1, 2, 3]));
        let layout = Layout::by_names(&["", "frameId", "timeStamp", "posX", "posY", "posZ"]).unwrap();
        assert_eq!((layout.time, layout.position), (Some((2, 1.0)), [3, 4, 5]));
        assert_eq!(
            Layout::by_names(&["timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw"]).ok(),
            Layout::by_count(8)
        );
    }

    #[test]
    fn units_are_told_from_names() {
        for (names, units) in [
            (&["s", "m", "m", "m"][..], true),
            (&["[s]", "(mm)", "(mm)", "(mm)", "[]"][..], true),
            (&["t", "x", "y", "z"][..], false),
            (&["", "", ""][..], false),
        ] {
            assert_eq!(are_units(names), units, "{names:?}");
        }
    }

    #[test]
    fn what_is_no_position_is_not_taken_for_one() {
        for (names, word) in [
            (&["hand", "x", "y", "z"][..], "column hand is not understood"),
            (&["t", "x", "y"][..], "does not name all of x, y, z"),
            (&["x", "y", "z", "qx", "qy", "qz"][..], "does not name all of qx"),
            (&["v_x", "v_y", "v_z"][..], "column v_x is not understood"),
            (&["x", "y", "z", "roll", "pitch", "yaw"][..], "column roll"),
            (&["x", "x", "y", "z"][..], "is there twice"),
            (&["x_mm", "y_mm", "z_cm"][..], "different units"),
            (&["x", "y", "z", ""][..], "column 4 (without a name) is not understood"),
            (&["id", "x", "y", "z"][..], "column id is not understood"),
        ] {
            let error = Layout::by_names(names).unwrap_err();
            assert!(error.contains(word), "{error}");
        }
    }
}
