//! Which module may use which: every `use` and path in `src/` points down the list of layers, and none in a circle.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The top modules from the lowest to the highest; a module may use those of lower layers alone.
const LAYERS: [&[&str]; 12] = [
    &["geometry", "model"],
    &["error"],
    &["interrupt", "memory"],
    &["image", "threads"],
    &["params", "group"],
    &["pyramid"],
    &["exact"],
    &["fast", "separable", "skimage", "canvas"],
    &["rescore", "guided"],
    &["detect"],
    &["describe"],
    &["python"],
];

/// A module, and the modules that its file names.
type Uses = BTreeMap<String, BTreeSet<String>>;

/// Every file of `folder` with its module's path, such as `fast::lane::avx2`; that of `lib.rs` is empty.
fn files(folder: &Path, module: &str, found: &mut Vec<(String, PathBuf)>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let below = if module.is_empty() { stem.clone() } else { format!("{module}::{stem}") };
        if path.is_dir() {
            files(&path, &below, found);
        } else {
            found.push((if stem == "mod" || stem == "lib" { module.to_owned() } else { below }, path));
        }
    }
}

/// The code of a file without its comments, tests and visibilities such as `pub(in crate::fast)`.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]").next().unwrap();
    let lines = text.lines().map(|line| line.split("//").next().unwrap_or_default());
    lines.collect::<Vec<_>>().join("\n").replace("pub(in crate::", "pub(in ")
}

/// The paths in `code` that begin with `crate::`, `super::` or `self::`; those of a `use` list, each on its own.
fn paths(code: &str) -> Vec<String> {
    let mut found = Vec::new();
    for root in ["crate::", "super::", "self::"] {
        for (at, _) in code.match_indices(root) {
            let before = code[..at].chars().next_back();
            if before.is_none_or(|c| !c.is_alphanumeric() && c != '_' && c != ':') {
                expand(&code[at..], "", &mut found);
            }
        }
    }
    found
}

/// Adds the paths that `text` begins with to `found`, and gives the rest of it.
fn expand<'a>(text: &'a str, prefix: &str, found: &mut Vec<String>) -> &'a str {
    let end = text.find(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':')).unwrap_or(text.len());
    let (path, mut rest) = text.split_at(end);
    let path = format!("{prefix}{path}");
    if !(path.ends_with("::") && rest.starts_with('{')) {
        found.push(path);
        return rest;
    }
    while !rest.starts_with('}') {
        rest = expand(rest[1..].trim_start(), &path, found).trim_start();
        rest = &rest[rest.find([',', '}']).unwrap()..];
    }
    &rest[1..]
}

/// The module that `path`, written in `module`, leads to.
fn target(path: &str, module: &str, modules: &BTreeSet<String>) -> String {
    let mut place: Vec<&str> = module.split("::").filter(|part| !part.is_empty()).collect();
    for part in path.split("::") {
        match part {
            "crate" => place.clear(),
            "super" => {
                place.pop();
            }
            "self" => {}
            name => {
                let below = [place.as_slice(), &[name]].concat();
                if !modules.contains(&below.join("::")) {
                    break;
                }
                place = below;
            }
        }
    }
    place.join("::")
}

/// The arrows of the crate whose files' modules and texts are `files`, but those from `lib.rs`, which names all.
fn arrows(files: &[(String, String)]) -> Uses {
    let modules: BTreeSet<String> = files.iter().map(|(module, _)| module.clone()).collect();
    let mut uses = Uses::new();
    for (module, text) in files.iter().filter(|(module, _)| !module.is_empty()) {
        let found = uses.entry(module.clone()).or_default();
        let mut named: Vec<String> =
            paths(&code(text)).iter().map(|path| target(path, module, &modules)).collect();
        // `pub use child::Name` begins with the child's name.
        let code = code(text);
        let own = code.lines().filter_map(|line| line.split_once("use ").map(|(_, path)| path));
        let own = own
            .map(|path| format!("self::{path}"))
            .map(|path| target(&path.replace(';', ""), module, &modules));
        named.extend(own);
        found.extend(named.into_iter().filter(|named| named != module));
    }
    uses
}

fn layer(module: &str) -> usize {
    let top = module.split("::").next().unwrap();
    LAYERS.iter().position(|layer| layer.contains(&top)).ok_or(format!("{top} is in no layer")).unwrap()
}

/// What is wrong with the arrows: those that do not point down, and circles.
fn faults(uses: &Uses) -> Vec<String> {
    let mut faults = Vec::new();
    for (module, named) in uses {
        for other in named {
            let top = |module: &str| module.split("::").next().unwrap().to_owned();
            if other.is_empty() {
                // The crate's own names: only the highest modules take them from `lib.rs`.
                if layer(module) + 1 != LAYERS.len() {
                    faults.push(format!("{module} takes a name from lib.rs"));
                }
            } else if top(module) != top(other) && layer(other) >= layer(module) {
                faults.push(format!("{module} uses {other}, which is not below it"));
            }
        }
    }
    // Modules that use none of those left, or that none of them uses, go: the circles stay.
    let mut left = uses.clone();
    loop {
        let (names, before): (BTreeSet<String>, _) = (left.keys().cloned().collect(), left.len());
        let used: BTreeSet<String> = left.values().flatten().cloned().collect();
        left.retain(|module, named| used.contains(module) && named.iter().any(|other| names.contains(other)));
        if left.len() == before {
            break;
        }
    }
    if !left.is_empty() {
        faults.push(format!("a circle among {:?}", left.keys()));
    }
    faults
}

fn crate_files() -> Vec<(String, String)> {
    let mut found = Vec::new();
    files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), "", &mut found);
    found.into_iter().map(|(module, path)| (module, std::fs::read_to_string(path).unwrap())).collect()
}

#[test]
fn every_module_uses_only_those_below_it_and_none_in_a_circle() {
    let uses = arrows(&crate_files());
    assert!(uses["fast::strip"].contains("fast::lane"), "arrows are not found");
    assert!(uses["rescore"].contains("exact") && uses["rescore"].contains("fast"), "arrows are not found");
    assert_eq!(faults(&uses), Vec::<String>::new());
}

#[test]
fn a_folder_holds_at_most_twelve_files_and_a_file_400_lines() {
    let (mut folders, long) = (BTreeMap::new(), ["fast", "exact::tables"]);
    let mut found = Vec::new();
    files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), "", &mut found);
    for (module, path) in found {
        *folders.entry(path.parent().unwrap().to_owned()).or_insert(0) += 1;
        let lines = std::fs::read_to_string(&path).unwrap().lines().count();
        let may_be_long = long.iter().any(|long| module.starts_with(long));
        assert!(lines <= 400 || may_be_long, "{module} has {lines} lines");
    }
    assert!(folders.values().all(|&count| count <= 12), "{folders:?}");
}

#[test]
fn an_arrow_up_and_a_circle_are_noticed_however_they_are_written() {
    let with = |module: &str, text: &str| {
        let mut files = crate_files();
        let (_, own) = files.iter_mut().find(|(name, _)| name == module).unwrap();
        *own = format!("{text}\n{own}");
        faults(&arrows(&files)).join("; ")
    };
    let up = "exact::gradient uses fast";
    assert!(with("exact::gradient", "use crate::fast;").contains(up));
    assert!(with("exact::gradient", "use crate::{geometry::Size, fast::{Plan, Planes}};").contains(up));
    assert!(with("exact::gradient", "fn f() { super::super::fast::split() }").contains(up));
    assert!(with("exact::gradient", "fn f() -> crate::fast::Plan {}").contains(up));
    assert!(with("geometry", "use crate::Hog;").contains("geometry takes a name from lib.rs"));
    assert!(with("fast::plan", "use super::level::Scratch;").contains("a circle"));
    assert!(with("exact::tables", "use super::blocks::block_histograms;").contains("a circle"));
    assert_eq!(with("exact::gradient", "use crate::geometry::Rect; // not crate::fast"), "");
}
