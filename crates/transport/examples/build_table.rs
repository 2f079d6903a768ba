//! Builds the table of the transport model, `data/transport.bin`.
//!
//! `cargo run --release -p beamspot-transport --example build_table -- data/transport.bin`

use std::error::Error;

#[expect(clippy::print_stderr, reason = "a build tool tells how far it is")]
fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args()
        .nth(1)
        .ok_or("the path of the table to write is missing")?;
    let mut told = 0;
    let bytes = transport::build(|done| {
        let percent = (100.0 * done) as u32;
        if percent > told {
            told = percent;
            eprintln!("{percent} %");
        }
    });
    std::fs::write(path, bytes)?;
    Ok(())
}
