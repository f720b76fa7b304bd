//! Folder names of fields: safe on every file system, and unique.

use std::collections::BTreeSet;

/// Longest folder name before a suffix; common file systems allow 255 bytes.
const LONGEST: usize = 120;

/// Names that Windows reserves for devices, with any extension and in any case.
const DEVICES: [&str; 4] = ["con", "prn", "aux", "nul"];

/// Assigns folder names, unique regardless of case, because some file systems ignore it.
#[derive(Debug)]
pub(super) struct FolderNames {
    taken: BTreeSet<String>,
}

impl FolderNames {
    pub(super) fn new() -> Self {
        // The group's own metadata lies beside the folders.
        Self { taken: BTreeSet::from(["zarr.json".to_owned()]) }
    }

    /// A unique folder name for a field.
    pub(super) fn give(&mut self, field: &str) -> String {
        let encoded = encode(field);
        let mut name = encoded.clone();
        let mut copy = 1u32;
        while !self.taken.insert(name.to_ascii_lowercase()) {
            copy += 1;
            name = format!("{encoded}~{copy}");
        }
        name
    }
}

/// Whether a name read from a file is a single, plain path segment.
pub(super) fn is_plain(folder: &str) -> bool {
    let allowed = |b: u8| b.is_ascii_alphanumeric() || b"_-.%~".contains(&b);
    !folder.is_empty() && folder.bytes().all(allowed) && !folder.starts_with('.')
}

/// Percent-encodes characters that some file system, Zarr or a URL may not accept.
fn encode(field: &str) -> String {
    let last = field.len().saturating_sub(1);
    let stem = field.split('.').next().unwrap_or_default().to_ascii_lowercase();
    let numbered = |prefix| stem.strip_prefix(prefix).is_some_and(|n| n.len() == 1 && n.as_bytes()[0].is_ascii_digit());
    let device = DEVICES.contains(&stem.as_str()) || numbered("com") || numbered("lpt");
    let mut encoded = String::new();
    for (i, byte) in field.bytes().enumerate() {
        let plain = match byte {
            b'.' => i != 0 && i != last,                // hidden, or dropped by Windows
            b'_' => i != 0 || !field.starts_with("__"), // reserved by Zarr
            b'-' => true,
            _ => byte.is_ascii_alphanumeric() && !(device && i == 0),
        };
        let piece = if plain { char::from(byte).to_string() } else { format!("%{byte:02X}") };
        if encoded.len() + piece.len() > LONGEST {
            break;
        }
        encoded.push_str(&piece);
    }
    if encoded.is_empty() { "%".to_owned() } else { encoded }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn give(fields: &[&str]) -> Vec<String> {
        let mut names = FolderNames::new();
        fields.iter().map(|f| names.give(f)).collect()
    }

    #[test]
    fn plain_names_stay_as_they_are() {
        assert_eq!(give(&["T", "wall_shear-2.5", "velocity:0"]), ["T", "wall_shear-2.5", "velocity%3A0"]);
    }

    #[test]
    fn what_a_file_system_may_refuse_is_encoded() {
        let fields = ["a/b", "a\\b", "..", ".", "", "nul", "COM1.txt", "x.", "__zarr", "Température", "%2F", "a b\n"];
        for (field, folder) in fields.iter().zip(give(&fields)) {
            assert!(is_plain(&folder), "{field:?} became {folder:?}");
            assert!(!folder.ends_with('.') && !folder.starts_with("__"), "{field:?} became {folder:?}");
        }
        assert_eq!(give(&["nul", "COM1.txt", "common", "community"]), ["%6Eul", "%43OM1.txt", "common", "community"]);
    }

    #[test]
    fn names_that_collide_get_folders_of_their_own() {
        let long = "x".repeat(300);
        let longer = "x".repeat(301);
        let fields = ["t", "T", "a:b", "a%3Ab", "zarr.json", "ZARR.JSON", &long, &longer, "t~2", ""];
        let folders = give(&fields);
        let distinct: BTreeSet<String> = folders.iter().map(|f| f.to_ascii_lowercase()).collect();
        assert_eq!(distinct.len(), fields.len(), "{folders:?}");
        assert!(folders.iter().all(|f| is_plain(f) && f.len() < 130 && f != "zarr.json"), "{folders:?}");
    }

    #[test]
    fn a_folder_from_a_file_cannot_lead_elsewhere() {
        for folder in ["", ".", "..", "../x", "a/b", "a\\b", "/etc", "c:x", ".hidden"] {
            assert!(!is_plain(folder), "{folder:?}");
        }
    }
}
