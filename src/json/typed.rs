//! A JSON value read into a type, with the place of what does not fit and words for people.

use std::fmt;

use serde::de::value::StrDeserializer;
use serde::de::{self, DeserializeOwned, DeserializeSeed, Deserializer, MapAccess, SeqAccess, Unexpected, Visitor};
use serde_json::Value;

/// The place of a fault that is the value's own.
pub(super) const WHOLE: &str = "the whole file";

/// The first place where `value` is no `T`, and what is wrong there; `None` where it is one.
pub(super) fn explain<T: DeserializeOwned>(value: &Value) -> Option<(String, String)> {
    let fault = <T as serde::Deserialize<'_>>::deserialize(PlacedValue { value, place: &ValuePlace::Top }).err()?;
    let place = fault.place.filter(|p| !p.is_empty()).unwrap_or_else(|| WHOLE.to_owned());
    Some((place, fault.message))
}

/// The way from the top to a value.
enum ValuePlace<'a> {
    Top,
    Key(&'a ValuePlace<'a>, &'a str),
    Index(&'a ValuePlace<'a>, usize, &'a Value),
}

impl fmt::Display for ValuePlace<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Top => Ok(()),
            Self::Key(parent, key) => {
                let between = match parent {
                    Self::Top => "",
                    Self::Index(_, _, value) if name(value).is_some() => ": ",
                    _ => ".",
                };
                write!(f, "{parent}{between}{key}")
            }
            Self::Index(parent, index, value) => {
                write!(f, "{parent}[{index}]")?;
                name(value).map_or(Ok(()), |name| write!(f, " ({name})"))
            }
        }
    }
}

/// What people call an entry of a list.
fn name(value: &Value) -> Option<String> {
    let text = |key: &str| value.get(key).and_then(Value::as_str).map(|s| cut(s, 60));
    match (text("recording"), text("clip")) {
        (Some(recording), Some(clip)) => return Some(format!("{recording}/{clip}")),
        (None, Some(clip)) => return Some(clip),
        (Some(recording), None) => return Some(recording),
        (None, None) => {}
    }
    text("id")
        .or_else(|| text("joint"))
        .or_else(|| value.get("frame").and_then(Value::as_u64).map(|frame| format!("frame {frame}")))
}

/// The beginning of a text: a message stays readable whatever stands in a file.
fn cut(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}...", text.get(..end).unwrap_or_default()),
        None => text.to_owned(),
    }
}

/// What does not fit, and where.
#[derive(Debug)]
struct ValueFault {
    place: Option<String>,
    message: String,
}

impl fmt::Display for ValueFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for ValueFault {}

impl de::Error for ValueFault {
    fn custom<M: fmt::Display>(message: M) -> Self {
        Self { place: None, message: message.to_string() }
    }
}

/// A value and where it stands.
#[derive(Clone, Copy)]
struct PlacedValue<'a, 'de> {
    value: &'de Value,
    place: &'a ValuePlace<'a>,
}

impl<'de> PlacedValue<'_, 'de> {
    fn fault(self, said: &str) -> ValueFault {
        ValueFault { place: Some(self.place.to_string()), message: words(said, self.value) }
    }

    /// An error that has no place yet is this value's.
    fn placed<T>(self, result: Result<T, ValueFault>) -> Result<T, ValueFault> {
        result.map_err(|fault| if fault.place.is_some() { fault } else { self.fault(&fault.message) })
    }

    fn list<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ValueFault> {
        let Value::Array(values) = self.value else {
            return Err(self.fault(&ValueFault::not_a_list(self.value, &visitor)));
        };
        self.placed(visitor.visit_seq(Items { values: values.iter(), next: 0, place: self.place }))
    }

    fn object<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ValueFault> {
        let Value::Object(entries) = self.value else {
            return Err(self.fault(&ValueFault::not_a_list(self.value, &visitor)));
        };
        self.placed(visitor.visit_map(Entries { entries: entries.iter(), value: None, place: self.place }))
    }
}

impl ValueFault {
    /// serde's sentence about a value of another kind than the visitor's.
    fn not_a_list<'de, V: Visitor<'de>>(value: &Value, visitor: &V) -> String {
        let found = match value {
            Value::Array(_) => Unexpected::Seq,
            Value::Object(_) => Unexpected::Map,
            _ => Unexpected::Other("a value"),
        };
        <Self as de::Error>::invalid_type(found, visitor).message
    }
}

/// Kinds of values without parts: serde_json's own reading of a value does.
macro_rules! plain {
    ($($method:ident)*) => {
        $(fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ValueFault> {
            self.value.$method(visitor).map_err(|e| self.fault(&e.to_string()))
        })*
    };
}

impl<'de> Deserializer<'de> for PlacedValue<'_, 'de> {
    type Error = ValueFault;

    plain! {
        deserialize_bool deserialize_i8 deserialize_i16 deserialize_i32 deserialize_i64 deserialize_u8 deserialize_u16
        deserialize_u32 deserialize_u64 deserialize_f32 deserialize_f64 deserialize_char deserialize_str
        deserialize_string deserialize_bytes deserialize_byte_buf deserialize_unit deserialize_identifier
    }

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ValueFault> {
        match self.value {
            Value::Array(_) => self.list(visitor),
            Value::Object(_) => self.object(visitor),
            other => other.deserialize_any(visitor).map_err(|e| self.fault(&e.to_string())),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ValueFault> {
        match self.value {
            Value::Null => visitor.visit_none(),
            _ => visitor.visit_some(self),
        }
    }

    fn deserialize_unit_struct<V: Visitor<'de>>(self, name: &'static str, visitor: V) -> Result<V::Value, ValueFault> {
        self.value.deserialize_unit_struct(name, visitor).map_err(|e| self.fault(&e.to_string()))
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Result<V::Value, ValueFault> {
        let result = visitor.visit_newtype_struct(self);
        self.placed(result)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ValueFault> {
        self.list(visitor)
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, ValueFault> {
        let Value::Array(values) = self.value else { return self.list(visitor) };
        let longer = <ValueFault as de::Error>::invalid_length(values.len(), &visitor).message;
        let mut items = Items { values: values.iter(), next: 0, place: self.place };
        let value = self.placed(visitor.visit_seq(&mut items))?;
        // Of a longer list the rest would go unread.
        if items.values.len() > 0 { Err(self.fault(&longer)) } else { Ok(value) }
    }

    fn deserialize_tuple_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        len: usize,
        visitor: V,
    ) -> Result<V::Value, ValueFault> {
        self.deserialize_tuple(len, visitor)
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ValueFault> {
        self.object(visitor)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ValueFault> {
        if self.value.is_object() {
            return self.object(visitor);
        }
        // serde would take a list for the fields in their order.
        let keys: Vec<String> = fields.iter().map(|key| format!("\"{key}\"")).collect();
        let message = format!("{} is given, an object with {} is wanted", given(self.value), keys.join(", "));
        Err(ValueFault { place: Some(self.place.to_string()), message })
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ValueFault> {
        self.value.deserialize_enum(name, variants, visitor).map_err(|e| self.fault(&e.to_string()))
    }

    fn deserialize_ignored_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ValueFault> {
        visitor.visit_unit()
    }
}

/// The items of a list.
struct Items<'a, 'de> {
    values: std::slice::Iter<'de, Value>,
    next: usize,
    place: &'a ValuePlace<'a>,
}

impl<'de> SeqAccess<'de> for Items<'_, 'de> {
    type Error = ValueFault;

    fn next_element_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, ValueFault> {
        let Some(value) = self.values.next() else { return Ok(None) };
        let place = ValuePlace::Index(self.place, self.next, value);
        self.next += 1;
        let node = PlacedValue { value, place: &place };
        node.placed(seed.deserialize(node)).map(Some)
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.values.len())
    }
}

/// The entries of an object; `value` waits for its key to be read.
struct Entries<'a, 'de> {
    entries: serde_json::map::Iter<'de>,
    value: Option<(&'de str, &'de Value)>,
    place: &'a ValuePlace<'a>,
}

impl<'de> MapAccess<'de> for Entries<'_, 'de> {
    type Error = ValueFault;

    fn next_key_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, ValueFault> {
        let Some((key, value)) = self.entries.next() else { return Ok(None) };
        self.value = Some((key.as_str(), value));
        seed.deserialize(StrDeserializer::<ValueFault>::new(key.as_str())).map(Some)
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, ValueFault> {
        let Some((key, value)) = self.value.take() else {
            return Err(de::Error::custom("a value was asked for before its key"));
        };
        let place = ValuePlace::Key(self.place, key);
        let node = PlacedValue { value, place: &place };
        node.placed(seed.deserialize(node))
    }
}

/// serde's sentence about a value, for people who write files and not types.
fn words(said: &str, value: &Value) -> String {
    for kind in ["invalid type: ", "invalid value: ", "invalid length "] {
        if let Some((_, expected)) = said.strip_prefix(kind).and_then(|rest| rest.split_once(", expected ")) {
            return format!("{} is given, {} is wanted", given(value), wanted(expected));
        }
    }
    if let Some(key) = said.strip_prefix("missing field `").and_then(|rest| rest.strip_suffix('`')) {
        return format!("the key \"{key}\" is missing");
    }
    if let Some((key, known)) = said.strip_prefix("unknown field `").and_then(|rest| rest.split_once("`, expected ")) {
        return format!("the key \"{}\" is not known here; known are {}", cut(key, 40), plain_list(known));
    }
    if let Some((_, known)) = said.strip_prefix("unknown variant `").and_then(|rest| rest.split_once("`, expected ")) {
        return format!("{} is given, {} is wanted", given(value), plain_list(known));
    }
    said.to_owned()
}

/// "`a` or `b`", "one of `a`, `b`, `c`" in the signs of JSON.
fn plain_list(known: &str) -> String {
    known.strip_prefix("one of ").unwrap_or(known).replace('`', "\"")
}

fn given(value: &Value) -> String {
    match value {
        Value::Null => "null".to_owned(),
        Value::Bool(b) => b.to_string(),
        Value::Number(n) => format!("the number {n}"),
        Value::String(s) => format!("the text \"{}\"", cut(s, 40)),
        Value::Array(values) => format!("a list of {}", values.len()),
        Value::Object(_) => "an object {...}".to_owned(),
    }
}

fn wanted(expected: &str) -> String {
    let length = expected.strip_prefix("an array of length ").or_else(|| expected.strip_prefix("a tuple of size "));
    match expected {
        _ if length.is_some() => format!("a list of {} values", length.unwrap_or_default()),
        "a map" => "an object {...}".to_owned(),
        "a sequence" => "a list [...]".to_owned(),
        "a matrix array" => "a list of numbers, as many as it has coordinates (a point or a direction: 3)".to_owned(),
        "a string" | "string or map" => "a text in quotes".to_owned(),
        "f64" | "f32" => "a number".to_owned(),
        "u8" => "a whole number from 0 to 255".to_owned(),
        "usize" | "u64" | "u32" => "a whole number from 0 on".to_owned(),
        "a boolean" => "true or false".to_owned(),
        // The names of our own types tell a user nothing.
        other if other.starts_with("struct ") => "an object {...}".to_owned(),
        other => other.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code, reason = "read to see what is said about it")]
    struct File {
        scene: String,
        #[serde(default)]
        up: Option<[f64; 3]>,
        joints: Vec<Entry>,
    }

    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code, reason = "read to see what is said about it")]
    struct Entry {
        id: String,
        #[serde(rename = "type")]
        kind: Option<Kind>,
        axis: Option<nalgebra::Vector3<f64>>,
        range: Option<[f64; 2]>,
        shape: Option<Shape>,
        #[serde(default)]
        boxes: Vec<Shape>,
    }

    #[derive(Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Kind {
        Revolute,
        Prismatic,
    }

    #[derive(Deserialize)]
    #[allow(dead_code, reason = "read to see what is said about it")]
    struct Shape {
        center: [f64; 3],
        half: [f64; 3],
    }

    fn said(text: &str) -> String {
        let (place, message) = explain::<File>(&serde_json::from_str(text).unwrap()).unwrap();
        format!("{place}: {message}")
    }

    #[test]
    fn a_fault_has_its_place_its_name_and_words_for_people() {
        for (inside, wanted) in [
            ("\"shape\": {\"center\": [0,0,0]}", "joints[0] (door): shape: the key \"half\" is missing"),
            (
                "\"shape\": [0,0,0,1,1,1]",
                "joints[0] (door): shape: a list of 6 is given, an object with \"center\", \"half\" is wanted",
            ),
            ("\"range\": 1.5", "joints[0] (door): range: the number 1.5 is given, a list of 2 values is wanted"),
            ("\"range\": [0, 1, 2]", "joints[0] (door): range: a list of 3 is given, a list of 2 values is wanted"),
            ("\"range\": [0]", "joints[0] (door): range: a list of 1 is given, a list of 2 values is wanted"),
            ("\"axis\": [0, \"1\", 2]", "joints[0] (door): axis[1]: the text \"1\" is given, a number is wanted"),
            ("\"axis\": \"Z\"", "joints[0] (door): axis: the text \"Z\" is given, a list of numbers"),
            (
                "\"boxes\": [3]",
                "joints[0] (door): boxes[0]: the number 3 is given, an object with \"center\", \"half\" is wanted",
            ),
            (
                "\"type\": \"hinge\"",
                "joints[0] (door): type: the text \"hinge\" is given, \"revolute\" or \"prismatic\" is wanted",
            ),
            ("\"type\": 1", "joints[0] (door): type: the number 1 is given, a text in quotes is wanted"),
            ("\"colour\": 1", "joints[0] (door): the key \"colour\" is not known here; known are \"id\", \"type\", "),
        ] {
            let said = said(&format!("{{\"scene\": \"s\", \"joints\": [{{\"id\": \"door\", {inside}}}]}}"));
            assert!(said.starts_with(wanted), "{said}, not {wanted}");
        }
        assert!(said("{\"scene\": \"s\", \"joints\": [{}]}").starts_with("joints[0]: the key \"id\" is missing"));
    }

    #[test]
    fn a_list_in_the_place_of_an_object_is_not_read_in_order() {
        let wanted = "the whole file: a list of 2 is given, an object with \"scene\", \"up\", \"joints\" is wanted";
        assert_eq!(said("[\"s\", []]"), wanted);
        let good =
            serde_json::from_str("{\"scene\": \"s\", \"joints\": [{\"id\": \"a\", \"range\": [0, 1]}]}").unwrap();
        assert!(explain::<File>(&good).is_none());
        assert!(explain::<Kind>(&Value::from("revolute")).is_none());
    }
}
