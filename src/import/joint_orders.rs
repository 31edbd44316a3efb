//! Orders of a hand's joints: the one place where they become MANO's (OpenPose's) 21.
//!
//! MANO: 0 wrist; 1 to 4 thumb, 5 to 8 index, 9 to 12 middle, 13 to 16 ring, 17 to 20 little finger, tips last.

/// An order of joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum JointOrder {
    /// MANO and OpenPose, 21: wrist, then four a finger from the palm to the tip
    Mano,
    /// Project Aria, 21: five tips, wrist, thumb 2, then three a finger, palm
    Aria,
    /// OpenXR and HoloLens, 26: palm, wrist, thumb 4, then five a finger with its metacarpal
    Openxr,
    /// ARKit and Vision Pro, 25 or 27: wrist, thumb 4, then five a finger with its metacarpal, then forearm
    Arkit,
}

const NONE: usize = usize::MAX;

/// Source joints of MANO's 21.
const MANO: [usize; 21] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20];
/// Aria has no joint at the thumb's root.
const ARIA: [usize; 21] = [5, NONE, 6, 7, 0, 8, 9, 10, 1, 11, 12, 13, 2, 14, 15, 16, 3, 17, 18, 19, 4];
/// Palm 0, metacarpals 6, 11, 16, 21 are left out.
const OPENXR: [usize; 21] = [1, 2, 3, 4, 5, 7, 8, 9, 10, 12, 13, 14, 15, 17, 18, 19, 20, 22, 23, 24, 25];
/// Metacarpals 5, 10, 15, 20 are left out.
const ARKIT: [usize; 21] = [0, 1, 2, 3, 4, 6, 7, 8, 9, 11, 12, 13, 14, 16, 17, 18, 19, 21, 22, 23, 24];

/// ARKit's names of MANO's joints, behind `left` or `right`.
pub const ARKIT_NAMES: [&str; 21] = [
    "Hand",
    "ThumbKnuckle",
    "ThumbIntermediateBase",
    "ThumbIntermediateTip",
    "ThumbTip",
    "IndexFingerKnuckle",
    "IndexFingerIntermediateBase",
    "IndexFingerIntermediateTip",
    "IndexFingerTip",
    "MiddleFingerKnuckle",
    "MiddleFingerIntermediateBase",
    "MiddleFingerIntermediateTip",
    "MiddleFingerTip",
    "RingFingerKnuckle",
    "RingFingerIntermediateBase",
    "RingFingerIntermediateTip",
    "RingFingerTip",
    "LittleFingerKnuckle",
    "LittleFingerIntermediateBase",
    "LittleFingerIntermediateTip",
    "LittleFingerTip",
];

/// Indices of the thumb's, index and middle finger's tips in MANO's order.
pub const TIPS: [usize; 3] = [4, 8, 12];

/// Wrist and the middle finger's knuckle in MANO's order: the length of a palm.
pub const PALM: [usize; 2] = [0, 9];

impl JointOrder {
    /// The source's joint for each of MANO's.
    fn table(self) -> &'static [usize; 21] {
        match self {
            Self::Mano => &MANO,
            Self::Aria => &ARIA,
            Self::Openxr => &OPENXR,
            Self::Arkit => &ARKIT,
        }
    }

    /// Joints in MANO's order; `None` for those that the source has not, or whose numbers are not finite.
    #[must_use]
    pub fn to_mano(self, joints: &[Option<[f64; 3]>]) -> [Option<[f64; 3]>; 21] {
        self.table().map(|i| joints.get(i).copied().flatten().filter(|p| p.iter().all(|x| x.is_finite())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tips_are_where_each_order_has_them() {
        // Joint i of a source lies at x = i.
        let joints: Vec<Option<[f64; 3]>> = (0..27).map(|i| Some([f64::from(i), 0.0, 0.0])).collect();
        for (order, wrist, tips) in [
            (JointOrder::Mano, 0.0, [4.0, 8.0, 12.0]),
            (JointOrder::Aria, 5.0, [0.0, 1.0, 2.0]),
            (JointOrder::Openxr, 1.0, [5.0, 10.0, 15.0]),
            (JointOrder::Arkit, 0.0, [4.0, 9.0, 14.0]),
        ] {
            let mano = order.to_mano(&joints);
            assert_eq!(mano[0].unwrap()[0], wrist, "{order:?}");
            assert_eq!(TIPS.map(|i| mano[i].unwrap()[0]), tips, "{order:?}");
        }
        assert!(JointOrder::Aria.to_mano(&joints)[1].is_none());
        assert_eq!(JointOrder::Mano.to_mano(&[Some([f64::NAN, 0.0, 0.0])]).iter().flatten().count(), 0);
    }
}
