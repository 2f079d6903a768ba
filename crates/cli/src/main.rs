//! The command line of beamspot: chooses a command and sets the exit code.

mod args;
mod commands;
mod progress;

use args::{Cli, Command};
use clap::Parser;
use pipeline::{Kind, Result};
use std::io::{IsTerminal, Write};
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = Cli::parse();
    match run(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Nobody is left to tell if standard error is closed.
            let _ = writeln!(std::io::stderr(), "beamspot: {error}");
            ExitCode::from(match error.kind() {
                Kind::Fault => 1,
                Kind::Usage => 2,
                Kind::Input => 3,
                Kind::Quality => 4,
                Kind::Partial => 5,
                Kind::Interrupted => 130,
            })
        }
    }
}

/// Lets a write beyond the limit of a file's size (`ulimit -f`) fail as one to a full disk does, which
/// is answered and cleaned up after; the signal would end the process where it stands.
#[cfg(unix)]
fn outlive_the_limit_of_file_sizes() -> Result<()> {
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, std::sync::Arc::default())
        .map_err(|e| pipeline::Error::new(Kind::Fault, e))?;
    Ok(())
}

fn run(cli: Cli) -> Result<()> {
    #[cfg(unix)]
    outlive_the_limit_of_file_sizes()?;
    let common = args::Common {
        on_screen: std::io::stdout().is_terminal(),
        ..cli.common
    };
    if let Some(threads) = common.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(usize::from(threads))
            .build_global()
            .map_err(|e| pipeline::Error::new(Kind::Fault, e))?;
    }
    let monitor = progress::Bar::new()?;
    let mut out = std::io::stdout().lock();
    let result = match cli.command {
        Command::Demo(args) => commands::demo::run(&args, common, &monitor, &mut out),
        Command::Synth(args) => commands::synth::run(&args, common, &monitor, &mut out),
        Command::Init(args) => commands::init::run(&args, common, &mut out),
        Command::Measure(args) => commands::measure::run(&args, common, &monitor, &mut out),
        Command::Batch(args) => commands::batch::run(&args, common, &monitor, &mut out),
        Command::Hdr(args) => commands::hdr::run(&args, common, &monitor, &mut out),
        Command::Profile(args) => commands::profile::run(&args, common, &monitor, &mut out),
        Command::Beam(args) => commands::beam::run(&args, common, &monitor, &mut out),
        Command::Fit(args) => commands::fit::run(&args, common, &mut out),
        Command::Simulate(args) => commands::simulate::run(&args, common, &monitor, &mut out),
        Command::Brdf(args) => commands::brdf::run(&args, common, &monitor, &mut out),
        Command::Render(args) => commands::render::run(&args, common, &monitor, &mut out),
        Command::Validate(args) => commands::validate::run(&args, common, &monitor, &mut out),
        Command::Compare(args) => commands::compare::run(&args, common, &mut out),
        Command::Sphere(args) => commands::sphere::run(&args, common, &monitor, &mut out),
        Command::Figures(args) => commands::figures::run(&args, common, &monitor, &mut out),
        Command::Table(command) => commands::table::run(&command, common, &mut out),
        Command::Doctor => commands::doctor::run(common, &mut out),
        Command::Completions(args) => commands::shell::completions(&args, common, &mut out),
        Command::Man(args) => commands::shell::man(&args, common, &mut out),
    };
    monitor.finish();
    result
}
