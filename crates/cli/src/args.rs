//! What was typed.

use clap::{Args, Parser, Subcommand, ValueEnum};
use pipeline::export::Target;
use pipeline::measure::Choices;
use pipeline::rendering::{BssrdfModel, MethodChoice, RenderOptions};
use pipeline::{Error, Kind};
use render::bssrdf::Sampling;
use render::{Gather, Kind as BrdfKind};
use std::path::PathBuf;

/// Recovers the absorption and reduced scattering coefficients of translucent materials from
/// photographs of a beam spot.
///
/// Lengths are mm, coefficients mm^-1. Exit code 0 done, 1 a fault of ours, 2 wrong usage,
/// 3 the input cannot be used, 4 a bad verdict with --strict, 5 part of a batch failed,
/// 130 interrupted.
#[derive(Debug, Parser)]
#[command(
    name = "beamspot",
    version,
    propagate_version = true,
    after_help = "Example:\n  beamspot demo\n  beamspot measure capture/capture.toml -o result"
)]
pub(crate) struct Cli {
    #[command(flatten)]
    pub(crate) common: Common,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Options of every command.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Common {
    /// Print one JSON document on standard output and nothing else.
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Replace outputs that exist (never an input).
    #[arg(long, global = true)]
    pub(crate) force: bool,
    /// Worker threads; every processor by default. Results do not depend on it.
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) threads: Option<u16>,
    /// Whether a person looks at standard output.
    #[arg(skip)]
    pub(crate) on_screen: bool,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// The whole job with nothing given: a synthetic capture of marble, measured from its files.
    Demo(DemoArgs),
    /// A synthetic capture: frames, darks, reference, capture.toml and truth.json.
    Synth(SynthArgs),
    /// A capture.toml to be filled in, from a folder of frames.
    Init(InitArgs),
    /// The main job: frames to materials.
    Measure(MeasureArgs),
    /// Many captures: goes on after a failure or a kill, and collects one table and one page.
    Batch(BatchArgs),
    /// Merges the frames of a capture into one radiance map.
    Hdr(HdrArgs),
    /// Radial profile and total of a capture or a radiance map.
    Profile(ProfileArgs),
    /// Centre and d4sigma width of a beam, after ISO 11146: in a frame, or on the white of a capture.
    Beam(BeamArgs),
    /// Fits the coefficients to a radial profile.
    Fit(FitArgs),
    /// Layered photon Monte Carlo.
    Simulate(SimulateArgs),
    /// BRDF and BTDF of layers: first order, Monte Carlo by order, adding-doubling.
    Brdf(BrdfArgs),
    /// Validation renderer: a scene by volume transport, a BSSRDF or a BRDF.
    Render(RenderArgs),
    /// A scene by every method, and how far the models are from transport.
    Validate(ValidateArgs),
    /// How far two pictures, profiles or material tables are apart.
    Compare(CompareArgs),
    /// Integrating-sphere reflectance and transmittance to sigma_a, sigma_s and g.
    Sphere(SphereArgs),
    /// The papers' figures, computed.
    Figures(FiguresArgs),
    /// Material tables.
    #[command(
        subcommand,
        after_help = "Example:\n  beamspot table show result/materials.csv"
    )]
    Table(TableCommand),
    /// Version, features, the instructions that are taken, and whether all of it works here.
    #[command(after_help = "Examples:\n  beamspot doctor\n  beamspot doctor --json")]
    Doctor,
    /// Prints the script that lets a shell complete commands and flags.
    Completions(CompletionsArgs),
    /// Writes the pages of the manual, one for each command.
    Man(ManArgs),
}

#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  beamspot completions bash > ~/.local/share/bash-completion/completions/beamspot\n  beamspot completions zsh > ~/.zfunc/_beamspot\n  beamspot completions fish > ~/.config/fish/completions/beamspot.fish"
)]
pub(crate) struct CompletionsArgs {
    /// Which shell.
    #[arg(value_enum)]
    pub(crate) shell: clap_complete::Shell,
}

#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  beamspot man -o ~/.local/share/man/man1\n  man beamspot-measure"
)]
pub(crate) struct ManArgs {
    /// Folder to write.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
}

#[derive(Args, Debug)]
#[command(after_help = "Example:\n  beamspot demo -o demo")]
pub(crate) struct DemoArgs {
    /// Folder to write; a fresh one beside you when left out.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
}

#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  beamspot synth --material marble --seed 7 -o capture\n  beamspot measure capture/capture.toml -o result"
)]
pub(crate) struct SynthArgs {
    /// A material of Jensen's table (`beamspot table show` lists them).
    #[arg(
        long,
        value_name = "NAME",
        required_unless_present = "medium",
        conflicts_with = "medium"
    )]
    pub(crate) material: Option<String>,
    /// A file with material, eta and coefficients of each channel.
    #[arg(long, value_name = "FILE")]
    pub(crate) medium: Option<PathBuf>,
    /// Model that makes the light: any that `fit` knows (monte-carlo needs --g), or render, the
    /// renderer's volume transport, with the noise of its photons.
    #[arg(long, default_value = "dipole", value_name = "MODEL")]
    pub(crate) model: String,
    /// Mean cosine of the scattering angle, for a model that uses it.
    #[arg(long, value_name = "G", allow_negative_numbers = true)]
    pub(crate) g: Option<f64>,
    /// Camera, beam and reference as TOML; a laboratory's by default.
    #[arg(long, value_name = "FILE")]
    pub(crate) camera: Option<PathBuf>,
    /// Effort of `--model render`: so many photons of each channel, as `render` counts them.
    #[arg(long, default_value = "1e6", value_name = "N", value_parser = photons)]
    pub(crate) photons: u64,
    /// Seed of every random number.
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub(crate) seed: u64,
    /// Folder to write.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
}

#[derive(Args, Debug)]
#[command(after_help = "Example:\n  beamspot init photographs")]
pub(crate) struct InitArgs {
    /// Folder of frames; names tell what they are: dark, white, ref, reference, spectralon.
    #[arg(value_name = "DIR")]
    pub(crate) folder: PathBuf,
}

/// How to fit.
#[derive(Args, Clone, Debug)]
pub(crate) struct FitChoice {
    /// Model: dipole (exact F_dr), jensen2001 (the paper's rational fit), better-dipole,
    /// kienle-patterson, photon-beam-diffusion (takes --g), multipole (a slab; needs a thickness),
    /// directional (an oblique beam), monte-carlo (the transport equation itself; takes --g), or
    /// all: the dipole, and beside it every model that applies.
    #[arg(long, default_value = "dipole", value_name = "MODEL")]
    pub(crate) model: String,
    /// Mean cosine of the scattering angle, for a model that uses it; monte-carlo fits it along
    /// if it is left out.
    #[arg(long, value_name = "G", allow_negative_numbers = true)]
    pub(crate) g: Option<f64>,
    /// Whether the error that a closed form has against transport is part of weights and
    /// uncertainties: true, unless the manifest says that the form itself made the light.
    #[arg(long, action = clap::ArgAction::Set, value_name = "BOOL")]
    pub(crate) discrepancy: Option<bool>,
    /// What the total reflectance does.
    #[arg(long, value_enum, default_value_t = ConstraintArg::Joint)]
    pub(crate) constraint: ConstraintArg,
    /// Whether the scale of profile and total is known, from the white reference within its u, or
    /// free: then the shape alone decides, and no reference matters.
    #[arg(long, value_enum, default_value_t = ScaleArg::Known)]
    pub(crate) scale: ScaleArg,
    /// Draw N replicas of every channel from what was found and what is uncertain, fit them, and
    /// set their spread beside the budget.
    #[arg(long, default_value_t = 0, value_name = "N", hide_default_value = true)]
    pub(crate) bootstrap: usize,
    /// Exit with 4 where the verdict on a channel is bad; everything is written all the same.
    #[arg(long)]
    pub(crate) strict: bool,
    /// First and last radius, mm; by default from 2/(sigma_a + sigma_s') outward, clear of the
    /// beam.
    #[arg(long, value_name = "MIN:MAX", value_parser = range)]
    pub(crate) range: Option<(f64, f64)>,
}

impl FitChoice {
    /// Whether the scale is free, unless the constraint contradicts it.
    pub(crate) fn free_scale(&self) -> pipeline::Result<bool> {
        let free = self.scale == ScaleArg::Free;
        if free && self.constraint == ConstraintArg::Exact {
            let message = "--constraint exact takes the scale as true, so that --scale free \
                           contradicts it: fit --constraint joint or none";
            return Err(Error::new(Kind::Usage, message));
        }
        Ok(free)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ScaleArg {
    /// As the white reference says, within its uncertainty.
    Known,
    /// Not known at all.
    Free,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ConstraintArg {
    /// The total is exact, as in the paper.
    Exact,
    /// The total is one more datum, and shares its scale with the profile.
    Joint,
    /// The profile alone.
    None,
}

#[derive(Args, Debug)]
#[command(after_help = "Example:\n  beamspot measure capture/capture.toml -o result")]
pub(crate) struct MeasureArgs {
    /// Manifests.
    #[arg(required = true, value_name = "CAPTURE.toml")]
    pub(crate) captures: Vec<PathBuf>,
    /// Folder to write; with several captures, one folder for each inside it.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) choice: MeasureChoice,
}

/// How to measure.
#[derive(Args, Clone, Debug)]
pub(crate) struct MeasureChoice {
    #[command(flatten)]
    pub(crate) fit: FitChoice,
    /// Leave out the Monte Carlo simulation of what was found.
    #[arg(long)]
    pub(crate) no_confirm: bool,
}

impl MeasureChoice {
    /// What was typed, checked.
    pub(crate) fn choices(&self) -> pipeline::Result<Choices> {
        Ok(Choices {
            model: self.fit.model(),
            discrepancy: self.fit.discrepancy,
            constraint: self.fit.constraint.into(),
            free_scale: self.fit.free_scale()?,
            range_mm: self.fit.range,
            compare: self.fit.compares(),
            bootstrap: self.fit.bootstrap,
            confirm: !self.no_confirm,
        })
    }
}

#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  beamspot batch 'series/*/capture.toml' -o results\n  beamspot batch series.txt -o results --resume\n\nseries.txt has a manifest or a pattern on each line, relative to its own folder; # begins a remark.\nExit code 5: some were not measured; status.csv says which and why, and the rest is there."
)]
pub(crate) struct BatchArgs {
    /// Manifests, patterns of them, or lists of either: files with one on each line.
    #[arg(required = true, value_name = "LIST|GLOB")]
    pub(crate) captures: Vec<PathBuf>,
    /// Folder to write: a folder for each capture below captures/, and one table and page of all.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Go on with what a batch into the same folder left undone: a capture whose manifest, files
    /// and settings are what they were, to the byte, is not measured again.
    #[arg(long)]
    pub(crate) resume: bool,
    #[command(flatten)]
    pub(crate) choice: MeasureChoice,
}

#[derive(Args, Debug)]
#[command(after_help = "Example:\n  beamspot hdr capture/capture.toml -o radiance.exr")]
pub(crate) struct HdrArgs {
    /// Manifest.
    #[arg(value_name = "CAPTURE.toml")]
    pub(crate) capture: PathBuf,
    /// File to write.
    #[arg(short, long, value_name = "RADIANCE.exr")]
    pub(crate) output: PathBuf,
}

#[derive(Args, Debug)]
#[command(after_help = "Example:\n  beamspot profile radiance.exr -o profile.csv")]
pub(crate) struct ProfileArgs {
    /// A manifest, or a radiance map that `beamspot hdr` wrote.
    #[arg(value_name = "CAPTURE.toml|RADIANCE.exr")]
    pub(crate) input: PathBuf,
    /// File to write; totals.csv goes beside it.
    #[arg(short, long, value_name = "PROFILE.csv")]
    pub(crate) output: PathBuf,
    /// The paper's one-dimensional slice through the spot instead of rings.
    #[arg(long)]
    pub(crate) slice: bool,
}

#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  beamspot beam beam.pgm\n  beamspot beam capture/capture.toml --json"
)]
pub(crate) struct BeamArgs {
    /// A frame, whose counts are taken as they are, or a manifest, whose white reference is merged.
    #[arg(value_name = "FRAME|CAPTURE.toml")]
    pub(crate) input: PathBuf,
}

#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  beamspot fit result/profile.csv --eta 1.5 --beam result/beam.csv\n  beamspot fit curve.csv --eta 1.4 --total G=0.79+-0.01 --u-scale 0.01 --range 1:15"
)]
pub(crate) struct FitArgs {
    /// The profile; totals.csv beside it is read unless --total is given.
    #[arg(value_name = "PROFILE.csv")]
    pub(crate) profile: PathBuf,
    /// Relative refractive index of the sample.
    #[arg(long, value_name = "X")]
    pub(crate) eta: f64,
    /// Total reflectance over the whole plane of one channel: G=0.79±0.01 (or +-).
    #[arg(long, value_name = "CHANNEL=R±U", value_parser = total)]
    pub(crate) total: Vec<TotalArg>,
    /// Relative standard uncertainty of the scale that profile and total share; that of
    /// totals.csv by default, 0 with --total.
    #[arg(long, value_name = "U")]
    pub(crate) u_scale: Option<f64>,
    /// Whether the beam lost its specular part on entry; false: the paper's mode.
    #[arg(long, default_value_t = true, action = clap::ArgAction::Set, value_name = "BOOL")]
    pub(crate) entry_loss: bool,
    /// Full width at half maximum of the Gaussian beam that the profile was taken with, mm; 0 for
    /// a point. Without it and --beam, a photographed profile is fitted well outside its spot.
    #[arg(long, value_name = "MM", value_parser = length, conflicts_with = "beam")]
    pub(crate) beam_fwhm: Option<f64>,
    /// The beam of each channel as `measure` found it on the white reference.
    #[arg(long, value_name = "BEAM.csv")]
    pub(crate) beam: Option<PathBuf>,
    /// Side of the camera's pixels on the sample, mm; 0 for a profile without pixels.
    #[arg(long, default_value_t = 0.0, value_name = "MM", value_parser = length)]
    pub(crate) mm_per_pixel: f64,
    /// Thickness of the sample, mm, for model multipole.
    #[arg(long, value_name = "MM", value_parser = length)]
    pub(crate) thickness: Option<f64>,
    /// Index of the sample over that of what lies below it, for model multipole; --eta by default,
    /// 1 for a matched lower boundary.
    #[arg(long, value_name = "X", requires = "thickness")]
    pub(crate) eta_below: Option<f64>,
    /// Angle between beam and normal, outside the sample, degrees.
    #[arg(long, default_value_t = 0.0, value_name = "DEG", value_parser = angle)]
    pub(crate) beam_angle: f64,
    /// How far from the point of entry, the way the beam travels, the profile has its centre, mm,
    /// for model directional.
    #[arg(
        long,
        default_value_t = 0.0,
        value_name = "MM",
        allow_negative_numbers = true
    )]
    pub(crate) center_offset: f64,
    /// File to write, as `measure` writes it.
    #[arg(short, long, value_name = "FIT.json")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) fit: FitChoice,
}

#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  beamspot simulate marble.toml -o marble --photons 1e7 --until-u 1e-4\n\nmarble.toml:\n  [[layer]]\n  sigma_a_per_mm = 0.0041\n  sigma_s_per_mm = 2.62\n  g = 0.0\n  eta = 1.5"
)]
pub(crate) struct SimulateArgs {
    /// Layers, beam and tallies.
    #[arg(value_name = "MEDIUM.toml")]
    pub(crate) medium: PathBuf,
    /// Folder to write. One that holds a run of the same medium, seed and path is continued.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Photons to follow in all, as 1000000 or 1e6.
    #[arg(long, default_value = "1e6", value_name = "N", value_parser = photons)]
    pub(crate) photons: u64,
    /// Stop earlier, once the standard error of reflectance and transmittance is below U.
    #[arg(long, value_name = "U")]
    pub(crate) until_u: Option<f64>,
    /// Seed of every random number.
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub(crate) seed: u64,
    /// Instruction path: portable, avx2 or avx512; the fastest of this machine by default. The
    /// same path gives the same bytes on any machine.
    #[arg(long, value_name = "PATH")]
    pub(crate) simd: Option<String>,
}

#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  beamspot render scenes/jensen8.toml -o cube.exr --rounds 64\n  beamspot render scenes/jensen9.toml -o bust.exr --method bssrdf --components"
)]
pub(crate) struct RenderArgs {
    /// Solids, lights and a camera; an object may have a `texture` (albedo, sigma_a_per_mm,
    /// sigma_s_per_mm or sigma_s_prime_per_mm as pictures), which models of the surface show.
    #[arg(value_name = "SCENE.toml")]
    pub(crate) scene: PathBuf,
    /// Picture to write, NAME.exr; NAME.png, NAME.json and NAME.state (for --resume) come beside it.
    #[arg(short, long, value_name = "NAME.exr")]
    pub(crate) output: PathBuf,
    /// How: volume transport, or a model of the surface.
    #[arg(long, value_enum, default_value_t = MethodArg::MonteCarlo, value_name = "METHOD")]
    pub(crate) method: MethodArg,
    /// BSSRDF of `--method bssrdf` and `point-cloud`: jensen2001 (the paper's, misprints mended), corrected (the
    /// same with its energy balanced), better-dipole, directional, monte-carlo (R_d of the
    /// transport equation).
    #[arg(long, default_value = "jensen2001", value_name = "MODEL")]
    pub(crate) bssrdf: String,
    /// BRDF of `--method brdf`.
    #[arg(long, value_enum, default_value_t = BrdfArg::Jensen, value_name = "MODEL")]
    pub(crate) brdf: BrdfArg,
    /// How `--method bssrdf` draws points: by R_d on three axes, by the paper's exponential, or
    /// evenly.
    #[arg(long, value_enum, default_value_t = SamplingArg::Axes, value_name = "WAY")]
    pub(crate) sampling: SamplingArg,
    /// How `--method point-cloud` gathers light: the BSSRDF over an octree (Jensen and Buhler
    /// 2002), or a smooth bell over the points within the scatter radius (Marengo 2005).
    #[arg(long, value_enum, default_value_t = CloudArg::Hierarchy, value_name = "WAY")]
    pub(crate) cloud: CloudArg,
    /// Scatter radius of `--cloud smoothstep`, mm; when left out, that of the BSSRDF's mean distance.
    #[arg(long, value_name = "MM")]
    pub(crate) scatter_radius: Option<f64>,
    #[command(flatten)]
    pub(crate) effort: EffortArgs,
    /// Tell light apart that scattered once, more often, and never (layers single.R and so on).
    #[arg(long)]
    pub(crate) components: bool,
    /// Factor on radiances before the tone curve of the PNG (sRGB); chosen from the picture when
    /// left out, and stated.
    #[arg(long, value_name = "FACTOR")]
    pub(crate) exposure: Option<f64>,
    /// Go on with a picture of the same scene, method and seed.
    #[arg(long)]
    pub(crate) resume: bool,
}

/// How long a scene is rendered.
#[derive(Args, Debug)]
pub(crate) struct EffortArgs {
    /// Rounds: each is one path a pixel, or what --photons says.
    #[arg(long, default_value_t = 64, value_name = "N")]
    rounds: u64,
    /// Effort of a round where light is followed from its lamp: so many photons of every light and
    /// channel. Those of a beam are fewer, and split on their way.
    #[arg(long, default_value = "4e4", value_name = "N", value_parser = photons)]
    photons: u64,
    /// Stop earlier, once the rms of the pixels' standard errors is this share of the mean pixel.
    #[arg(long, value_name = "SHARE")]
    until_error: Option<f64>,
    /// Seed of every random number.
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
}

impl EffortArgs {
    /// So much of `method`, with nothing told apart.
    pub(crate) fn options(&self, method: MethodChoice) -> RenderOptions {
        RenderOptions {
            method,
            rounds: self.rounds,
            until_error: self.until_error,
            photons: self.photons,
            seed: self.seed,
            components: false,
            exposure: None,
        }
    }
}

#[derive(Args, Debug)]
#[command(after_help = "Example:\n  beamspot validate scenes/jensen8.toml -o cube --rounds 64")]
pub(crate) struct ValidateArgs {
    /// Solids, lights and a camera.
    #[arg(value_name = "SCENE.toml")]
    pub(crate) scene: PathBuf,
    /// Folder to write: validation.html, pictures of every method and of their differences.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) effort: EffortArgs,
}

#[derive(Args, Debug)]
#[command(after_help = "Example:\n  beamspot compare bssrdf.exr monte-carlo.exr -o difference.png")]
pub(crate) struct CompareArgs {
    /// A picture, as `render` or `hdr` write it; a profile.csv; or a table of materials (csv, json).
    #[arg(value_name = "A")]
    pub(crate) a: PathBuf,
    /// Another of its kind; a picture of the same size and channels.
    #[arg(value_name = "B")]
    pub(crate) b: PathBuf,
    /// Of two pictures, NAME.png: A - B, red where A is brighter and blue where it is darker, with
    /// NAME-flip.png (HDR-FLIP, of one or three channels) and NAME.svg (means in rings) beside
    /// it. Of two profiles or tables, NAME.svg: a plot of both and of their difference.
    #[arg(short, long, value_name = "NAME.png|NAME.svg")]
    pub(crate) output: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum MethodArg {
    /// Unbiased volume transport.
    MonteCarlo,
    /// Light leaves where it enters.
    Brdf,
    /// Diffusion over the surface, and single scattering.
    Bssrdf,
    /// The same, its diffusion gathered from points over the surface.
    PointCloud,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum CloudArg {
    /// The BSSRDF, far points together in nodes of an octree.
    Hierarchy,
    /// A smooth bell within the scatter radius.
    Smoothstep,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum BrdfArg {
    /// Evenly in all directions.
    Lambert,
    /// Jensen's approximation: diffuse and single scattering.
    Jensen,
    /// Hanrahan and Krueger's layers (`layers` of each object): what scattered once, and more
    /// often; sheets with the open behind them shine through.
    Layered,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum SamplingArg {
    /// Distances by R_d, on the normal and two axes.
    Axes,
    /// Distances by the paper's exponential, on the normal.
    Exponential,
    /// Evenly over the surface of a mesh or a sphere.
    Area,
}

impl RenderArgs {
    fn model(&self) -> Result<BssrdfModel, Error> {
        let all = BssrdfModel::ALL;
        let found = all.iter().find(|(name, _)| *name == self.bssrdf);
        found.map(|(_, model)| *model).ok_or_else(|| {
            let names = all.map(|(name, _)| name).join(", ");
            let message = format!(
                "--bssrdf: no model is called `{}`; there are {names}",
                self.bssrdf
            );
            Error::new(Kind::Usage, message)
        })
    }

    /// What was typed, checked.
    pub(crate) fn options(&self) -> Result<RenderOptions, Error> {
        let bad = |message: String| Err(Error::new(Kind::Usage, message));
        let sampling = match self.sampling {
            SamplingArg::Axes => Sampling::Axes,
            SamplingArg::Exponential => Sampling::Exponential,
            SamplingArg::Area => Sampling::Area,
        };
        let method = match self.method {
            MethodArg::MonteCarlo => MethodChoice::MonteCarlo,
            MethodArg::Brdf => match self.brdf {
                BrdfArg::Lambert => MethodChoice::Brdf(BrdfKind::Lambert),
                BrdfArg::Jensen => MethodChoice::Brdf(BrdfKind::Jensen),
                BrdfArg::Layered => MethodChoice::Layered,
            },
            MethodArg::Bssrdf => MethodChoice::Bssrdf(self.model()?, sampling),
            MethodArg::PointCloud => {
                let radius = self.scatter_radius;
                if radius.is_some_and(|r| !(r > 0.0 && r.is_finite())) {
                    return bad("--scatter-radius: expected a number above 0".to_owned());
                }
                let gather = match self.cloud {
                    CloudArg::Hierarchy => Gather::HIERARCHY,
                    CloudArg::Smoothstep => Gather::Smoothstep { radius },
                };
                MethodChoice::PointCloud(self.model()?, gather)
            }
        };
        if self.exposure.is_some_and(|e| !(e > 0.0 && e.is_finite())) {
            return bad("--exposure: expected a number above 0".to_owned());
        }
        Ok(RenderOptions {
            components: self.components,
            exposure: self.exposure,
            ..self.effort.options(method)
        })
    }
}

#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  beamspot brdf skin -o skin-brdf --angle 10,40,65 --photons 4e6\n\nMEDIUM.toml is that of `beamspot simulate`; its beam and tallies are not used."
)]
pub(crate) struct BrdfArgs {
    /// Layers, or a shipped medium by its name: skin, leaf.
    #[arg(value_name = "MEDIUM.toml")]
    pub(crate) medium: PathBuf,
    /// Folder to write.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Angles of incidence, degrees.
    #[arg(
        long,
        value_name = "DEG",
        value_delimiter = ',',
        default_value = "10,40,65"
    )]
    pub(crate) angle: Vec<f64>,
    /// Photons for each angle, as 1000000 or 1e6.
    #[arg(long, default_value = "1e6", value_name = "N", value_parser = photons)]
    pub(crate) photons: u64,
    /// Seed of every random number.
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub(crate) seed: u64,
}

#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  beamspot sphere samples.csv -o sphere\n\nsamples.csv:\n  sample,thickness_mm,eta,eta_slide,reflectance,u_reflectance,transmittance,u_transmittance,g\n  milk,1.0,1.34,1.5,0.40,0.002,0.30,0.002,0.8\n\nShares are of the incident power, the specular part included. In place of g a column\ncollimated_transmittance serves. Also: wavelength_nm, u_thickness_mm, angle_deg, u_g."
)]
pub(crate) struct SphereArgs {
    /// One row a sample.
    #[arg(value_name = "SAMPLES.csv")]
    pub(crate) samples: PathBuf,
    /// Folder to write sphere.csv and sphere.json to.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
}

#[derive(Args, Debug)]
#[command(after_help = "Example:\n  beamspot figures hk93 -o figures")]
pub(crate) struct FiguresArgs {
    /// jensen2001 (Figure 6, and the energy of the BSSRDF) or hk93 (Figures 2, 3, 4, 5, 8 and 9).
    pub(crate) paper: String,
    /// Folder to write csv and svg to.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Photons of each simulation, as 1000000 or 1e6.
    #[arg(long, default_value = "1e6", value_name = "N", value_parser = photons)]
    pub(crate) photons: u64,
}

/// A total typed on the command line.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TotalArg {
    pub(crate) channel: String,
    pub(crate) value: f64,
    pub(crate) u: f64,
}

#[derive(Debug, Subcommand)]
pub(crate) enum TableCommand {
    /// Prints tables with what follows from them; Jensen's table without a file.
    #[command(after_help = "Example:\n  beamspot table show result/materials.csv")]
    Show {
        /// csv or json tables, scenes of pbrt (.pbrt) or Mitsuba (.xml).
        #[arg(value_name = "FILE")]
        files: Vec<PathBuf>,
        #[command(flatten)]
        unit: SceneUnit,
    },
    /// Converts a table, for renderers and photon simulators too, and from pbrt and Mitsuba.
    #[command(
        after_help = "Examples:\n  beamspot table convert materials.csv --to json -o materials.json\n  beamspot table convert materials.csv --to pbrt --scene-unit-mm 10 -o materials.pbrt\n  beamspot table convert scene.xml --scene-unit-mm 1 --to csv -o materials.csv"
    )]
    Convert {
        /// csv or json table, scene of pbrt (.pbrt) or Mitsuba (.xml).
        #[arg(value_name = "FILE")]
        file: PathBuf,
        /// Format to write.
        #[arg(long, value_enum)]
        to: TableFormat,
        /// File to write.
        #[arg(short, long, value_name = "FILE")]
        output: PathBuf,
        /// Only the material of this name.
        #[arg(long, value_name = "NAME")]
        material: Option<String>,
        #[command(flatten)]
        unit: SceneUnit,
    },
    /// Joins tables; one material and channel with two sets of numbers is refused unless all are kept.
    #[command(
        after_help = "Examples:\n  beamspot table merge a/materials.csv b/materials.csv -o all.csv\n  beamspot table merge --keep-all monday/materials.csv tuesday/materials.csv -o week.csv"
    )]
    Merge {
        /// csv or json files.
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
        /// csv file to write.
        #[arg(short, long, value_name = "FILE")]
        output: PathBuf,
        /// Keep every row, with the name of its file in its source: for captures of one material.
        #[arg(long)]
        keep_all: bool,
    },
    /// Recomputes total reflectance and names the rows whose own column does not follow; Jensen's
    /// table without a file.
    #[command(after_help = "Example:\n  beamspot table check result/materials.csv")]
    Check {
        /// csv or json tables, scenes of pbrt (.pbrt) or Mitsuba (.xml).
        #[arg(value_name = "FILE")]
        files: Vec<PathBuf>,
        #[command(flatten)]
        unit: SceneUnit,
    },
}

#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct SceneUnit {
    /// Length of one unit of the renderer's scene: needed to read a scene; for writing 1 mm, or
    /// 1000 mm for Blender, when left out.
    #[arg(long, value_name = "MM", value_parser = unit_length)]
    pub(crate) scene_unit_mm: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum TableFormat {
    /// A table of this house.
    Csv,
    /// The same as JSON (schemas/materials.schema.json).
    Json,
    /// A datapackage.json, with materials.csv beside it.
    Datapackage,
    /// pbrt-v4: subsurface materials and media.
    Pbrt,
    /// Mitsuba 3: homogeneous media in dielectrics.
    Mitsuba,
    /// MaterialX with OpenPBR surfaces.
    Openpbr,
    /// A Python script for Blender's Cycles.
    Blender,
    /// Arnold standard_surface.
    Arnold,
    /// RenderMan PxrSurface.
    Renderman,
    /// Media of an MCX input file.
    Mcx,
    /// Tissues of a VTS input file.
    Vts,
}

impl TableFormat {
    /// The program that it is for, unless it is a table.
    pub(crate) fn target(self) -> Option<Target> {
        match self {
            Self::Csv | Self::Json | Self::Datapackage => None,
            Self::Pbrt => Some(Target::Pbrt),
            Self::Mitsuba => Some(Target::Mitsuba),
            Self::Openpbr => Some(Target::OpenPbr),
            Self::Blender => Some(Target::Blender),
            Self::Arnold => Some(Target::Arnold),
            Self::Renderman => Some(Target::RenderMan),
            Self::Mcx => Some(Target::Mcx),
            Self::Vts => Some(Target::Vts),
        }
    }
}

fn unit_length(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|mm: &f64| *mm > 0.0 && mm.is_finite())
        .ok_or_else(|| format!("expected a length above 0 mm, got `{text}`"))
}

fn photons(text: &str) -> Result<u64, String> {
    // A whole number that a float holds exactly may be written with an exponent.
    let float = || {
        text.parse::<f64>()
            .ok()
            .filter(|n| n.fract() == 0.0 && (0.0..=9e15).contains(n))
    };
    text.parse::<u64>()
        .ok()
        .or_else(|| float().map(|n| n as u64))
        .filter(|n| *n > 0)
        .ok_or_else(|| {
            format!("expected a number of photons above 0, as 1000000 or 1e6, got `{text}`")
        })
}

fn length(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|mm: &f64| *mm >= 0.0 && mm.is_finite())
        .ok_or_else(|| format!("expected a length of at least 0 mm, got `{text}`"))
}

fn angle(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|degrees| (0.0..90.0).contains(degrees))
        .ok_or_else(|| format!("expected an angle from 0 to below 90 degrees, got `{text}`"))
}

fn range(text: &str) -> Result<(f64, f64), String> {
    let expected = || format!("expected MIN:MAX in mm, as 0.8:15, got `{text}`");
    let (low, high) = text.split_once(':').ok_or_else(expected)?;
    let number = |part: &str| part.trim().parse::<f64>().map_err(|_| expected());
    let (low, high) = (number(low)?, number(high)?);
    if low >= 0.0 && low < high && high.is_finite() {
        Ok((low, high))
    } else {
        Err(expected())
    }
}

fn total(text: &str) -> Result<TotalArg, String> {
    let expected = || format!("expected CHANNEL=R±U, as G=0.79±0.01 or G=0.79+-0.01, got `{text}`");
    let (channel, numbers) = text.split_once('=').ok_or_else(expected)?;
    let (value, u) = numbers
        .split_once('±')
        .or_else(|| numbers.split_once("+-"))
        .ok_or_else(expected)?;
    let number = |part: &str| part.trim().parse::<f64>().map_err(|_| expected());
    let (value, u) = (number(value)?, number(u)?);
    if channel.is_empty() || !(value > 0.0 && value.is_finite() && u >= 0.0 && u.is_finite()) {
        return Err(expected());
    }
    Ok(TotalArg {
        channel: channel.trim().to_owned(),
        value,
        u,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_grammar_is_sound() {
        Cli::command().debug_assert();
    }

    /// The commands that `command` and those below it show as examples, with what shows each.
    fn examples(command: &clap::Command, found: &mut Vec<(String, String)>) {
        let name = command.get_display_name().unwrap_or(command.get_name());
        let help = command.get_after_help().map(ToString::to_string);
        let help = help.unwrap_or_default();
        let (_, shown) = help
            .split_once("Example")
            .unwrap_or_else(|| panic!("the help of {name} has no example"));
        let lines = shown.lines().skip(1);
        let lines = lines
            .take_while(|line| line.starts_with("  "))
            .map(str::trim);
        let before = found.len();
        found.extend(
            lines
                .filter(|line| line.starts_with("beamspot "))
                .map(|line| (name.to_owned(), line.to_owned())),
        );
        // Others may stand beside it.
        let own = name.replace('-', " ");
        let shown = found[before..]
            .iter()
            .any(|(_, line)| line.starts_with(&own));
        assert!(shown, "the help of {name} does not show itself");
        for below in command.get_subcommands() {
            examples(below, found);
        }
    }

    #[test]
    fn the_help_of_every_command_ends_with_examples_that_can_be_typed() {
        let mut command = Cli::command().disable_help_subcommand(true);
        command.build();
        let mut found = vec![];
        examples(&command, &mut found);
        assert!(found.len() > 25, "{found:?}");
        for (name, line) in found {
            let words = line.split_whitespace().map(|word| word.trim_matches('\''));
            let words: Vec<&str> = words.take_while(|word| *word != ">").collect();
            let read = Cli::try_parse_from(&words);
            assert!(read.is_ok(), "{name}: {line}: {}", read.unwrap_err());
        }
    }

    #[test]
    fn totals_and_ranges_are_read_or_explained() {
        let expected = TotalArg {
            channel: "G".to_owned(),
            value: 0.79,
            u: 0.01,
        };
        assert_eq!(total("G=0.79±0.01"), Ok(expected.clone()));
        assert_eq!(total("G=0.79+-0.01"), Ok(expected));
        for bad in [
            "0.79±0.01",
            "G=0.79",
            "G=x±0.1",
            "=0.7±0.1",
            "G=-1±0.1",
            "G=0.5±NaN",
        ] {
            assert!(total(bad).unwrap_err().contains(bad), "{bad}");
        }
        assert_eq!(range("0.8:15"), Ok((0.8, 15.0)));
        for bad in ["0.8", "2:1", "a:b", "-1:3", "1:inf"] {
            assert!(range(bad).unwrap_err().contains(bad), "{bad}");
        }
    }
}
