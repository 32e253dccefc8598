//! Writes the list of the shipped files in `config/`, so that the library carries their bytes.
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let variable = |name: &str| env::var_os(name).map(PathBuf::from).ok_or(io::ErrorKind::NotFound);
    let config = fs::canonicalize(variable("CARGO_MANIFEST_DIR")?.join("../config"))?;
    println!("cargo::rerun-if-changed={}", config.display());
    let mut files = Vec::new();
    list(&config, &mut files)?;
    files.sort();
    let mut code = String::from("pub(super) static FILES: &[(&str, &[u8])] = &[\n");
    for file in files {
        let name = file.strip_prefix(&config).map_err(io::Error::other)?;
        let _always_room = writeln!(code, "    ({name:?}, include_bytes!({file:?})),");
    }
    code.push_str("];\n");
    fs::write(variable("OUT_DIR")?.join("shipped_files.rs"), code)
}

fn list(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            list(&path, files)?;
        } else {
            files.push(path);
        }
    }
    Ok(())
}
