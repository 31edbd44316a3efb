//! `paws config`.

use clap::Args;

use super::{Answer, ConfigFile, print};
use crate::config::{Config, Method, Row};
use crate::report::table::{aligned, wrapped};

/// The table's width, characters: a terminal beside an editor.
const WIDTH: usize = 120;
/// Meanings stand below their parameters, indented by this.
const INDENT: &str = "    ";
/// Longer values are cut; `--toml` prints them whole.
const WIDEST_VALUE: usize = 40;
/// Numbers of more characters are rounded: a third has seventeen digits.
const LONGEST_NUMBER: usize = 10;

#[derive(Debug, Args)]
#[command(
    after_help = "source: \"paper B.1\" is the paper's number with its section; \"ours\" where the paper has none: by \
                        judgement, by a measurement, or as the meaning says; \"source\" is somebody else's."
)]
pub struct ConfigArgs {
    /// Print only parameters with this word in their name or meaning: `paws config friction`, `paws config hands.contact`
    #[arg(value_name = "WORD", conflicts_with = "toml")]
    word: Option<String>,
    #[command(flatten)]
    config: ConfigFile,
    /// Print all, with whole values, as a TOML file that `--config` takes
    #[arg(long)]
    toml: bool,
}

pub fn run(args: &ConfigArgs) -> anyhow::Result<Answer> {
    let config = args.config.read()?;
    if args.toml {
        print(&config.to_toml())?;
        return Ok(Answer::Yes);
    }
    let word = args.word.as_deref().unwrap_or_default().to_lowercase();
    let rows: Vec<Row> = all(&config).into_iter().filter(|row| has(row, &word)).collect();
    if rows.is_empty() {
        eprintln!("no parameter has \"{word}\" in its name or meaning; `paws config` prints all of them");
        return Ok(Answer::No);
    }
    print(&table(&rows))?;
    Ok(Answer::Yes)
}

/// All parameters, the two of no step first.
fn all(config: &Config) -> Vec<Row> {
    let first = |key: &str, value: String, meaning: &str| Row {
        key: key.to_owned(),
        value,
        unit: "-",
        source: "ours".to_owned(),
        grounds: "",
        meaning: meaning.to_owned(),
    };
    let method = if config.method == Method::Paper { "paper" } else { "ours" };
    let mut rows = vec![
        first("method", method.to_owned(), "Which set of defaults: ours, or the paper's."),
        first("seed", config.seed.to_string(), "Seed of every random draw."),
    ];
    rows.extend(config.rows());
    rows
}

/// Whether a parameter's name or meaning has a word, which is in lower case.
fn has(row: &Row, word: &str) -> bool {
    [&row.key, &row.meaning].iter().any(|text| text.to_lowercase().contains(word))
}

/// A line a parameter, its meaning below it; an empty line before each block.
fn table(rows: &[Row]) -> String {
    let mut cells = vec![["parameter", "value", "unit", "source"].map(str::to_owned).to_vec()];
    cells.extend(rows.iter().map(|r| vec![r.key.clone(), brief(&r.value), r.unit.to_owned(), r.source.clone()]));
    let lined_up = aligned(&cells);
    // The header, and the rule below it.
    let mut lines = lined_up.lines();
    let mut text: String = lines.by_ref().take(2).map(|line| format!("{line}\n")).collect();
    let mut block = "";
    for (line, row) in lines.zip(rows) {
        let of = row.key.rsplit_once('.').map_or("", |(block, _)| block);
        if of != block {
            block = of;
            text.push('\n');
        }
        text += &format!("{line}\n");
        for said in wrapped(&meaning(row), WIDTH - INDENT.len()) {
            text += &format!("{INDENT}{said}\n");
        }
    }
    text
}

/// What a parameter means, and what its value rests on.
fn meaning(row: &Row) -> String {
    match row.grounds {
        "" => row.meaning.clone(),
        grounds => format!("{} [{grounds}]", row.meaning),
    }
}

/// A value in few characters.
fn brief(value: &str) -> String {
    let value = match value.parse::<f64>() {
        Ok(number) if value.len() > LONGEST_NUMBER => rounded(number),
        _ => value.to_owned(),
    };
    if value.chars().count() <= WIDEST_VALUE {
        return value;
    }
    let cut: String = value.chars().take(WIDEST_VALUE - 3).collect();
    format!("{cut}...")
}

/// A number to four digits.
fn rounded(number: f64) -> String {
    let decimals = (3.0 - number.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{number:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_values_are_rounded_or_cut() {
        assert_eq!(brief("0.3333333333333333"), "0.3333");
        assert_eq!(brief("0.004166666666666667"), "0.004167");
        assert_eq!((brief("0.05"), brief("8000000"), brief("true")), ("0.05".into(), "8000000".into(), "true".into()));
        assert_eq!(brief(&"x".repeat(40)), "x".repeat(40));
        assert_eq!(brief(&"x".repeat(41)), format!("{}...", "x".repeat(37)));
    }

    #[test]
    fn every_line_of_the_table_fits_and_every_parameter_is_there() {
        let rows = all(&Config::default());
        let text = table(&rows);
        let wide: Vec<&str> = text.lines().filter(|line| line.chars().count() > WIDTH).collect();
        assert!(wide.is_empty(), "{wide:#?}");
        let named = text.lines().skip(2).filter(|line| !line.is_empty() && !line.starts_with(INDENT)).count();
        assert_eq!(named, rows.len());
    }

    #[test]
    fn a_word_is_looked_for_in_names_and_meanings() {
        let found = |word: &str| -> Vec<String> {
            all(&Config::default()).into_iter().filter(|row| has(row, word)).map(|row| row.key).collect()
        };
        assert_eq!(found("hinge_friction"), ["priors.resistance.hinge_friction"]);
        assert!(found("random draw").contains(&"seed".to_owned()));
        assert!(found("priors.").len() > 10 && found("no such word").is_empty());
    }
}
