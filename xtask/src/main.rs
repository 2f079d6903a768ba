//! Tasks of the house: `cargo xtask ci` is the one command that passes the tests.

use anyhow::{Context, Result, bail};
use std::env;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

const USAGE: &str = "usage: cargo xtask ci | python
  ci       everything that the server runs: format, lints, tests, documentation, Python
  python   the Python tests alone (cross-check, files, module), in an environment of its own";

fn main() -> Result<()> {
    env::set_current_dir(root())?;
    match env::args().nth(1).as_deref() {
        Some("ci") => ci(),
        Some("python") => python(),
        _ => bail!("{USAGE}"),
    }
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("xtask stands in the root")
        .to_owned()
}

fn ci() -> Result<()> {
    cargo(&["fmt", "--all", "--check"])?;
    cargo(&[
        "clippy",
        "--workspace",
        "--all-targets",
        "--",
        "--deny",
        "warnings",
    ])?;
    cargo(&["test", "--workspace"])?;
    // What stands behind a feature is built by nothing else.
    // Unoptimised, which takes a third of the time to compile and not a second more to run.
    cargo(&[
        "test",
        "--package",
        "beamspot-raw",
        "--features",
        "rawler",
        "--config",
        "profile.dev.opt-level=0",
    ])?;
    cargo(&["check", "--package", "beamspot-cli", "--features", "raw"])?;
    let mut doc = command("cargo", ["doc", "--workspace", "--no-deps"]);
    run(doc.env("RUSTDOCFLAGS", "--deny warnings"))?;
    python()
}

/// Runs the Python tests against the release build and the module.
fn python() -> Result<()> {
    // In one call, the module's package among them: apart, each would compile the dependencies anew
    // with features of its own, and so would pip.
    cargo(&[
        "build",
        "--release",
        "--package",
        "beamspot-cli",
        "--package",
        "beamspot-pipeline",
        "--package",
        "beamspot-python",
        "--bins",
        "--example",
        "response",
    ])?;
    let target =
        env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from);
    let venv = target.join("python");
    let bin = venv
        .join(if cfg!(windows) { "Scripts" } else { "bin" })
        .join("python");
    if !bin.exists() {
        let system = env::var_os("PYTHON").unwrap_or_else(|| "python3".into());
        run(&mut command(
            &system,
            ["-m".as_ref(), "venv".as_ref(), venv.as_os_str()],
        ))?;
    }
    let install = [
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
    ];
    let requirements = ["-r", "tests/python/requirements.txt"];
    run(command(&bin, install).args(requirements))?;
    // The module as its users get it; what the release build has compiled serves again.
    run(command(&bin, install)
        .arg(".")
        .env("CARGO_TARGET_DIR", &target))?;
    let mut pytest = command(
        &bin,
        ["-m", "pytest", "-p", "no:cacheprovider", "tests/python"],
    );
    let built = |name: &str| {
        let file = format!("{name}{}", env::consts::EXE_SUFFIX);
        target.join("release").join(file)
    };
    run(pytest
        .env("BEAMSPOT_BIN", built("beamspot"))
        .env("BEAMSPOT_RESPONSE", built("examples/response"))
        .env("PYTHONDONTWRITEBYTECODE", "1"))
}

fn cargo(arguments: &[&str]) -> Result<()> {
    run(&mut command("cargo", arguments))
}

fn command<S: AsRef<OsStr>>(
    program: impl AsRef<OsStr>,
    arguments: impl IntoIterator<Item = S>,
) -> Command {
    let mut command = Command::new(program);
    command.args(arguments);
    command
}

fn run(command: &mut Command) -> Result<()> {
    let status = command
        .status()
        .with_context(|| format!("starting {command:?}"))?;
    if !status.success() {
        bail!("{command:?}: {status}");
    }
    Ok(())
}
