//! What a glTF file's extensions mean for what is judged: where they are used says what they can change.

use std::collections::BTreeSet;

use serde_json::Value;

use super::gltf_file::list;
use super::{rigid_bodies, xml};

/// The registered prefixes.
const PREFIXES: &str = include_str!("../../assets/gltf-prefixes.txt");

/// Whether an extension's name begins with a registered prefix.
fn is_registered(name: &str) -> bool {
    let known = || PREFIXES.lines().filter(|l| !l.starts_with('#')).flat_map(str::split_ascii_whitespace);
    name.split_once('_').is_some_and(|(prefix, _)| known().any(|k| k == prefix))
}

/// Whether several vendors share an extension.
fn is_shared(name: &str) -> bool {
    ["KHR_", "EXT_"].iter().any(|p| name.starts_with(p))
}

fn names(json: &Value, key: &str) -> Vec<String> {
    list(json, key).iter().filter_map(Value::as_str).map(str::to_owned).collect()
}

/// Extensions without which the file cannot be shown.
pub(super) fn required(json: &Value) -> Vec<String> {
    names(json, "extensionsRequired")
}

/// Whether a file says that it uses an extension.
pub(super) fn uses(json: &Value, name: &str) -> bool {
    list(json, "extensionsUsed").iter().any(|e| e.as_str() == Some(name))
}

/// The parts of a file, by the keys at its top, in which an extension stands.
fn places<'a>(json: &'a Value, name: &str) -> BTreeSet<&'a str> {
    let parts = json.as_object().into_iter().flatten();
    parts.filter(|(key, value)| holds(value, name, key.as_str() == "extensions")).map(|(key, _)| key.as_str()).collect()
}

/// Whether an extension stands in a value; `list` says that the value is a list of extensions itself.
fn holds(value: &Value, name: &str, list: bool) -> bool {
    match value {
        Value::Object(inner) => {
            inner.iter().any(|(k, v)| (list && k == name) || (k != "extras" && holds(v, name, k == "extensions")))
        }
        Value::Array(values) => values.iter().any(|v| holds(v, name, false)),
        _ => false,
    }
}

/// What breaks the format's rules, or what no reader can be asked to know.
pub(super) fn faults(json: &Value) -> Vec<String> {
    let mut out = Vec::new();
    for name in required(json) {
        let shown = xml::brief(&name);
        if !uses(json, &name) {
            out.push(format!("{shown} is required and not in extensionsUsed; list it there too"));
        }
        if !is_registered(&name) {
            out.push(format!(
                "{shown} is required, and is no extension that vendors share or have registered a prefix for: whoever does \
                 not know it must refuse the file; list it in extensionsUsed alone where the file can be shown without"
            ));
        }
    }
    let quantized = "KHR_mesh_quantization";
    if uses(json, quantized) && !required(json).iter().any(|n| n == quantized) {
        out.push(format!("{quantized} must be in extensionsRequired where it is used"));
    }
    let asset = &json["asset"];
    if let (Some(least), Some(version)) = (asset["minVersion"].as_str(), asset["version"].as_str()) {
        let order = |v: &str| v.split('.').map(|n| n.parse::<u32>().unwrap_or(0)).collect::<Vec<_>>();
        if order(least) > order("2.0") || order(least) > order(version) {
            out.push(format!("asks for glTF {} at least, and is {}", xml::brief(least), xml::brief(version)));
        }
    }
    out
}

/// What required extensions mean here.
pub(super) fn told(json: &Value) -> Vec<String> {
    required(json)
        .iter()
        .map(|name| {
            let shown = xml::brief(name);
            let at = places(json, name);
            let any = |keys: &[&str]| keys.iter().any(|k| at.contains(k));
            if [rigid_bodies::NAME, rigid_bodies::SHAPES].contains(&name.as_str()) {
                format!("{shown} is required: viewers without physics must refuse the file; extensionsUsed is enough")
            } else if any(&["meshes", "bufferViews", "accessors", "buffers"]) {
                format!(
                    "{shown} is required: whoever does not have it must refuse the file; shapes in it are not judged"
                )
            } else if any(&["nodes", "scenes", "animations", "skins"]) {
                format!("{shown} is required: what it does to nodes and animations is not judged")
            } else if is_shared(name) {
                format!(
                    "{shown} is required: readers without it must refuse the file, though nothing that moves needs it"
                )
            } else {
                format!(
                    "{shown} is required and one vendor's: few readers have it, and all others must refuse the file"
                )
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn what_an_extension_changes_follows_from_where_it_stands() {
        let with = |name: &str, key: &str| {
            json!({"asset": {"version": "2.0"}, "extensionsUsed": [name], "extensionsRequired": [name],
                key: [{"extensions": {name: {}}}]})
        };
        for (name, key, word) in [
            ("KHR_draco_mesh_compression", "meshes", "shapes in it are not judged"),
            ("EXT_meshopt_compression", "bufferViews", "shapes in it are not judged"),
            ("KHR_texture_transform", "materials", "nothing that moves needs it"),
            ("EXT_mesh_gpu_instancing", "nodes", "nodes and animations is not judged"),
            (rigid_bodies::NAME, "nodes", "extensionsUsed is enough"),
            ("MSFT_texture_dds", "textures", "is required and one vendor's"),
            ("OMI_physics_body", "nodes", "nodes and animations is not judged"),
            ("VRMC_vrm", "materials", "is required and one vendor's"),
        ] {
            let json = with(name, key);
            assert!(faults(&json).is_empty(), "{name}: {:?}", faults(&json));
            assert!(told(&json)[0].contains(word), "{name}: {:?}", told(&json));
        }
        for name in ["FOO_own", "VRM", "msft_own", "_own"] {
            assert!(faults(&with(name, "nodes"))[0].contains("no extension that vendors share"), "{name}");
        }
        let later = json!({"asset": {"version": "2.0", "minVersion": "2.1"}});
        assert!(faults(&later)[0].contains("2.1 at least"));
    }
}
