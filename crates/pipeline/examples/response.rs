//! The response of a camera, from codes on standard input to a table on standard output.
//!
//! The first line holds the exposure times, s, separated by commas; every other line the codes of
//! one pixel at these exposures.

use hdr::response;
use std::error::Error;
use std::io::{self, Write};

fn main() -> Result<(), Box<dyn Error>> {
    let text = io::read_to_string(io::stdin())?;
    let (exposures, pixels) = text
        .split_once('\n')
        .ok_or("expected exposures, then codes")?;
    let exposures: Vec<f64> = exposures
        .split(',')
        .map(|time| time.trim().parse())
        .collect::<Result<_, _>>()?;
    let codes: Vec<u8> = pixels
        .lines()
        .flat_map(|line| line.split(','))
        .map(|code| code.trim().parse())
        .collect::<Result<_, _>>()?;
    let found = response::recover(&codes, &exposures)?;
    let mut out = io::stdout().lock();
    writeln!(out, "code,ln_exposure,u_ln_exposure")?;
    for (code, (value, u)) in found.ln_exposure.iter().zip(&found.u).enumerate() {
        writeln!(out, "{code},{value},{u}")?;
    }
    Ok(())
}
