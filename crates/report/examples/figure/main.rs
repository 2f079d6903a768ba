//! Writes the figures and the page of three synthetic materials into the folder given as argument.

mod synthetic;

use fit::Constraint;
use physics::Coefficients;
use report::{Input, Report, figure_svg, report_html};
use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("usage: figure FOLDER")?);
    std::fs::create_dir_all(&folder)?;
    for (material, eta, rgb) in [
        (
            "Marble",
            1.5,
            [(2.19, 0.0021), (2.62, 0.0041), (3.00, 0.0071)],
        ),
        ("Spectralon", 1.3, [(11.6, 0.0), (20.4, 0.0), (14.9, 0.0)]),
        ("Ketchup", 1.3, [(0.18, 0.061), (0.07, 0.97), (0.03, 1.45)]),
    ] {
        let mut channels = vec![];
        for (i, (name, (sigma_s_prime, sigma_a))) in
            ["R", "G", "B"].into_iter().zip(rgb).enumerate()
        {
            let truth = Coefficients {
                sigma_a,
                sigma_s_prime,
            };
            channels.push(synthetic::channel(name, truth, eta, i as u64)?);
        }
        let report = Report {
            material,
            eta,
            u_eta: 0.01,
            model: "dipole",
            constraint: Constraint::Joint,
            channels: channels.iter().map(|c| c.report()).collect(),
            warnings: vec![],
            assumptions: vec![
                "The white reference was taken as an ideal surface: its own coefficients are not \
                 given."
                    .to_owned(),
                "u_eta was taken as 0.01.".to_owned(),
            ],
            comparison: vec![],
            verdict: vec![],
            confirmation: vec![],
            beam: vec![],
            merge: vec!["13 of 13 frames were used, from 0.001 s to 4 s.".to_owned()],
            exposures: vec![],
            pictures: vec![],
            swatch: Err("these are invented".to_owned()),
            tool: "beamspot 0.1.0",
            settings: vec![],
            inputs: vec![Input {
                name: "sample_01.tif".to_owned(),
                blake3: "af1349b9f5f9a1a6a0404dea36dcc9499bcb25c9adc112b7cc9a93cae41f3262"
                    .to_owned(),
            }],
        };
        for channel in &report.channels {
            let file = format!("{}-{}.svg", material.to_lowercase(), channel.fit.channel);
            std::fs::write(folder.join(file), figure_svg(material, channel))?;
        }
        let file = format!("{}.html", material.to_lowercase());
        std::fs::write(folder.join(file), report_html(&report))?;
    }
    Ok(())
}
