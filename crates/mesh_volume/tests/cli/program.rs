//! Runs the program in a folder of the test's own.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use tempfile::TempDir;

/// The path of the program.
pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_mesh_volume");

/// A temporary folder for volumes and meshes; removed after the test.
pub(crate) struct Folder(TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("the folder of tests can be written"))
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.path(name), bytes).expect("the folder of tests can be written");
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// The names of all files in the folder, including hidden ones.
    pub(crate) fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.0.path()).expect("the folder of tests can be read");
        let mut names: Vec<_> =
            entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// The program, ready to run in the folder.
    pub(crate) fn command(&self) -> Command {
        let mut command = Command::new(PROGRAM);
        command.current_dir(self.0.path());
        command
    }

    /// Runs the program with these arguments, split at spaces.
    pub(crate) fn run(&self, args: &str) -> Output {
        self.command().args(args.split_whitespace()).output().expect("the program can be run")
    }

    /// Runs the program, which must succeed and print nothing to standard error.
    #[track_caller]
    pub(crate) fn mesh(&self, args: &str) -> String {
        let output = self.run(args);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && errors.is_empty(), "{args} ended with {}:\n{errors}", output.status);
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// Runs the program, which must succeed and print a note.
    #[track_caller]
    pub(crate) fn mesh_noting(&self, args: &str) -> String {
        let output = self.run(args);
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(
            output.status.success() && errors.starts_with("note: "),
            "{args} ended with {}:\n{errors}",
            output.status
        );
        errors
    }

    /// Runs the program, which must refuse with one sentence that contains all of `because`, and leave all files
    /// unchanged.
    #[track_caller]
    pub(crate) fn assert_refused(&self, args: &str, code: i32, because: &[&str]) {
        let before = self.names();
        let output = self.run(args);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{args} ended with {}:\n{errors}", output.status);
        assert!(!errors.contains("panicked"), "{args} said:\n{errors}");
        for part in because {
            assert!(errors.contains(part), "{args} said, without “{part}”:\n{errors}");
        }
        assert_eq!(self.names(), before, "{args}");
    }
}
