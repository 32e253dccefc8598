//! The root directory of a small Debian, made once by mmdebstrap and kept as a squashfs image.
//!
//! It comes from wherever this host's own apt gets its packages. As an image it has the right owners whoever makes it,
//! and the guest mounts it read-only.
use anyhow::{Context, Result, bail, ensure};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// What a controller has that runs the services, and what the tests look with.
const PACKAGES: &str = "systemd,systemd-sysv,udev,iproute2,kmod,can-utils,dbus,sudo";
/// What is not read in a test.
const WITHOUT: [&str; 4] =
    ["/usr/share/man/*", "/usr/share/locale/*", "/usr/share/doc/*", "/usr/share/info/*"];

/// The image in `cache`, made if there is none of these packages and sources yet: takes a minute or two then, says so.
///
/// # Errors
/// When it cannot be made.
pub fn image(cache: &Path) -> Result<PathBuf> {
    let sources = sources()?;
    let recipe = format!("{PACKAGES}\n{}\n{sources}", WITHOUT.join("\n"));
    let (image, made_by) = (cache.join("debian.squashfs"), cache.join("debian.recipe"));
    if image.is_file() && fs::read_to_string(&made_by).is_ok_and(|text| text == recipe) {
        return Ok(image);
    }
    println!("making a Debian root for the machine (once) ..");
    fs::create_dir_all(cache).with_context(|| format!("{} cannot be made", cache.display()))?;
    let _none_before = fs::remove_file(&made_by);
    let (tar, list) = (cache.join("debian.tar"), cache.join("debian.list"));
    fs::write(&list, &sources)?;
    let mut bootstrap = Command::new("mmdebstrap");
    bootstrap.args(["--quiet", "--variant=minbase", "--format=tar", &format!("--include={PACKAGES}")]);
    bootstrap.args(["--aptopt=Apt::Install-Recommends \"false\""]);
    bootstrap.args(WITHOUT.map(|path| format!("--dpkgopt=path-exclude={path}")));
    // An empty suite: the list of sources names it.
    run(bootstrap.arg("").arg(&tar).arg(&list))?;
    let mut pack = Command::new("tar2sqfs");
    // It warns of ACLs that squashfs does not keep and is not needed here.
    pack.args(["--quiet", "--force", "--compressor", "zstd", "--comp-extra", "level=3"]).arg(&image);
    run(pack.stdin(fs::File::open(&tar)?).stderr(Stdio::null()))?;
    fs::remove_file(&tar)?;
    // Last: an image without its recipe is half an image.
    fs::write(&made_by, &recipe)?;
    Ok(image)
}

/// Debian's own among the sources of this host's apt, in the one-line style. Third parties' are left out: their keys are
/// not the guest's.
fn sources() -> Result<String> {
    let mut question = Command::new("apt-get");
    question.args(["indextargets", "--format", "deb $(REPO_URI) $(CODENAME) $(COMPONENT)"]);
    let answer = question.args(["Created-By: Packages", "Origin: Debian"]).output().context("no apt-get")?;
    let text = String::from_utf8(answer.stdout).context("apt-get indextargets")?;
    ensure!(answer.status.success(), "apt-get indextargets: {}", answer.status);
    let mut lines: Vec<&str> = text.lines().collect();
    lines.sort_unstable();
    lines.dedup();
    if lines.is_empty() {
        bail!("this host's apt knows no packages of Debian; run apt-get update on a Debian 12 or newer");
    }
    Ok(lines.join("\n") + "\n")
}

fn run(command: &mut Command) -> Result<()> {
    let status = command.status().with_context(|| format!("cannot start {:?}", command.get_program()))?;
    ensure!(status.success(), "{:?}: {status}", command.get_program());
    Ok(())
}
