//! Columns of a table of amplifiers, and their cells.

use std::collections::BTreeMap;
use std::str::FromStr;

use super::section::Section;
use super::{Corner, Row};
use crate::error::{InputError, nearest};
use crate::image::fits::Hdu;
use crate::io::table::{Cell, Table};

/// A cell's value, or the header keyword that holds it.
#[derive(Clone, Debug)]
pub(super) enum Value<T> {
    Given(T),
    Keyword(String),
}

/// Prefix of a cell that names a keyword.
const KEYWORD: &str = "keyword:";

/// Prefix of the name of a density column.
pub(super) const DENSITY: &str = "density_per_px:";

/// Unit and allowed range of a column's numbers.
struct Column {
    name: &'static str,
    /// Units into whose first one cells are converted; the others stand for the same number.
    units: &'static [&'static str],
    allowed: (f64, f64),
    whole: bool,
}

const ELECTRONS: &[&str] = &["e-", "e-/px"];
const DN: &[&str] = &["DN"];
const PER_DN: &[&str] = &["e-/DN"];
const PX: &[&str] = &["px"];
const PURE: &[&str] = &[""];
const DENSITIES: &[&str] = &["", "1/px"];
const ANY: (f64, f64) = (f64::MIN, f64::MAX);

/// Numeric columns.
const NUMBERS: [Column; 12] = [
    Column { name: "prescan_columns", units: PX, allowed: (0.0, 1e6), whole: true },
    Column { name: "overscan_columns", units: PX, allowed: (0.0, 1e6), whole: true },
    Column { name: "overscan_rows", units: PX, allowed: (0.0, 1e6), whole: true },
    Column { name: "transfers_before", units: PX, allowed: (0.0, 1e6), whole: true },
    Column { name: "serial_transfers_before", units: PX, allowed: (0.0, 1e6), whole: true },
    Column { name: "charge_before_e", units: ELECTRONS, allowed: (0.0, f64::MAX), whole: false },
    Column { name: "gain_e_per_dn", units: PER_DN, allowed: (f64::MIN_POSITIVE, f64::MAX), whole: false },
    Column { name: "read_noise_e", units: ELECTRONS, allowed: (0.0, f64::MAX), whole: false },
    Column { name: "bias_dn", units: DN, allowed: ANY, whole: false },
    Column { name: "saturated_dn", units: DN, allowed: ANY, whole: false },
    Column { name: "density_factor", units: PURE, allowed: (0.0, 1e6), whole: false },
    Column { name: "serial_density_factor", units: PURE, allowed: (0.0, 1e6), whole: false },
];

/// Text columns.
const WORDS: [&str; 5] = ["hdu", "amplifier", "corner", "section", "data_section"];

/// Names of corners.
const CORNERS: [(&str, Corner); 4] = [
    ("lower-left", Corner::LowerLeft),
    ("lower-right", Corner::LowerRight),
    ("upper-left", Corner::UpperLeft),
    ("upper-right", Corner::UpperRight),
];

/// All rows of a table.
pub(super) fn rows(table: &Table) -> Result<Vec<Row>, InputError> {
    check(table)?;
    (0..table.rows()).map(|row| Cells { table, row }.read()).collect()
}

/// Checks that columns are known and have their units, and that there are rows.
fn check(table: &Table) -> Result<(), InputError> {
    let refusal = |problem: String| InputError::new(String::new(), problem);
    let known: Vec<&str> = WORDS.into_iter().chain(NUMBERS.iter().map(|column| column.name)).collect();
    for needed in ["hdu", "corner"] {
        if table.column(needed).is_none() {
            return Err(refusal(format!("it has no column `{needed}`")));
        }
    }
    if table.rows() == 0 {
        return Err(refusal("the table has no rows".into()));
    }
    for column in &table.columns {
        let name = column.name.as_str();
        if !known.contains(&name) && name.strip_prefix(DENSITY).is_none_or(str::is_empty) {
            let error = table.fault(None, Some(name), "no column of amplifiers has this name");
            let all = format!("known are {}, {DENSITY}SPECIES", known.join(", "));
            let near = nearest(name, known.iter().copied()).map(|near| format!("did you mean `{near}`?"));
            return Err(error.with_help(near.unwrap_or(all)));
        }
        if !WORDS.contains(&name) {
            table.conversion(name, units_of(name))?;
        }
    }
    Ok(())
}

/// Units of a numeric column.
fn units_of(name: &str) -> &'static [&'static str] {
    NUMBERS.iter().find(|number| number.name == name).map_or(DENSITIES, |number| number.units)
}

/// The cells of one row.
#[derive(Clone, Copy)]
pub(super) struct Cells<'a> {
    pub table: &'a Table,
    pub row: usize,
}

impl Cells<'_> {
    fn read(self) -> Result<Row, InputError> {
        let hdu =
            self.word("hdu").ok_or_else(|| self.fault("hdu", "an HDU is needed: EXTNAME, EXTNAME,EXTVER or number"))?;
        let density = |name: &str| Ok(self.number(name)?.unwrap_or(1.0));
        let row = Row {
            hdu: hdu.parse().map_err(|problem: String| self.fault("hdu", problem))?,
            name: self.word("amplifier").unwrap_or_else(|| format!("{}", self.row + 1)),
            corner: self.corner()?,
            section: self.section("section")?,
            data_section: self.section("data_section")?,
            prescan_columns: self.count("prescan_columns")?,
            overscan_columns: self.count("overscan_columns")?,
            overscan_rows: self.count("overscan_rows")?,
            rows_before: self.count("transfers_before")? as u32,
            columns_before: self.count("serial_transfers_before")? as u32,
            charge_before_e: self.number("charge_before_e")?.unwrap_or(0.0),
            gain_e_per_dn: self.value("gain_e_per_dn")?,
            read_noise_e: self.value("read_noise_e")?,
            bias_dn: self.value("bias_dn")?,
            saturated_dn: self.value("saturated_dn")?,
            density_factor: density("density_factor")?,
            serial_density_factor: density("serial_density_factor")?,
            densities_per_px: self.densities()?,
        };
        let counted = row.prescan_columns + row.overscan_columns + row.overscan_rows;
        if row.data_section.is_some() && counted > 0 {
            let problem = "the row has columns or rows of prescan or overscan too, which may contradict it";
            return Err(self.fault("data_section", problem).with_help("leave one of the two empty"));
        }
        if row.charge_before_e > 0.0 && row.rows_before == 0 {
            let problem = "there are no rows between the frame and the register";
            return Err(self.fault("charge_before_e", problem).with_help("give their number in transfers_before"));
        }
        Ok(row)
    }

    fn fault(self, column: &str, problem: impl Into<String>) -> InputError {
        self.table.fault(Some(self.row), Some(column), problem)
    }

    /// A cell that is not empty.
    fn cell(&self, name: &str) -> Option<&Cell> {
        self.table.column(name).map(|column| &column.cells[self.row]).filter(|cell| **cell != Cell::Missing)
    }

    fn word(self, name: &str) -> Option<String> {
        match self.cell(name)? {
            Cell::Text(text) => Some(text.trim().to_string()),
            other => Some(other.to_string()),
        }
    }

    fn corner(self) -> Result<Corner, InputError> {
        let word = self.word("corner").unwrap_or_default();
        let corner = CORNERS.iter().find(|(name, _)| *name == word).map(|(_, corner)| *corner);
        corner.ok_or_else(|| {
            let names = CORNERS.map(|(name, _)| name);
            self.fault("corner", format!("allowed: {}", names.join(", ")))
        })
    }

    fn section(self, name: &str) -> Result<Option<Value<Section>>, InputError> {
        let Some(word) = self.word(name) else { return Ok(None) };
        let value = match word.strip_prefix(KEYWORD) {
            Some(keyword) => Value::Keyword(self.keyword(name, keyword)?),
            None => Value::Given(Section::from_str(&word).map_err(|problem| self.fault(name, problem))?),
        };
        Ok(Some(value))
    }

    /// A number, or the keyword that holds it.
    fn value(self, name: &str) -> Result<Option<Value<f64>>, InputError> {
        match self.word(name).as_deref().and_then(|word| word.strip_prefix(KEYWORD)) {
            Some(keyword) => Ok(Some(Value::Keyword(self.keyword(name, keyword)?))),
            None => Ok(self.number(name)?.map(Value::Given)),
        }
    }

    fn keyword(self, name: &str, keyword: &str) -> Result<String, InputError> {
        let keyword = keyword.trim().to_ascii_uppercase();
        if keyword.is_empty() {
            return Err(self.fault(name, "the keyword of a header is needed, such as keyword:GAIN"));
        }
        Ok(keyword)
    }

    fn number(self, name: &str) -> Result<Option<f64>, InputError> {
        let Some(cell) = self.cell(name) else { return Ok(None) };
        let number = cell.number().ok_or_else(|| self.fault(name, "a number is needed here"))?;
        let conversion = self.table.conversion(name, units_of(name))?;
        self.allowed(name, conversion.apply(number)).map(Some)
    }

    /// The number, if allowed in the column.
    pub fn allowed(self, name: &str, number: f64) -> Result<f64, InputError> {
        let density = Column { name: DENSITY, units: DENSITIES, allowed: (0.0, 1e6), whole: false };
        let column = NUMBERS.iter().find(|column| column.name == name).unwrap_or(&density);
        let (least, most) = column.allowed;
        if !number.is_finite() || number < least || number > most || (column.whole && number.fract() != 0.0) {
            let what = if column.whole { "a whole number" } else { "a number" };
            let range = match column.allowed {
                ANY => String::new(),
                (f64::MIN_POSITIVE, _) => " above 0".into(),
                (least, f64::MAX) => format!(", {least} or more,"),
                (least, most) => format!(" from {least} to {most}"),
            };
            return Err(self.fault(name, format!("{what}{range} is needed")));
        }
        Ok(number)
    }

    fn count(self, name: &str) -> Result<usize, InputError> {
        Ok(self.number(name)?.unwrap_or(0.0) as usize)
    }

    fn densities(self) -> Result<BTreeMap<String, f64>, InputError> {
        let mut densities = BTreeMap::new();
        for column in &self.table.columns {
            let Some(species) = column.name.strip_prefix(DENSITY) else { continue };
            if let Some(density) = self.number(&column.name)? {
                densities.insert(species.to_string(), density);
            }
        }
        Ok(densities)
    }
}

impl Value<Section> {
    /// The section, given or from an HDU's header.
    pub fn of(&self, hdu: &Hdu) -> Result<Section, InputError> {
        match self {
            Value::Given(section) => Ok(*section),
            Value::Keyword(keyword) => {
                let refusal = |problem: String| InputError {
                    place: Some(hdu.to_string()),
                    ..InputError::new(String::new(), problem)
                };
                let text = hdu
                    .read_text(keyword)
                    .map_err(|error| refusal(error.problem))?
                    .ok_or_else(|| refusal(format!("its header has no {keyword}")))?;
                text.parse().map_err(|problem: String| refusal(format!("{keyword} = '{text}': {problem}")))
            }
        }
    }
}
