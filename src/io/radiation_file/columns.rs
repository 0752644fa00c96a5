//! ECSV and CSV columns with our names, in our units.

use super::text::Source;
use super::{Depths, Doses};
use crate::error::{InputError, nearest};
use crate::io::table::{Cell, Table};
use crate::io::unit::{Conversion, Unit};

/// A table of a radiation file.
pub(super) struct Columns<'a> {
    source: &'a Source,
    table: Table,
}

impl<'a> Columns<'a> {
    /// Reads the text as a table with at least one row.
    pub fn of(source: &'a Source) -> Result<Columns<'a>, InputError> {
        let table = Table::parse(&source.name, &source.text).map_err(|error| source.refused(error))?;
        if table.rows() == 0 {
            return Err(source.refuse("the table has no rows"));
        }
        Ok(Columns { source, table })
    }

    pub fn table(&self) -> &Table {
        &self.table
    }

    /// An error for a row (from 0) and column.
    pub fn fault(&self, row: Option<usize>, column: &str, problem: impl Into<String>) -> InputError {
        self.source.refused(self.table.fault(row, Some(column), problem))
    }

    /// The one of these columns that is present. They are alternatives, so only one is allowed.
    pub fn one_of(&self, names: &[&'static str]) -> Result<&'static str, InputError> {
        match self.present(names)[..] {
            [one] => Ok(one),
            [] => Err(self.absent(names)),
            [first, second, ..] => {
                let problem = format!("columns {first} and {second} say the same in other words");
                Err(self.fault(None, second, problem).with_help("give one of them"))
            }
        }
    }

    /// Those of these columns that are present.
    pub fn present(&self, names: &[&'static str]) -> Vec<&'static str> {
        names.iter().copied().filter(|name| self.table.column(name).is_some()).collect()
    }

    /// The error if none of these columns is present.
    pub fn absent(&self, names: &[&str]) -> InputError {
        let known = || self.table.columns.iter().map(|column| column.name.as_str());
        let columns = known().collect::<Vec<_>>().join(", ");
        let error = self.source.refuse(format!("there is no column {}; columns: {columns}", names.join(" or ")));
        let near = known().find_map(|column| Some((column, nearest(column, names.iter().copied())?)));
        match near {
            Some((column, name)) => error.with_help(format!("is `{column}` meant to be `{name}`?")),
            None => error,
        }
    }

    /// The column's values in the unit of its name, converted from the unit in its header. None may be negative.
    pub fn numbers(&self, name: &str, unit: &str) -> Result<Vec<f64>, InputError> {
        self.numbers_in(name, &[unit])
    }

    /// The same in the first of these units, of which the others stand for the same number.
    pub fn numbers_in(&self, name: &str, units: &[&str]) -> Result<Vec<f64>, InputError> {
        let conversion = self.conversion(name, units)?;
        self.converted(name, |theirs| conversion.apply(theirs))
    }

    /// The conversion of a column into the first of these units.
    pub fn conversion(&self, name: &str, ours: &[&str]) -> Result<Conversion, InputError> {
        self.table.conversion(name, ours).map_err(|error| self.source.refused(error))
    }

    /// The column's fluxes or fluences, omnidirectional and in the unit of its name, of the same kind.
    pub fn fluxes(&self, name: &str, unit: &str) -> Result<Vec<f64>, InputError> {
        let factor = self.flux_factor(name, unit)?;
        self.converted(name, |theirs| factor * theirs)
    }

    /// The factor from the unit in the header of a column of fluxes or fluences to the omnidirectional unit of its name.
    pub fn flux_factor(&self, name: &str, unit: &str) -> Result<f64, InputError> {
        let kind = Unit::parse(unit).and_then(Unit::flux).expect("a unit of this crate");
        let Some(stated) = self.table.column(name).and_then(|column| column.unit.as_deref()) else { return Ok(1.0) };
        let theirs = Unit::parse(stated).and_then(Unit::flux).filter(|theirs| (theirs.0, theirs.1) == (kind.0, kind.1));
        theirs.map(|(.., factor)| factor).ok_or_else(|| {
            let problem =
                format!("the unit \"{stated}\" cannot be converted to {unit}; allowed: {unit}, also per sr, m2, keV");
            self.fault(None, name, problem)
        })
    }

    /// The column's values, converted; none may be negative.
    fn converted(&self, name: &str, convert: impl Fn(f64) -> f64) -> Result<Vec<f64>, InputError> {
        let column = self.table.column(name).ok_or_else(|| self.absent(&[name]))?;
        let number = |(row, cell): (usize, &Cell)| match cell.number().map(&convert).filter(|number| number.is_finite())
        {
            Some(number) if number < 0.0 => Err(self.fault(Some(row), name, "this must not be negative")),
            Some(number) => Ok(number),
            None if *cell == Cell::Missing => {
                Err(self.fault(Some(row), name, "the cell is empty; a number is needed here"))
            }
            None => Err(self.fault(Some(row), name, "a number is needed here")),
        };
        column.cells.iter().enumerate().map(number).collect()
    }

    /// The thickness in mm or the areal density in g/cm2 of each row.
    pub fn depths(&self) -> Result<Depths, InputError> {
        match self.one_of(&["thickness_mm", "areal_density_g_cm2"])? {
            "thickness_mm" => Ok(Depths::ThicknessMm(self.numbers("thickness_mm", "mm")?)),
            name => Ok(Depths::ArealDensityGCm2(self.numbers(name, "g/cm2")?)),
        }
    }

    /// The doses in MeV/g or dose rates in MeV/g/yr of each row, by the names of their columns.
    pub fn doses(&self, total: &'static str, rate: &'static str) -> Result<Doses, InputError> {
        match self.one_of(&[total, rate])? {
            name if name == total => Ok(Doses::Total(self.numbers(name, "MeV/g")?)),
            name => Ok(Doses::Rate(self.numbers(name, "MeV/g/yr")?)),
        }
    }

    /// Checks that there are at least two rows, needed for interpolation.
    pub fn check_two_rows(&self) -> Result<(), InputError> {
        match self.table.rows() {
            0 | 1 => Err(self.source.refuse("there is one row, and at least two are needed")),
            _ => Ok(()),
        }
    }

    /// Checks that each value is larger than the previous one.
    pub fn check_rising<T: PartialOrd>(&self, name: &str, values: &[T]) -> Result<(), InputError> {
        match values.windows(2).position(|pair| pair[0] >= pair[1]) {
            None => Ok(()),
            Some(row) => Err(self.fault(Some(row + 1), name, format!("this must be {}", self.than("more", row, name)))),
        }
    }

    /// Checks that no value is smaller than the previous one.
    pub fn check_not_falling(&self, name: &str, values: &[f64]) -> Result<(), InputError> {
        match values.windows(2).position(|pair| pair[0] > pair[1]) {
            None => Ok(()),
            Some(row) => {
                Err(self.fault(Some(row + 1), name, format!("this must not be {}", self.than("less", row, name))))
            }
        }
    }

    /// `less than in the row before, 3.0`
    fn than(&self, how: &str, row: usize, name: &str) -> String {
        let before = self.table.column(name).and_then(|column| column.cells.get(row)).unwrap_or(&Cell::Missing);
        format!("{how} than in the row before, {before}")
    }
}
