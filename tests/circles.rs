//! No two files of a floor import each other, directly or through others.

use std::collections::{BTreeMap, BTreeSet};

use super::imports::{Source, read, sources};

/// Which files of the same floor each file imports. What a folder's `mod.rs` re-exports counts as imported from where it
/// is defined, and re-exporting is no import.
pub(crate) fn imports_within_floors(sources: &[Source]) -> BTreeMap<&str, BTreeSet<&str>> {
    let modules: BTreeSet<&str> = sources.iter().map(|source| source.module.as_str()).collect();
    let mut exports: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for source in sources.iter().filter(|source| source.is_folder()) {
        for named in source.named.iter().filter(|named| named.exported) {
            let child = || [source.module.clone()].into_iter().chain(named.segments.iter().cloned()).collect();
            let target = source.below_crate(&named.segments).unwrap_or_else(child);
            exports.insert(format!("{}::{}", source.module, named.alias), target);
        }
    }
    let mut imports = BTreeMap::new();
    for source in sources {
        let own = imports.entry(source.module.as_str()).or_insert_with(BTreeSet::new);
        for named in source.named.iter().filter(|named| !(named.exported && source.is_folder())) {
            let child = || {
                let child = format!("{}::{}", source.module, named.segments[0]);
                modules.contains(child.as_str()).then(|| vec![child])
            };
            let target = source.below_crate(&named.segments).or_else(child);
            let Some(target) = target.and_then(|path| defining_file(&path.join("::"), &modules, &exports)) else {
                continue;
            };
            if target != source.module && target.split("::").next() == Some(source.floor()) {
                own.insert(target);
            }
        }
    }
    imports
}

fn defining_file<'a>(
    path: &str,
    modules: &BTreeSet<&'a str>,
    exports: &BTreeMap<String, Vec<String>>,
) -> Option<&'a str> {
    let mut head = path;
    loop {
        if let Some(&module) = modules.get(head) {
            return Some(module);
        }
        if let Some(target) = exports.get(head) {
            return defining_file(&format!("{}{}", target.join("::"), &path[head.len()..]), modules, exports);
        }
        head = &head[..head.rfind("::")?];
    }
}

/// The files that import each other in a circle, circle by circle.
pub(crate) fn circles<'a>(imports: &BTreeMap<&'a str, BTreeSet<&'a str>>) -> Vec<BTreeSet<&'a str>> {
    let reached = |from: &'a str| {
        let mut seen = BTreeSet::new();
        let mut open = vec![from];
        while let Some(next) = open.pop() {
            open.extend(imports.get(next).into_iter().flatten().filter(|&&to| seen.insert(to)));
        }
        seen
    };
    let reach: BTreeMap<&str, BTreeSet<&str>> = imports.keys().map(|&module| (module, reached(module))).collect();
    let mut found: Vec<BTreeSet<&str>> = Vec::new();
    for (module, seen) in &reach {
        if seen.contains(module) && !found.iter().any(|circle| circle.contains(module)) {
            found.push(
                seen.iter()
                    .copied()
                    .filter(|other| reach.get(other).is_some_and(|back| back.contains(module)))
                    .collect(),
            );
        }
    }
    found
}

#[test]
fn no_files_of_a_floor_import_each_other_in_a_circle() {
    let sources = sources();
    let imports = imports_within_floors(&sources);
    let mut said = Vec::new();
    for circle in circles(&imports) {
        said.push(format!("{} files import each other in a circle:", circle.len()));
        for module in &circle {
            let inside: Vec<&str> = imports[module].intersection(&circle).copied().collect();
            said.push(format!("  {module} -> {}", inside.join(" ")));
        }
    }
    assert!(said.is_empty(), "{}", said.join("\n"));
}

#[test]
fn the_reader_of_imports_finds_circles() {
    let file = |path: &str, text: &str| {
        read(path.into(), path[4..].replace("/mod.rs", "").replace(".rs", "").replace('/', "::"), text)
    };
    let sources = [
        file("src/house/mod.rs", "pub use wall::Wall;\nmod wall; mod door;"),
        file("src/house/wall.rs", "use super::door;\nuse crate::data::X;"),
        file("src/house/door.rs", "fn open(wall: &crate::house::Wall) {}"),
        file("src/house/roof.rs", "use super::{Wall, door};"),
        file("src/data/mod.rs", "use crate::house::Wall;"),
    ];
    let imports = imports_within_floors(&sources);
    assert_eq!(imports["house::roof"], BTreeSet::from(["house::door", "house::wall"]));
    assert_eq!(circles(&imports), [BTreeSet::from(["house::door", "house::wall"])]);
}
