//! `paws config`.

use clap::Args;

use super::{Answer, ConfigFile, print};
use crate::report::table::aligned;

#[derive(Debug, Args)]
pub struct ConfigArgs {
    #[command(flatten)]
    config: ConfigFile,
    /// Print as a TOML file that `--config` takes
    #[arg(long)]
    toml: bool,
}

pub fn run(args: &ConfigArgs) -> anyhow::Result<Answer> {
    let config = args.config.read()?;
    if args.toml {
        print(&config.to_toml())?;
        return Ok(Answer::Yes);
    }
    let mut rows = vec![["parameter", "value", "unit", "source", "meaning"].map(str::to_owned).to_vec()];
    let method = if config.method == crate::config::Method::Paper { "paper" } else { "ours" };
    rows.push(
        ["method", method, "-", "ours", "What the others start from: ours, or paper."].map(str::to_owned).to_vec(),
    );
    rows.push(
        ["seed", &config.seed.to_string(), "-", "ours", "Seed of every random draw."].map(str::to_owned).to_vec(),
    );
    for row in config.rows() {
        let source = if row.section == "ours" { "ours".to_owned() } else { format!("paper {}", row.section) };
        rows.push(vec![row.key, row.value, row.unit.to_owned(), source, row.meaning]);
    }
    print(&aligned(&rows))?;
    Ok(Answer::Yes)
}
