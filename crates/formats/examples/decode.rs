//! Reads and decodes frames and does nothing with them: the limit of every merge.
//!
//!     cargo run --release -p beamspot-formats --example decode -- THREADS FILE...
#![expect(clippy::print_stdout, reason = "an example prints")]

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let threads: usize = arguments
        .next()
        .and_then(|threads| threads.parse().ok())
        .expect("the number of threads, then files");
    let files: Vec<String> = arguments.collect();
    let (next, samples) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let clock = Instant::now();
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(file) = files.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let bytes = std::fs::read(file).expect("a file that can be read");
                    let decoded = formats::decode_frame(&bytes).expect("a frame");
                    samples.fetch_add(decoded.frame.samples.len(), Ordering::Relaxed);
                }
            });
        }
    });
    let seconds = clock.elapsed().as_secs_f64();
    let rate = samples.into_inner() as f64 / seconds / 1e6;
    println!("{seconds:.3} s, {rate:.0} million samples per second");
}
