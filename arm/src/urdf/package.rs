//! Where the files are that a URDF names.
use std::path::{Path, PathBuf};

/// The file of a name as URDF files have it: `package://NAME/REST`, `file://PATH`, or a path relative to the URDF.
///
/// A package is a folder of that name. It is looked for in each of `package_dirs`, then beside the URDF and in every
/// folder above it; `package_dirs` may name the package itself as well as the folder that holds it.
///
/// # Errors
/// What was expected, with every place that was looked at.
pub(crate) fn find(urdf: &Path, package_dirs: &[PathBuf], named: &str) -> Result<PathBuf, String> {
    let folder = urdf.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let places = match named.split_once("://") {
        None => vec![folder.join(named)],
        Some(("file", path)) => vec![folder.join(path)],
        Some(("package" | "model", rest)) => in_packages(folder, package_dirs, rest)?,
        Some(_) => return Err("a path, file:// or package://: nothing is fetched from elsewhere".to_owned()),
    };
    if let Some(found) = places.iter().find(|place| crate::shipped::is_file(place)) {
        return Ok(found.clone());
    }
    let places: Vec<String> = places.iter().map(|place| place.display().to_string()).collect();
    Err(format!(
        "a mesh file; looked at {}; `package_dirs` in the robot file names more folders",
        places.join(", ")
    ))
}

fn in_packages(folder: &Path, package_dirs: &[PathBuf], rest: &str) -> Result<Vec<PathBuf>, String> {
    let (package, path) = rest.split_once('/').ok_or("package://NAME/PATH")?;
    // A package is one folder of a given name, never a way up.
    if package.is_empty() || package == "." || package == ".." || path.is_empty() {
        return Err("package://NAME/PATH with the name of a package".to_owned());
    }
    let mut places = Vec::new();
    // As an absolute path it has all the folders above it.
    let above = std::fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
    for root in package_dirs.iter().map(PathBuf::as_path).chain(above.ancestors()) {
        if root.file_name().is_some_and(|name| name == package) {
            places.push(root.join(path));
        }
        places.push(root.join(package).join(path));
    }
    Ok(places)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn mesh_is_found_beside_above_and_in_package_dirs() {
        let root = std::env::temp_dir().join(format!("taustream-package-{}", std::process::id()));
        let urdf = root.join("ws/arm_description/urdf/arm.urdf");
        for file in [
            "ws/arm_description/urdf/own.stl",
            "ws/arm_description/meshes/a.stl",
            "ws/other/b.stl",
            "far/lib/c.stl",
        ] {
            let file = root.join(file);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, "x").unwrap();
        }
        let found =
            |dirs: &[PathBuf], named: &str| find(&urdf, dirs, named).map(|p| fs::read_to_string(p).unwrap());
        let absolute = format!("file://{}", root.join("ws/other/b.stl").display());
        for named in [
            "own.stl",
            "../meshes/a.stl",
            "package://arm_description/meshes/a.stl",
            "package://other/b.stl",
            &absolute,
        ] {
            assert_eq!(found(&[], named), Ok("x".to_owned()), "{named}");
        }
        for dirs in [root.join("far"), root.join("far/lib")] {
            assert_eq!(found(&[dirs], "package://lib/c.stl"), Ok("x".to_owned()));
        }
        let lost = found(&[], "package://lib/c.stl").unwrap_err();
        assert!(lost.contains("lib/c.stl") && lost.contains("package_dirs"), "{lost}");
        for named in [
            "http://host/a.stl",
            "package://",
            "package://..",
            "package://../a.stl",
            "package:///a.stl",
            "none.stl",
        ] {
            assert!(found(&[], named).is_err(), "{named}");
        }
        fs::remove_dir_all(root).unwrap();
    }
}
