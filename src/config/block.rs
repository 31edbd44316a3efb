//! The macro in which a step's values are declared.

/// Declares one block of the config with its defaults, units and sources in one place. After `parts` stand blocks of their own
/// within it: `hands.contact` is a part of `hands`.
macro_rules! block {
    ($(#[doc = $block_doc:literal])* $block:ident, $name:literal, {
        $($(#[doc = $doc:literal])* $field:ident: $ty:ty = $default:expr, $unit:literal, $section:literal;)*
    } $(parts {
        $($(#[doc = $part_doc:literal])* $part:ident: $part_ty:ident;)*
    })?) => {
        $(#[doc = $block_doc])*
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $block {
            $($(#[doc = $doc])* pub $field: $ty,)*
            $($($(#[doc = $part_doc])* pub $part: $part_ty,)*)?
        }

        impl Default for $block {
            fn default() -> Self {
                Self {
                    $($field: $default,)*
                    $($($part: $part_ty::default(),)*)?
                }
            }
        }

        impl $block {
            pub(super) fn rows(&self, rows: &mut Vec<Row>) {
                let block_says = concat!($($block_doc),*);
                $(
                    let said = [$($doc.trim()),*].join(" ");
                    rows.push(Row {
                        key: concat!($name, ".", stringify!($field)).to_owned(),
                        value: toml::Value::try_from(&self.$field).map(|v| v.to_string()).unwrap_or_default(),
                        unit: $unit,
                        source: super::source::of_block($section, &said, block_says),
                        grounds: "",
                        meaning: super::source::meaning(&said),
                    });
                )*
                $($(self.$part.rows(rows);)*)?
            }
        }
    };
}
