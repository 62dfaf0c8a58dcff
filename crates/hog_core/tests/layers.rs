//! Which module may use which: every path in `src/` that begins with `crate::` points down the list of layers.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

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
    &["fast", "separable", "skimage"],
    &["rescore", "guided", "second"],
    &["options"],
    &["detect"],
    &["describe"],
];

/// Every file of `folder`.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

/// The top modules that `text` names by `crate::module` or `crate::{module::…, …}`, comments and tests apart.
fn used(text: &str) -> Vec<String> {
    let text = text.split("#[cfg(test)]").next().unwrap().replace("(in crate::", "");
    let code: Vec<_> = text.lines().map(|line| line.split("//").next().unwrap()).collect();
    let code = code.join(" ");
    let word = |path: &str| path.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
    let is_top = |name: &String| LAYERS.iter().any(|layer| layer.contains(&name.as_str()));
    let names = code.split("crate::").skip(1).flat_map(|path| match path.strip_prefix('{') {
        // Of a list those that are top modules: the others lie within them.
        Some(list) => {
            list.split(';').next().unwrap().split([',', '{', '}']).map(word).filter(is_top).collect()
        }
        None => vec![word(path)],
    });
    names.collect()
}

/// What a file of the top module `module` uses that does not lie below it.
fn up(module: &str, text: &str) -> Vec<String> {
    let layer = |name: &str| LAYERS.iter().position(|layer| layer.contains(&name));
    let own = layer(module).unwrap_or_else(|| unreachable!("{module} is in no layer"));
    let is_up = |name: &String| name != module && layer(name).is_none_or(|other| other >= own);
    used(text).into_iter().filter(is_up).collect()
}

#[test]
fn every_module_uses_only_those_below_it_and_no_file_or_folder_is_too_long() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for path in files(&source).into_iter().filter(|path| !path.ends_with("lib.rs")) {
        let place = path.strip_prefix(&source).unwrap();
        let top = Path::new(place.iter().next().unwrap()).file_stem().unwrap().to_str().unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(up(top, &text), Vec::<String>::new(), "{}", place.display());
        assert!(text.lines().count() <= 400, "{}", place.display());
        let beside = path.parent().unwrap().read_dir().unwrap();
        assert!(beside.filter(|entry| entry.as_ref().unwrap().path().is_file()).count() <= 13);
    }
}

#[test]
fn an_arrow_up_is_noticed_however_it_is_written() {
    for text in
        ["use crate::fast;", "use crate::{geometry::Size, fast::{Plan, Planes}};", "-> crate::fast::Plan {}"]
    {
        assert_eq!(up("exact", text), ["fast"], "{text}");
    }
    assert_eq!(up("geometry", "use crate::Hog;"), ["Hog"]);
    assert_eq!(up("exact", "use crate::geometry::Rect; // not crate::fast"), Vec::<String>::new());
}
