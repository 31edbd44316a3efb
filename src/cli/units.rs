//! The unit of positions in trajectory files, as an argument.

use clap::{Args, ValueEnum};

use crate::recording::trajectory::LengthUnit;

/// Arguments of commands that read bare trajectories.
#[derive(Debug, Clone, Default, Args)]
pub struct UnitsArgs {
    /// Unit of the positions in trajectory files [default: what their header says, else metres]
    #[arg(long, value_enum, value_name = "UNIT")]
    units: Option<Unit>,
}

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Unit {
    M,
    Cm,
    Mm,
}

impl UnitsArgs {
    /// The unit, where one was given.
    pub fn length(&self) -> Option<LengthUnit> {
        self.units.map(|unit| match unit {
            Unit::M => LengthUnit::Metre,
            Unit::Cm => LengthUnit::Centimetre,
            Unit::Mm => LengthUnit::Millimetre,
        })
    }
}
