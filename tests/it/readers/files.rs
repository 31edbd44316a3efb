//! Files of one input: most readers take a path.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A folder of files. What is already in it is not written again.
pub struct Files {
    root: PathBuf,
    held: BTreeMap<String, Vec<u8>>,
}

impl Files {
    /// A folder of this process in `parent`, whose owner removes it.
    pub fn new(parent: &Path) -> Self {
        let root = parent.join(format!("paws-fuzz-{}", std::process::id()));
        std::fs::create_dir_all(&root).expect("the folder for inputs cannot be made");
        Self { root, held: BTreeMap::new() }
    }

    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Writes a file; its path.
    pub fn put(&mut self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.root.join(name);
        if self.held.get(name).is_some_and(|held| held == bytes) {
            return path;
        }
        if let Some(folder) = path.parent() {
            let _ = std::fs::create_dir_all(folder);
        }
        // An input may have had a folder of the name.
        let written = std::fs::write(&path, bytes)
            .or_else(|_| std::fs::remove_dir_all(&path).and_then(|()| std::fs::write(&path, bytes)));
        // A name below a file's name cannot be written: the input goes without it.
        if written.is_ok() {
            self.held.insert(name.to_owned(), bytes.to_vec());
        }
        path
    }

    /// Leaves these files and no others.
    pub fn only(&mut self, files: &[(String, &[u8])]) {
        let gone: Vec<String> =
            self.held.keys().filter(|held| files.iter().all(|(n, _)| n != *held)).cloned().collect();
        for name in gone {
            let _ = std::fs::remove_file(self.root.join(&name));
            self.held.remove(&name);
        }
        for (name, bytes) in files {
            self.put(name, bytes);
        }
    }
}
