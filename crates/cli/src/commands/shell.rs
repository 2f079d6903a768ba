//! `beamspot completions` and `beamspot man`: what shell and manual know of the command line.

use super::print;
use crate::args::{Cli, Common, CompletionsArgs, ManArgs};
use clap::{Command, CommandFactory};
use clap_mangen::Man;
use pipeline::error::Blame;
use pipeline::files::Outputs;
use pipeline::fit_json::SCHEMA_VERSION;
use pipeline::{Error, Kind, Result};
use serde::Serialize;
use std::io::Write;

const NAME: &str = "beamspot";

#[derive(Serialize)]
struct Script {
    schema_version: u32,
    shell: String,
    script: String,
}

#[derive(Serialize)]
struct Pages {
    schema_version: u32,
    pages: Vec<String>,
}

/// Prints the script that completes commands and flags.
pub(crate) fn completions(
    args: &CompletionsArgs,
    common: Common,
    out: &mut impl Write,
) -> Result<()> {
    let mut script = vec![];
    clap_complete::generate(args.shell, &mut Cli::command(), NAME, &mut script);
    let script = String::from_utf8(script).map_err(|e| Error::new(Kind::Fault, e))?;
    if !common.json {
        return print::line(out, script.trim_end());
    }
    print::json(
        out,
        &Script {
            schema_version: SCHEMA_VERSION,
            shell: args.shell.to_string(),
            script,
        },
    )
}

/// Writes one page for each command.
pub(crate) fn man(args: &ManArgs, common: Common, out: &mut impl Write) -> Result<()> {
    let mut command = Cli::command().disable_help_subcommand(true);
    command.build();
    let mut pages = vec![];
    collect(&command, &mut pages)?;
    let names: Vec<String> = pages.iter().map(|(name, _)| name.clone()).collect();
    let outputs = Outputs::new(&args.output, &names, &[], common.force)?;
    for (name, page) in &pages {
        outputs.write(name, |out| Ok(out.write_all(page)?))?;
    }
    outputs.commit()?;
    if common.json {
        let schema_version = SCHEMA_VERSION;
        return print::json(
            out,
            &Pages {
                schema_version,
                pages: names,
            },
        );
    }
    let folder = args.output.display();
    let first = args.output.join(format!("{NAME}.1"));
    print::line(
        out,
        format!(
            "wrote {} pages to {folder}; read one with `man -l {}`, or all by name once {folder} is \
             the man1 of a folder in your MANPATH",
            names.len(),
            first.display()
        ),
    )
}

/// File name and text of the pages of `command` and all below it.
fn collect(command: &Command, pages: &mut Vec<(String, Vec<u8>)>) -> Result<()> {
    let man = Man::new(command.clone());
    let mut page = vec![];
    man.render(&mut page).fault("a page of the manual")?;
    let name = command.get_display_name().unwrap_or(command.get_name());
    pages.push((format!("{name}.1"), page));
    let below = command.get_subcommands();
    below
        .filter(|command| !command.is_hide_set())
        .try_for_each(|command| collect(command, pages))
}
