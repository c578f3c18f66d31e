//! Runs the examples that `cargo test` has built.

use std::path::PathBuf;
use std::process::Command;

/// The example of that name, ready to run without much talk.
pub(crate) fn example(name: &str) -> Command {
    let test = std::env::current_exe().expect("a test knows where it is");
    let folder = test.ancestors().nth(2).expect("tests lie in a folder beside the examples'").join("examples");
    let program = folder.join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
    assert!(program.exists(), "{} is missing; `cargo test --workspace` builds it", program.display());
    let mut command = Command::new(program);
    command.env("RUST_LOG", "error").current_dir(folder_of_tests());
    if std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        command.env("XDG_RUNTIME_DIR", folder_of_tests());
    }
    command
}

/// A folder for what tests write.
pub(crate) fn folder_of_tests() -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR"))
}
