//! What went wrong, and whose it is to mend.

use std::fmt;
use std::io::ErrorKind;

/// Whose trouble it is. The command line turns it into an exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The call does not make sense.
    Usage,
    /// The input cannot be used, or an output is in the way.
    Input,
    /// Measured and written, but the numbers are not to be trusted, and the call was strict.
    Quality,
    /// Some of a batch could not be measured; the rest is written.
    Partial,
    /// The user stopped it.
    Interrupted,
    /// A fault of ours, or of the machine.
    Fault,
}

/// An error with its chain of contexts, from the file down to the cause.
#[derive(Debug)]
pub struct Error {
    kind: Kind,
    source: anyhow::Error,
}

/// What every function of this crate returns.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An error of this kind with nothing below it.
    pub fn new(kind: Kind, message: impl fmt::Display) -> Self {
        Self {
            kind,
            source: anyhow::Error::msg(message.to_string()),
        }
    }

    /// The user stopped it.
    pub fn interrupted() -> Self {
        Self::new(Kind::Interrupted, "interrupted; nothing was written")
    }

    /// Whose trouble it is.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// The error of another crate below it, where it is one of this type.
    pub fn cause<E: std::error::Error + Send + Sync + 'static>(&self) -> Option<&E> {
        self.source.downcast_ref()
    }

    /// Whether the machine has no room left for what is to be written.
    pub fn no_room(&self) -> bool {
        let full = |cause: &std::io::Error| {
            matches!(
                cause.kind(),
                ErrorKind::StorageFull | ErrorKind::QuotaExceeded
            )
        };
        let mut causes = self.source.chain();
        causes.any(|cause| cause.downcast_ref::<std::io::Error>().is_some_and(full))
    }

    /// The same error, said to have happened in `context`.
    #[must_use]
    pub fn within(self, context: impl fmt::Display) -> Self {
        Self {
            kind: self.kind,
            source: self.source.context(context.to_string()),
        }
    }
}

/// It names its channel itself.
impl From<fit::FitError> for Error {
    fn from(error: fit::FitError) -> Self {
        Self {
            kind: Kind::Input,
            source: error.into(),
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut before = String::new();
        for cause in self.source.chain() {
            let text = cause.to_string();
            // Many errors end with what has caused them.
            if before.ends_with(&text) {
                continue;
            }
            if !before.is_empty() {
                f.write_str(": ")?;
            }
            f.write_str(&text)?;
            before = text;
        }
        Ok(())
    }
}

impl std::error::Error for Error {}

/// Gives an error of another crate its kind and its place.
pub trait Blame<T> {
    /// The input named by `place` is at fault.
    fn input(self, place: impl fmt::Display) -> Result<T>;
    /// The machine or beamspot itself is at fault while doing `place`.
    fn fault(self, place: impl fmt::Display) -> Result<T>;
}

impl<T, E: Into<anyhow::Error>> Blame<T> for std::result::Result<T, E> {
    fn input(self, place: impl fmt::Display) -> Result<T> {
        self.map_err(|e| Error {
            kind: Kind::Input,
            source: e.into().context(place.to_string()),
        })
    }

    fn fault(self, place: impl fmt::Display) -> Result<T> {
        self.map_err(|e| Error {
            kind: Kind::Fault,
            source: e.into().context(place.to_string()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug)]
    struct Twice(std::io::Error);

    impl fmt::Display for Twice {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "OBJ: {}", self.0)
        }
    }

    impl std::error::Error for Twice {
        fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
            Some(&self.0)
        }
    }

    #[test]
    fn what_an_error_has_said_is_not_said_again() {
        let io = std::io::Error::other("no such face");
        let error: Result<()> = Err(Twice(io)).input("a.obj");
        let text = error.expect_err("an error").within("scene").to_string();
        assert_eq!(text, "scene: a.obj: OBJ: no such face");
    }
}
