//! Many captures, and what became of each.
//!
//! A folder of results holds `captures/NAME/` for every capture that was measured, with what
//! [`crate::outputs`] leaves and a `batch.json` on top, and `materials.csv`, `status.csv` and
//! `report.html` of all. A capture's folder is filled elsewhere and moved into place whole, and the
//! tables are made from what stands in the folders: so a batch that was killed and gone on with
//! leaves the bytes of one that was not. A lock keeps two batches apart; it is the operating
//! system's, which takes it back from a process that dies.

mod document;
mod list;
mod record;
mod room;
mod summary;

pub use document::Document;
pub use list::{List, Listed};

use crate::capture::{self, Loaded};
use crate::error::{Blame, Error, Kind, Result};
use crate::fit_json::FitSummary;
use crate::measure::{Choices, Measurement, measure};
use crate::monitor::{Monitor, Quiet};
use crate::{library, outputs};
use physics::Material;
use record::Record;
use room::Room;
use std::any::Any;
use std::fs::{self, File, TryLockError};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Where the captures' folders stand.
const CAPTURES: &str = "captures";
/// Where the lock is, and what is on its way.
const HIDDEN: &str = ".beamspot-batch";
/// The lock, there.
const LOCK: &str = "lock";

/// How a batch is run.
#[derive(Clone, Debug)]
pub struct Options {
    /// How each capture is measured.
    pub choices: Choices,
    /// Whether what a former batch has finished stays as it is.
    pub resume: bool,
    /// Whether what stands in the folder is replaced.
    pub force: bool,
}

/// What a batch leaves.
#[derive(Clone, Debug)]
pub struct Batch {
    /// What became of each capture, in the order of the list.
    pub captures: Vec<Outcome>,
}

/// What became of one capture.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Its name in the batch.
    pub name: String,
    /// The name of its material, where the manifest could be read.
    pub material: Option<String>,
    /// What it gave, or why it gave nothing.
    pub found: std::result::Result<Found, Failure>,
}

/// What a capture gave.
#[derive(Clone, Debug)]
pub struct Found {
    /// Its `fit.json`, in short.
    pub fit: FitSummary,
    /// Its `materials.csv`.
    pub materials: Vec<Material>,
    /// Whether it had been measured before.
    pub stood: bool,
}

/// Why a capture gave nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// Whose trouble it is: [`Kind::Fault`], or the input's.
    pub kind: Kind,
    /// In a sentence; files are named from the capture's folder on.
    pub error: String,
}

impl Failure {
    /// Its name in `status.csv`.
    pub fn state(&self) -> &'static str {
        match self.kind {
            Kind::Fault => "fault",
            _ => "failed",
        }
    }
}

impl Batch {
    /// How many captures gave nothing.
    pub fn failed(&self) -> usize {
        self.captures.iter().filter(|c| c.found.is_err()).count()
    }

    /// How many had been measured before.
    pub fn stood(&self) -> usize {
        let found = self.captures.iter().filter_map(|c| c.found.as_ref().ok());
        found.filter(|found| found.stood).count()
    }

    /// An error that says how many captures gave nothing, if some did.
    ///
    /// # Errors
    ///
    /// [`Kind::Partial`], after everything has been written.
    pub fn complete(&self) -> Result<()> {
        let (failed, all) = (self.failed(), self.captures.len());
        if failed == 0 {
            return Ok(());
        }
        let message = format!(
            "{failed} of {all} captures were not measured, and the others are written: status.csv \
             says why; mend them and make the same call with --resume"
        );
        Err(Error::new(Kind::Partial, message))
    }
}

/// Measures every capture of `list` into `folder`.
///
/// Captures are measured side by side, as many as there are threads and as the memory for their
/// pictures allows. One that fails, or makes beamspot itself fail, is a row of `status.csv`.
///
/// # Errors
///
/// The call does not make sense, something is in the way, another batch writes to the folder, the
/// disk is full ([`Error::no_room`]) or the user interrupts; what was finished by then stays.
pub fn run(list: &List, folder: &Path, options: &Options, monitor: &dyn Monitor) -> Result<Batch> {
    run_by(list, folder, options, monitor, &measure)
}

/// A batch whose captures others measure, on this machine or on many: the folder, with its lock, and
/// the tables at the end.
#[derive(Debug)]
pub struct Open {
    place: Place,
    captures: Vec<Listed>,
}

/// What became of one capture of an [`Open`] batch; what was found stands in its folder.
#[derive(Clone, Debug)]
pub struct Report {
    /// The name of its material, where the manifest could be read.
    pub material: Option<String>,
    /// Why there is nothing in its folder, or whether that had been measured before.
    pub stood: std::result::Result<bool, Failure>,
}

impl Open {
    /// Opens `folder` for the captures of `list`, as [`run`] does.
    ///
    /// # Errors
    ///
    /// As those of [`run`], before the first capture.
    pub fn new(list: &List, folder: &Path, options: &Options) -> Result<Self> {
        library::named(&options.choices.model.name)?;
        Ok(Self {
            place: Place::open(folder, list, options)?,
            captures: list.captures.clone(),
        })
    }

    /// The captures to be measured by [`capture()`].
    pub fn captures(&self) -> &[Listed] {
        &self.captures
    }

    /// Writes the tables and the page of all, from what stands in the captures' folders.
    ///
    /// # Errors
    ///
    /// There are fewer reports than captures, or more; a folder does not hold what its report says;
    /// the tables cannot be written.
    pub fn finish(&self, reports: Vec<Report>) -> Result<Batch> {
        if reports.len() != self.captures.len() {
            let message = format!(
                "{} reports of {} captures",
                reports.len(),
                self.captures.len()
            );
            return Err(Error::new(Kind::Fault, message));
        }
        let outcome = |(listed, report): (&Listed, Report)| {
            let found = match report.stood {
                Ok(stood) => Ok(found(&self.place.captures.join(&listed.name), stood)?),
                Err(failure) => Err(failure),
            };
            Ok(Outcome {
                name: listed.name.clone(),
                material: report.material,
                found,
            })
        };
        let captures = self.captures.iter().zip(reports).map(outcome);
        let batch = Batch {
            captures: captures.collect::<Result<_>>()?,
        };
        self.place.summarise(&batch)?;
        Ok(batch)
    }
}

/// Measures one capture of the batch that is [`Open`] in `folder`, here or on another machine, unless
/// it stands there.
///
/// # Errors
///
/// No batch is open there, the disk is full or the user interrupts; anything else is the capture's
/// own, and in the report.
pub fn capture(
    folder: &Path,
    listed: &Listed,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Report> {
    let place = Place::join(folder)?;
    // A scheduler runs it once more when the machine that did it dies, also while its batch comes to an
    // end, and others read: what stands is then left as it is.
    let again = Options {
        resume: true,
        ..options.clone()
    };
    let outcome = place.capture(listed, &again, &Room::default(), &Quiet(monitor), &measure)?;
    Ok(Report {
        material: outcome.material,
        stood: outcome.found.map(|found| found.stood && options.resume),
    })
}

/// What measures one capture.
type Measure<'a> = dyn Fn(&Loaded, &Choices, &dyn Monitor) -> Result<Measurement> + Sync + 'a;

fn run_by(
    list: &List,
    folder: &Path,
    options: &Options,
    monitor: &dyn Monitor,
    by: &Measure,
) -> Result<Batch> {
    library::named(&options.choices.model.name)?;
    let place = Place::open(folder, list, options)?;
    let count = list.captures.len();
    monitor.begin("measuring", count as u64);
    let outcomes: Vec<OnceLock<Outcome>> = (0..count).map(|_| OnceLock::new()).collect();
    let next = AtomicUsize::new(0);
    let end: OnceLock<Error> = OnceLock::new();
    let room = Room::default();
    let work = || {
        while end.get().is_none() && !monitor.stopped() {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(listed) = list.captures.get(index) else {
                return;
            };
            match place.capture(listed, options, &room, &Quiet(monitor), by) {
                Ok(outcome) => {
                    let _ = outcomes[index].set(outcome);
                    monitor.step();
                }
                // One full disk is reported once.
                Err(error) => {
                    let _ = end.set(error);
                }
            }
        }
    };
    // Threads of their own, and not those of the pool: while one of those waits for a part of its
    // capture it may take up whatever waits, a whole other capture as well, and then there are more
    // pictures in memory than anybody counted.
    std::thread::scope(|scope| {
        for _ in 0..rayon::current_num_threads().min(count) {
            scope.spawn(work);
        }
    });
    let captures: Vec<Outcome> = outcomes
        .into_iter()
        .filter_map(OnceLock::into_inner)
        .collect();
    if captures.len() < count || monitor.stopped() {
        let done = captures.iter().filter(|c| c.found.is_ok()).count();
        let message = format!(
            "{done} of {count} captures are measured, in {}; the same call with --resume goes on \
             from there",
            folder.join(CAPTURES).display()
        );
        return Err(match end.into_inner() {
            Some(error) if error.kind() != Kind::Interrupted => {
                error.within(format!("{message}, once there is room"))
            }
            _ => Error::new(Kind::Interrupted, format!("interrupted: {message}")),
        });
    }
    let batch = Batch { captures };
    place.summarise(&batch)?;
    Ok(batch)
}

/// The folder of a batch, and the right to write there.
#[derive(Debug)]
struct Place {
    folder: PathBuf,
    /// The captures' folders as the machine knows them.
    captures: PathBuf,
    /// Given back when it is closed, by the operating system if need be; [`None`] where another
    /// process holds it for this one.
    _lock: Option<File>,
}

impl Place {
    fn open(folder: &Path, list: &List, options: &Options) -> Result<Self> {
        let place = folder.display();
        if folder.exists() && !folder.is_dir() {
            let message = format!("{place}: a file stands where a folder should");
            return Err(Error::new(Kind::Input, message));
        }
        let hidden = folder.join(HIDDEN);
        let lock = hidden.join(LOCK);
        let writing = || format!("writing {}", lock.display());
        // What no batch has left is nobody's to go on with.
        let resumes = options.resume && lock.exists();
        if !resumes && !options.force {
            refuse_existing(folder, options.resume)?;
        }
        fs::create_dir_all(&hidden).fault(writing())?;
        let file = File::options()
            .create(true)
            .append(true)
            .open(&lock)
            .fault(writing())?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let message = format!(
                    "{place}: another batch is writing to this folder; wait until it is done, or \
                     choose another folder"
                );
                return Err(Error::new(Kind::Input, message));
            }
            Err(TryLockError::Error(error)) => {
                return Err(error).fault(format!(
                    "{}: cannot be locked, so that another batch could write to the same folder; \
                     choose one on a local disk",
                    lock.display()
                ));
            }
        }
        let captures = folder.join(CAPTURES);
        fs::create_dir_all(&captures).fault(format!("writing {}", captures.display()))?;
        let place = Self {
            captures: captures.canonicalize().fault(captures.display())?,
            folder: folder.to_owned(),
            _lock: Some(file),
        };
        place.refuse_inputs(list)?;
        // What a batch that was killed had on its way.
        place.clear()?;
        Ok(place)
    }

    /// The folder of a batch that another process has opened.
    fn join(folder: &Path) -> Result<Self> {
        let captures = folder.join(CAPTURES);
        if !folder.join(HIDDEN).join(LOCK).exists() || !captures.is_dir() {
            let message = format!(
                "{}: no batch is open in this folder; it has to be on a disk that all machines see \
                 under this name",
                folder.display()
            );
            return Err(Error::new(Kind::Input, message));
        }
        Ok(Self {
            captures: captures.canonicalize().fault(captures.display())?,
            folder: folder.to_owned(),
            _lock: None,
        })
    }

    /// Refuses lists and manifests that would be written over.
    fn refuse_inputs(&self, list: &List) -> Result<()> {
        let manifests = list.captures.iter().map(|listed| &listed.manifest);
        for input in manifests.chain(&list.lists) {
            let Ok(found) = input.canonicalize() else {
                continue;
            };
            let summary = summary::NAMES.iter().any(|name| {
                let target = self.folder.join(name).canonicalize();
                target.is_ok_and(|target| target == found)
            });
            if summary || found.starts_with(&self.captures) {
                return Err(is_input(input));
            }
        }
        Ok(())
    }

    /// Where what is on its way stands.
    fn stages(&self) -> PathBuf {
        self.folder.join(HIDDEN).join("new")
    }

    fn clear(&self) -> Result<()> {
        let path = self.stages();
        match fs::remove_dir_all(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(error).fault(format!("removing {}", path.display()))
            }
            _ => Ok(()),
        }
    }

    /// Measures one capture, unless it stands.
    ///
    /// An error is none of the capture's own: it ends the batch.
    fn capture(
        &self,
        listed: &Listed,
        options: &Options,
        room: &Room,
        monitor: &dyn Monitor,
        by: &Measure,
    ) -> Result<Outcome> {
        let mut material = None;
        let found = catch_unwind(AssertUnwindSafe(|| {
            let loaded = capture::load(&listed.manifest)?;
            material = Some(loaded.capture.material.clone());
            self.loaded(&listed.name, &loaded, options, room, monitor, by)
        }));
        let found = found.unwrap_or_else(|panic| {
            let message = format!("a fault of beamspot, please report it: {}", said(&*panic));
            Err(Error::new(Kind::Fault, message))
        });
        let found = match found {
            Ok(found) => Ok(found),
            Err(error) if error.kind() == Kind::Interrupted || error.no_room() => {
                return Err(error);
            }
            Err(error) => {
                let mut text = without_folder(&error.to_string(), &listed.manifest);
                if self.captures.join(&listed.name).exists() {
                    text.push_str("; what stands in its folder was measured before");
                }
                Err(Failure {
                    kind: error.kind(),
                    error: text,
                })
            }
        };
        Ok(Outcome {
            name: listed.name.clone(),
            material,
            found,
        })
    }

    fn loaded(
        &self,
        name: &str,
        loaded: &Loaded,
        options: &Options,
        room: &Room,
        monitor: &dyn Monitor,
        by: &Measure,
    ) -> Result<Found> {
        let Options {
            ref choices,
            resume,
            ..
        } = *options;
        let target = self.captures.join(name);
        if resume && target.join(record::NAME).exists() {
            let fingerprint = record::fingerprint(loaded, choices, &[])?;
            if Record::stands(&target, &fingerprint) {
                return found(&target, true);
            }
        }
        for input in loaded.paths() {
            if input
                .canonicalize()
                .is_ok_and(|i| i.starts_with(&self.captures))
            {
                return Err(is_input(&input));
            }
        }
        let _room = room.take(loaded);
        monitor.check()?;
        let place = || {
            format!(
                "writing {}",
                self.folder.join(CAPTURES).join(name).display()
            )
        };
        fs::create_dir_all(self.stages()).fault(place())?;
        // A folder of its own, which goes whatever becomes of the capture: of many machines two may
        // measure the same one, where the first was taken for lost.
        let own = tempfile::tempdir_in(self.stages()).fault(place())?;
        let stage = own.path().join(name);
        let files = outputs::open(loaded, &stage, false)?;
        let measurement = by(loaded, choices, monitor)?;
        outputs::write(files, loaded, &measurement)?;
        // Of the bytes that were measured, were they to change meanwhile.
        let fingerprint = record::fingerprint(loaded, choices, &measurement.radiance.inputs)?;
        let record = Record::of(&stage, fingerprint.clone())?;
        let record = record.to_json().fault(place())?;
        fs::write(stage.join(record::NAME), record).fault(place())?;
        let moved = match fs::rename(&target, own.path().join("old")) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(error),
            _ => fs::rename(&stage, &target),
        };
        if let Err(error) = moved
            && !Record::stands(&target, &fingerprint)
        {
            return Err(error).fault(place());
        }
        found(&target, false)
    }

    /// Writes the tables and the page of all.
    fn summarise(&self, batch: &Batch) -> Result<()> {
        let stage = self.stages().join("summary");
        fs::create_dir_all(&stage).fault(format!("writing {}", stage.display()))?;
        summary::write(batch, &stage)?;
        for name in summary::NAMES {
            let target = self.folder.join(name);
            fs::rename(stage.join(name), &target).fault(format!("writing {}", target.display()))?;
        }
        self.clear()
    }
}

/// Refuses a folder with results in it.
fn refuse_existing(folder: &Path, resume: bool) -> Result<()> {
    let captures = folder.join(CAPTURES);
    let filled = |path: &Path| {
        fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_some()) || path.is_file()
    };
    let in_the_way = summary::NAMES.map(|name| folder.join(name)).into_iter();
    let Some(found) = in_the_way.chain([captures]).find(|path| filled(path)) else {
        return Ok(());
    };
    let way = if resume {
        "no batch has left it, so that --resume cannot go on with it"
    } else {
        "go on with it by --resume"
    };
    let message = format!(
        "{}: exists; {way}; choose another folder, or replace it with --force",
        found.display()
    );
    Err(Error::new(Kind::Input, message))
}

fn is_input(path: &Path) -> Error {
    let message = format!(
        "{}: is an input, and would be written over; choose another output",
        path.display()
    );
    Error::new(Kind::Input, message)
}

/// What `folder` holds of a finished capture. All tables are made from files, those of captures just
/// measured too: nothing can come out otherwise than after a kill.
fn found(folder: &Path, stood: bool) -> Result<Found> {
    let path = folder.join("fit.json");
    let text = fs::read(&path).fault(path.display())?;
    let fit = FitSummary::read(&text).fault(path.display())?;
    let path = folder.join("materials.csv");
    let text = fs::read(&path).fault(path.display())?;
    let materials = formats::materials_csv::read(&text[..]).fault(path.display())?;
    Ok(Found {
        fit,
        materials,
        stood,
    })
}

/// What a panic had to say.
fn said(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or(panic.downcast_ref::<&str>().copied())
        .unwrap_or("it does not say where")
}

/// `text` with files named from the folder of `manifest` on, wherever that stands on this machine.
fn without_folder(text: &str, manifest: &Path) -> String {
    let folder = manifest.parent().unwrap_or(Path::new(""));
    if folder.as_os_str().is_empty() {
        return text.to_owned();
    }
    let start = format!("{}{}", folder.display(), std::path::MAIN_SEPARATOR);
    let mut short = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find(&start) {
        let (before, after) = rest.split_at(at);
        short.push_str(before);
        // The end of a longer path is another path.
        let longer = short.ends_with(|c: char| c.is_alphanumeric() || "/\\-_.".contains(c));
        if longer {
            short.push_str(&start);
        }
        rest = &after[start.len()..];
    }
    short + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::ModelChoice;
    use crate::monitor::Silent;
    use crate::synthesis;
    use std::io;

    /// Small captures of marble in folders `0`, `1`, ….
    fn captures(folder: &Path, count: u64) -> List {
        let mut marble = synthesis::sample_of("Marble").unwrap();
        marble.channels.truncate(1);
        let camera = synth::Camera {
            width: 96,
            height: 96,
            mm_per_pixel: 0.4,
            beam_fwhm_mm: 1.0,
            channels: synth::Channels::Mono,
            exposures_s: vec![0.001, 0.03, 1.0],
            ..synth::Camera::default()
        };
        let paths = (0..count).map(|seed| {
            let to = folder.join(seed.to_string());
            let model = ModelChoice::default();
            synthesis::write(&marble, camera.clone(), &model, seed, &to, false, &Silent).unwrap()
        });
        List::read(&paths.collect::<Vec<_>>()).unwrap()
    }

    fn options(resume: bool) -> Options {
        let choices = Choices {
            confirm: false,
            ..Choices::default()
        };
        Options {
            choices,
            resume,
            force: false,
        }
    }

    /// Name and bytes of every file below `folder`, and the names of folders, hidden ones as well.
    fn bytes(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
        let mut found = vec![];
        let mut open = vec![folder.to_owned()];
        while let Some(next) = open.pop() {
            for entry in fs::read_dir(next).unwrap() {
                let path = entry.unwrap().path();
                let name = path.strip_prefix(folder).unwrap().to_owned();
                if path.is_dir() {
                    open.push(path);
                    found.push((name, vec![]));
                } else {
                    found.push((name, fs::read(path).unwrap()));
                }
            }
        }
        found.sort();
        found
    }

    #[test]
    fn neither_a_panic_nor_a_full_disk_costs_a_result() {
        let here = tempfile::tempdir().unwrap();
        let list = captures(here.path(), 3);
        let whole = here.path().join("whole");
        run(&list, &whole, &options(false), &Silent).unwrap();
        let folder = here.path().join("results");
        let in_second = |loaded: &Loaded| loaded.folder.ends_with("1");

        let panics = |loaded: &Loaded, choices: &Choices, monitor: &dyn Monitor| {
            assert!(!in_second(loaded), "an index out of reach");
            measure(loaded, choices, monitor)
        };
        let batch = run_by(&list, &folder, &options(false), &Silent, &panics).unwrap();
        let failure = batch.captures[1].found.as_ref().unwrap_err();
        assert_eq!(failure.state(), "fault");
        assert!(
            failure.error.contains("an index out of reach"),
            "{failure:?}"
        );
        assert_eq!((batch.failed(), batch.stood()), (1, 0));
        let error = batch.complete().unwrap_err();
        assert_eq!(error.kind(), Kind::Partial);
        assert!(error.to_string().contains("1 of 3 captures"), "{error}");

        let full = |loaded: &Loaded, choices: &Choices, monitor: &dyn Monitor| {
            if in_second(loaded) {
                let full: io::Result<()> = Err(io::ErrorKind::StorageFull.into());
                full.fault("writing somewhere")?;
            }
            measure(loaded, choices, monitor)
        };
        let error = run_by(&list, &folder, &options(true), &Silent, &full).unwrap_err();
        assert!(error.no_room() && error.kind() == Kind::Fault, "{error}");
        assert!(error.to_string().contains("--resume"), "{error}");

        let never = |loaded: &Loaded, choices: &Choices, monitor: &dyn Monitor| {
            assert!(in_second(loaded), "what is done is not done again");
            measure(loaded, choices, monitor)
        };
        let batch = run_by(&list, &folder, &options(true), &Silent, &never).unwrap();
        assert_eq!((batch.failed(), batch.stood()), (0, 2));
        assert!(bytes(&folder) == bytes(&whole));
    }

    #[test]
    fn captures_that_others_measure_leave_the_same_bytes_even_twice_at_once() {
        let here = tempfile::tempdir().unwrap();
        let mut list = captures(here.path(), 2);
        list.captures.push(Listed {
            name: "none".to_owned(),
            manifest: here.path().join("none.toml"),
        });
        let whole = here.path().join("whole");
        run(&list, &whole, &options(false), &Silent).unwrap();
        let folder = here.path().join("results");
        let options = options(false);
        let listed = &list.captures[0];
        let error = capture(&folder, listed, &options, &Silent).unwrap_err();
        assert!(error.to_string().contains("no batch is open"), "{error}");
        let open = Open::new(&list, &folder, &options).unwrap();
        let error = Open::new(&list, &folder, &options).unwrap_err();
        assert!(error.to_string().contains("another batch"), "{error}");
        // One that was taken for lost goes on beside the one that took its place.
        let reports = std::thread::scope(|scope| {
            let work = || capture(&folder, listed, &options, &Silent).unwrap();
            let lost = scope.spawn(work);
            let each = open.captures().iter();
            let reports = each.map(|c| capture(&folder, c, &options, &Silent).unwrap());
            let reports: Vec<Report> = reports.collect();
            assert_eq!(lost.join().unwrap().stood, Ok(false));
            reports
        });
        // One that is run again, since the machine of the first died, leaves what stands as it is.
        let written = || {
            fs::metadata(folder.join("captures/0/fit.json"))
                .unwrap()
                .modified()
        };
        let before = written().unwrap();
        let again = capture(&folder, listed, &options, &Silent).unwrap();
        assert_eq!((again.stood, written().unwrap()), (Ok(false), before));
        let batch = open.finish(reports).unwrap();
        assert_eq!((batch.failed(), batch.stood()), (1, 0));
        drop(open);
        assert!(bytes(&folder) == bytes(&whole));
    }

    #[test]
    fn what_stands_is_what_was_chosen_and_what_was_written() {
        let here = tempfile::tempdir().unwrap();
        let list = captures(here.path(), 1);
        let folder = here.path().join("results");
        let stood = |options: &Options| {
            let batch = run(&list, &folder, options, &Silent).unwrap();
            batch.captures[0].found.as_ref().unwrap().stood
        };
        assert!(!stood(&options(false)));
        assert!(stood(&options(true)));
        // Other settings, a page that was touched, a dark that was taken again.
        let mut other = options(true);
        other.choices.range_mm = Some((1.0, 15.0));
        assert!(!stood(&other));
        assert!(stood(&other));
        fs::write(folder.join("captures/0/report.html"), "").unwrap();
        assert!(!stood(&other));
        let dark = here.path().join("0/sample/dark_01.tif");
        let mut frame = fs::read(&dark).unwrap();
        // One sample by one count.
        let middle = frame.len() / 4 * 2;
        frame[middle] ^= 1;
        fs::write(&dark, frame).unwrap();
        assert!(!stood(&other));
        assert!(stood(&other));
    }

    #[test]
    fn paths_in_errors_begin_at_the_folder_of_the_capture() {
        let manifest = Path::new("a/capture.toml");
        let text = "a/capture.toml: field: data/x.tif and `a/b.tif` (a/c)";
        assert_eq!(
            without_folder(text, manifest),
            "capture.toml: field: data/x.tif and `b.tif` (c)"
        );
        assert_eq!(without_folder(text, Path::new("capture.toml")), text);
    }
}
