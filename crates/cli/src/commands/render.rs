//! `beamspot render`

use super::print;
use crate::args::{Common, RenderArgs};
use pipeline::rendering::{PictureFiles, load, render};
use pipeline::{Error, Kind, Monitor, Result};
use report::{text_table, uncertain};
use std::io::Write;

/// Makes a picture of a scene and prints where its light went.
pub(crate) fn run(
    args: &RenderArgs,
    common: Common,
    monitor: &dyn Monitor,
    out: &mut impl Write,
) -> Result<()> {
    let options = args.options()?;
    let files = PictureFiles::new(&args.output, args.resume)?;
    let loaded = load(&args.scene)?;
    for warning in &loaded.warnings {
        // Nobody is left to tell if standard error is closed.
        let _ = writeln!(std::io::stderr(), "beamspot: {warning}");
    }
    let outputs = files.open(&loaded.inputs, common.force)?;
    let before = files.before(&loaded, &options)?;
    let picture = render(&loaded, &options, before, monitor)?;
    let interrupted = monitor.stopped();
    let outcome = files.write(outputs, &loaded, &options, &picture, interrupted)?;
    for warning in outcome.warnings.iter().skip(loaded.warnings.len()) {
        let _ = writeln!(std::io::stderr(), "beamspot: {warning}");
    }
    if common.json {
        print::json(out, &outcome)?;
    } else {
        if !outcome.faces.is_empty() {
            let rows: Vec<Vec<String>> = outcome
                .faces
                .iter()
                .map(|f| {
                    let power = uncertain(f.power.value, f.power.u);
                    vec![
                        f.object.clone(),
                        f.face.to_owned(),
                        f.channel.clone(),
                        power,
                    ]
                })
                .collect();
            let head = ["object", "face", "channel", "power out, W"];
            print::line(out, text_table(&head, &rows).trim_end())?;
        }
        let error = if outcome.relative_error.is_finite() {
            let percent = 100.0 * outcome.relative_error;
            format!("rms error {percent:.3} % of the mean pixel")
        } else {
            "an error that one round does not tell".to_owned()
        };
        print::line(
            out,
            format!(
                "{}: {} rounds, {error}; PNG: radiance x {:.4e} through the sRGB curve; wrote {}",
                outcome.method,
                outcome.rounds,
                outcome.png_exposure,
                args.output.display()
            ),
        )?;
    }
    if interrupted {
        let message = format!(
            "interrupted; {} holds what was done, and --resume goes on with it",
            args.output.display()
        );
        return Err(Error::new(Kind::Interrupted, message));
    }
    Ok(())
}
