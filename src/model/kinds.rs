//! What a file is, told from how it begins: to read glTF under any name, and to tell whoever gave something else.

use std::fs::File;
use std::io::Read;
use std::path::Path;

/// What a message about a file of another kind ends with.
pub(super) const WANTED: &str =
    "expected <robot> (URDF) or <mujoco> (MJCF); `paws check` also reads glTF (.glb, .gltf)";

/// As much as tells one kind from another, bytes.
const HEAD: u64 = 4096;

/// How a Git LFS pointer begins.
const LFS: &[u8] = b"version https://git-lfs";

/// Whether bytes are those of a Git LFS pointer, which stands for a file that was not fetched.
pub(super) fn is_pointer(bytes: &[u8]) -> bool {
    bytes.starts_with(LFS)
}

/// How files begin that are no models, and what they are.
const MAGIC: [(&[u8], &str); 14] = [
    (LFS, "is a Git LFS pointer, not the file that it stands for; run `git lfs pull`"),
    (b"\x1f\x8b", "is compressed with gzip; unpack it first (gunzip)"),
    (b"BZh", "is compressed with bzip2; unpack it first (bunzip2)"),
    (b"\xfd7zXZ", "is compressed with xz; unpack it first (unxz)"),
    (b"\x28\xb5\x2f\xfd", "is compressed with zstd; unpack it first (unzstd)"),
    (b"PK\x03\x04", "is a ZIP archive (usdz is one); unpack it first (unzip)"),
    (b"#usda", "is OpenUSD as text (.usda), which is not read; export the model as URDF or MJCF"),
    (b"PXR-USDC", "is binary OpenUSD (.usdc), which is not read; export the model as URDF or MJCF"),
    (b"Kaydara FBX", "is FBX, which is not read; export the model as glTF"),
    (b"ply", "is a mesh (PLY), not a model"),
    (b"\x89PNG", "is a picture (PNG)"),
    (b"\xff\xd8\xff", "is a picture (JPEG)"),
    (b"%PDF", "is a PDF"),
    (b"\x7fELF", "is a program"),
];

/// The first bytes of a regular file; none where there is no such file, which its reader tells better.
pub(super) fn head(path: &Path) -> Vec<u8> {
    let mut bytes = Vec::new();
    // A pipe would be waited for.
    if std::fs::metadata(path).is_ok_and(|m| m.is_file())
        && let Ok(file) = File::open(path)
    {
        // What could be read is looked at; the reader meets the same error and tells it.
        let _ = file.take(HEAD).read_to_end(&mut bytes);
    }
    bytes
}

/// The text from its first letter on.
fn trimmed(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start()
}

/// Whether bytes begin as JSON does.
pub(super) fn is_json(bytes: &[u8]) -> bool {
    matches!(trimmed(bytes).first(), Some(b'{' | b'['))
}

/// Whether a file is glTF by what it holds, or means to be by its name.
#[must_use]
pub fn is_gltf(path: &Path) -> bool {
    let named = path.extension().is_some_and(|e| ["glb", "gltf"].iter().any(|n| e.eq_ignore_ascii_case(n)));
    let bytes = head(path);
    named || bytes.starts_with(b"glTF") || (is_json(&bytes) && contains(&bytes, b"\"asset\""))
}

fn contains(bytes: &[u8], wanted: &[u8]) -> bool {
    bytes.windows(wanted.len()).any(|w| w == wanted)
}

/// What a file is that begins like this, in words behind "it", where it is no XML; `None` where it may be.
pub(super) fn foreign(path: &Path, bytes: &[u8]) -> Option<String> {
    if let Some((_, what)) = MAGIC.iter().find(|(magic, _)| bytes.starts_with(magic)) {
        return Some((*what).to_owned());
    }
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Some("is not UTF-8 but UTF-16 text; save the file as UTF-8".to_owned());
    }
    if bytes.starts_with(b"glTF") {
        return Some("is binary glTF, in which nothing is said about joints".to_owned());
    }
    let text = trimmed(bytes);
    let page = |name: &[u8]| text.get(..name.len()).is_some_and(|t| t.eq_ignore_ascii_case(name));
    if page(b"<!doctype html") || page(b"<html") {
        return Some("is a web page (HTML), perhaps an error of a download; fetch the file itself".to_owned());
    }
    if is_json(bytes) {
        let what = if contains(bytes, b"\"asset\"") { "glTF as JSON" } else { "JSON" };
        return Some(format!("is {what}"));
    }
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    if !bytes.is_empty() && ["obj", "stl", "ply", "msh", "fbx", "3mf", "off"].contains(&extension.as_str()) {
        return Some(format!("is a mesh (.{extension}), not a model that names meshes"));
    }
    let is_text = !text.is_empty() && !text.contains(&0) && std::str::from_utf8(&bytes[..bytes.len().min(64)]).is_ok();
    (is_text && !text.contains(&b'<')).then(|| "is text without any XML".to_owned())
}

/// What an XML file is whose outermost element is neither a URDF's nor an MJCF's, in words behind "it".
pub(super) fn foreign_root(name: &str) -> String {
    let local = name.rsplit(':').next().unwrap_or(name).to_ascii_lowercase();
    match local.as_str() {
        "robot" | "mujoco" if local != name => {
            format!("begins with <{}>; the name is <{local}>", super::xml::brief(name))
        }
        "sdf" | "gazebo" | "world" => "is SDF, which is not read; export the model as URDF".to_owned(),
        "html" => "is a web page (HTML), perhaps an error of a download; fetch the file itself".to_owned(),
        "collada" => "is a mesh (COLLADA), not a model that names meshes".to_owned(),
        "mujocoinclude" => "is a part of an MJCF model; give the file that includes it".to_owned(),
        "launch" => "is a ROS launch file; give the model that it names".to_owned(),
        "svg" => "is a picture (SVG)".to_owned(),
        _ => format!("begins with <{}>", super::xml::brief(name)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_other_kinds_are_called_what_they_are() {
        let cases: [(&str, &[u8], &str); 10] = [
            ("a.urdf", b"version https://git-lfs.github.com/spec/v1\noid sha256:aa", "Git LFS pointer"),
            ("a.urdf.gz", b"\x1f\x8b\x08\0", "gzip"),
            ("a.usda", b"#usda 1.0\n", "OpenUSD"),
            ("a.usdz", b"PK\x03\x04", "usdz"),
            ("a.urdf", b"\n<!DOCTYPE html><html>", "HTML"),
            ("a.json", b"{\"a\": 1}", "is JSON"),
            ("a.json", b" {\"asset\": {}}", "glTF as JSON"),
            ("a.obj", b"v 1 2 3\n", "a mesh (.obj)"),
            ("a.txt", b"0.1 0.2 0.3\n", "without any XML"),
            ("a.urdf", b"\xff\xfe<\0", "UTF-16"),
        ];
        for (name, bytes, word) in cases {
            let told = foreign(Path::new(name), bytes).unwrap_or_default();
            assert!(told.contains(word), "{name}: {told}");
        }
        for bytes in [&b"<robot/>"[..], b"\xef\xbb\xbf <?xml version='1.0'?><mujoco/>", b"", b"\0\0"] {
            assert_eq!(foreign(Path::new("a.urdf"), bytes), None);
        }
        for (name, word) in [("Robot", "the name is <robot>"), ("u:robot", "<robot>"), ("sdf", "SDF"), ("a", "<a>")] {
            assert!(foreign_root(name).contains(word), "{name}");
        }
    }
}
