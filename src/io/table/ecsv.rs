//! The header of ECSV, and the datatypes of its cells.

use saphyr::{LoadableYamlNode, MarkedYaml, YamlData};
use serde_json::Value;

use super::columns::{Cell, Column, Datatype, Meta, PARTS, Table, float, scalar};
use super::{csv, serialized};
use crate::error::{InputError, nearest};

/// Maximum nesting of lists and mappings in a header, since the YAML parser is recursive. (For those in brackets, the parser itself
/// allows 255.)
const MAX_DEPTH: usize = 64;

/// The version in a file, if its first line is that of ECSV.
pub(super) fn version(line: &str) -> Option<&str> {
    line.trim().strip_prefix('#')?.trim_start().strip_prefix("%ECSV").map(str::trim)
}

impl Table {
    pub(super) fn read_ecsv(&mut self, text: &str) -> Result<(), InputError> {
        let yaml = self.header(text)?;
        let skip = yaml.lines().count();
        let documents = MarkedYaml::load_from_str(&yaml).map_err(|error| {
            let line = error.marker().line().min(skip);
            self.refuse_line(text, line, format!("the header is not YAML: {}", error.info()))
                .with_help("braces and quotes must be closed; words that hold a colon or # must be in quotes")
        })?;
        let lines: Vec<&str> = yaml.lines().collect();
        let source = Source { table: self, text, yaml: &lines };
        let [document] = documents.as_slice() else {
            return Err(self.refuse("the header must be one document of YAML, begun by `# ---`"));
        };
        let delimiter = source.delimiter(document)?;
        let columns = source.columns(document)?;
        let meta = source.meta(document)?;
        (self.columns, self.meta) = (columns, meta);

        let mut rows = csv::rows(text, skip, delimiter);
        let names = self.names(rows.next(), text)?;
        self.check_columns(&names, text)?;
        self.check_names()?;
        // If the mask is a separate column, an empty cell is an empty text, not a missing one.
        let parts = self.meta(PARTS).cloned();
        let masked = |column: &Column| match &parts {
            Some(Cell::Other(parts)) => {
                parts[&column.name]["__class__"].as_str().is_some_and(|class| class.ends_with("MaskedColumn"))
            }
            _ => false,
        };
        let empties: Vec<bool> =
            self.columns.iter().map(|column| column.datatype == Datatype::Text && masked(column)).collect();
        let records = self.records(rows, text)?;
        for (row, record) in records.into_iter().enumerate() {
            for ((column, text), empty) in self.columns.iter_mut().zip(record).zip(&empties) {
                let value = if text.is_empty() && !empty { Ok(Cell::Missing) } else { cell(&text, column) };
                match value {
                    Ok(value) => column.cells.push(value),
                    Err(problem) => {
                        let place =
                            Some(format!("line {}: {} = {}", self.lines[row], column.name, Cell::Text(text.clone())));
                        let point = text.replace(',', ".");
                        let help = (text.contains(',') && point.parse::<f64>().is_ok())
                            .then(|| format!("with a decimal point: {point}"));
                        return Err(InputError { place, help, ..self.refuse(problem) });
                    }
                }
            }
        }
        self.assemble()?;
        self.check_names()
    }

    /// Adds what the header of an ECSV file, kept elsewhere as YAML, says of the columns, and its `meta`.
    #[cfg(feature = "parquet")]
    pub(super) fn describe(&mut self, yaml: &str) -> Result<(), InputError> {
        let refused = |problem: &str| self.refuse(format!("its header of astropy cannot be read: {problem}"));
        let documents = MarkedYaml::load_from_str(yaml).map_err(|error| refused(error.info()))?;
        let lines: Vec<&str> = yaml.lines().collect();
        let source = Source { table: self, text: yaml, yaml: &lines };
        let document = documents.first().ok_or_else(|| refused("it is empty"))?;
        let described = source.columns(document).map_err(|error| refused(&error.problem))?;
        let meta = source.meta(document).map_err(|error| refused(&error.problem))?;
        for said in described {
            if let Some(column) = self.columns.iter_mut().find(|column| column.name == said.name) {
                let Column { unit, subtype, description, format, .. } = said;
                *column = Column { unit, subtype, description, format, ..std::mem::take(column) };
            }
        }
        self.meta = meta.into_iter().map(|meta| Meta { line: None, ..meta }).collect();
        self.assemble()
    }

    /// The header as YAML, with the line numbers of the file.
    fn header(&self, text: &str) -> Result<String, InputError> {
        let lines: Vec<&str> =
            text.lines().take_while(|line| line.trim().is_empty() || csv::is_comment(line)).collect();
        let first = lines.iter().position(|line| !line.trim().is_empty()).unwrap_or(0);
        let said = version(lines.get(first).unwrap_or(&"")).unwrap_or("");
        let mut parts = said.split('.');
        if !matches!((parts.next(), parts.next()), (Some("0"), Some("9")) | (Some("1"), Some("0"))) {
            let problem = format!("`{said}` is not a version of ECSV known here; known are 0.9 and 1.0");
            return Err(self.refuse_line(text, first + 1, problem));
        }
        let bodies: Vec<&str> = lines
            .iter()
            .enumerate()
            .map(|(index, line)| if index > first { line.trim().strip_prefix('#').unwrap_or("") } else { "" })
            .collect();
        let blanks = |line: &str| line.len() - line.trim_start_matches(' ').len();
        let indent = bodies.iter().filter(|line| !line.is_empty()).map(|line| blanks(line)).min().unwrap_or(0);
        let mut yaml = String::new();
        let mut depths = Vec::new();
        for (index, line) in bodies.iter().enumerate() {
            // Nesting increases with the indentation after blanks or list and key marks.
            for (column, mark) in line.char_indices().filter(|(_, mark)| !mark.is_whitespace()) {
                depths.truncate(depths.partition_point(|depth| *depth < column));
                depths.push(column);
                if !"-?:".contains(mark) || !line[column + 1..].starts_with([' ', '\t']) {
                    break;
                }
            }
            if depths.len() > MAX_DEPTH {
                return Err(self.refuse_line(text, index + 1, "the header is nested too deeply"));
            }
            yaml.push_str(line.get(indent..).unwrap_or(""));
            yaml.push('\n');
        }
        Ok(yaml)
    }

    /// Checks that the names above the rows are those of the header.
    fn check_columns(&self, names: &[String], text: &str) -> Result<(), InputError> {
        let differs = self.columns.iter().zip(names).position(|(column, name)| column.name != *name);
        let problem = match differs {
            _ if names.len() != self.columns.len() => {
                format!("the header describes {} columns, this line names {}", self.columns.len(), names.len())
            }
            Some(index) => {
                let (here, there) = (&names[index], &self.columns[index].name);
                format!("column {} is called `{here}` here and `{there}` in the header", index + 1)
            }
            None => return Ok(()),
        };
        let error = self.refuse_line(text, self.header_line, problem);
        match names {
            [only] => Err(match [',', ';', '\t', ' ', '|'].into_iter().find(|&mark| only.contains(mark)) {
                Some(mark) => {
                    error.with_help(format!("where `{mark}` delimits, the header must say so: # delimiter: '{mark}'"))
                }
                None => error,
            }),
            _ => Err(error),
        }
    }
}

/// A key, its line and its value.
type Entry<'n, 'y> = (String, usize, &'n MarkedYaml<'y>);

/// A header, for messages about it.
#[derive(Clone, Copy)]
struct Source<'a> {
    table: &'a Table,
    text: &'a str,
    /// The lines of the header as YAML.
    yaml: &'a [&'a str],
}

impl Source<'_> {
    /// An error at a node.
    fn fault(self, node: &MarkedYaml, problem: impl Into<String>) -> InputError {
        self.table.refuse_line(self.text, node.span.start.line(), problem)
    }

    fn delimiter(self, document: &MarkedYaml) -> Result<char, InputError> {
        let Some(node) = document.data.as_mapping_get("delimiter") else { return Ok(' ') };
        let mut written = node.data.as_str().unwrap_or("").chars();
        match (written.next(), written.next()) {
            (Some(mark), None) if !mark.is_alphanumeric() && !"\"#+-._\r\n".contains(mark) => Ok(mark),
            _ => Err(self.fault(node, "the delimiter must be one mark in quotes, such as ',' or ' '")),
        }
    }

    fn columns(self, document: &MarkedYaml) -> Result<Vec<Column>, InputError> {
        let Some(node) = document.data.as_mapping_get("datatype") else {
            return Err(self
                .table
                .refuse("the header does not describe the columns: `datatype` is missing")
                .with_help("below a line `# datatype:`, one for each column: # - {name: value, datatype: float64}"));
        };
        match node.data.as_sequence() {
            Some(columns) if !columns.is_empty() => columns.iter().map(|node| self.column(node)).collect(),
            _ => Err(self.fault(node, "`datatype` must be a list of columns")),
        }
    }

    fn column(self, node: &MarkedYaml) -> Result<Column, InputError> {
        let needed = |key| {
            let missing = format!("a column needs a `{key}`, such as {{name: value, datatype: float64}}");
            self.word(node, key)?.ok_or_else(|| self.fault(node, missing))
        };
        let column = Column {
            name: needed("name")?,
            unit: self.word(node, "unit")?.filter(|unit| !unit.is_empty()),
            datatype: self.datatype(node, &needed("datatype")?)?,
            subtype: self.word(node, "subtype")?,
            description: self.word(node, "description")?,
            format: self.word(node, "format")?,
            time: None,
            cells: Vec::new(),
            line: Some(node.span.start.line()),
        };
        if column.is_nested() && column.datatype != Datatype::Text {
            return Err(self.fault(node, "a column with this subtype must have the datatype string"));
        }
        Ok(column)
    }

    /// The text of a column under a key. A YAML number may be text here.
    fn word(self, node: &MarkedYaml, key: &str) -> Result<Option<String>, InputError> {
        let Some(node) = node.data.as_mapping_get(key) else { return Ok(None) };
        match self.value(node)? {
            Value::Null => Ok(None),
            Value::String(word) => Ok(Some(word)),
            Value::Number(_) | Value::Bool(_) => Ok(Some(self.written(node))),
            _ => Err(self.fault(node, format!("the `{key}` of a column must be a word"))),
        }
    }

    fn datatype(self, node: &MarkedYaml, name: &str) -> Result<Datatype, InputError> {
        const KNOWN: [(&str, Datatype); 14] = [
            ("bool", Datatype::Bool),
            ("int8", Datatype::Int(8)),
            ("int16", Datatype::Int(16)),
            ("int32", Datatype::Int(32)),
            ("int64", Datatype::Int(64)),
            ("uint8", Datatype::Uint(8)),
            ("uint16", Datatype::Uint(16)),
            ("uint32", Datatype::Uint(32)),
            ("uint64", Datatype::Uint(64)),
            ("float16", Datatype::Float(16)),
            ("float32", Datatype::Float(32)),
            ("float64", Datatype::Float(64)),
            ("float128", Datatype::Float(128)),
            ("string", Datatype::Text),
        ];
        // numpy type names that astropy also writes, or wrote.
        const WORDS: [&str; 6] = ["datetime64", "str", "unicode", "bytes", "object", "complex"];
        if let Some((_, datatype)) = KNOWN.iter().find(|(known, _)| *known == name) {
            return Ok(*datatype);
        }
        if WORDS.iter().any(|word| name.starts_with(word)) {
            return Ok(Datatype::Text);
        }
        let known = KNOWN.map(|(known, _)| known);
        let problem = format!("there is no datatype `{name}`; there are: {}", known.join(", "));
        let near = nearest(name, known)
            .map_or("measured values are float64".to_string(), |near| format!("did you mean {near}?"));
        Err(self.fault(node, problem).with_help(near))
    }

    fn meta(self, document: &MarkedYaml) -> Result<Vec<Meta>, InputError> {
        let Some(node) = document.data.as_mapping_get("meta").filter(|node| !node.data.is_null()) else {
            return Ok(Vec::new());
        };
        let entries = self.entries(node, true)?.ok_or_else(|| self.fault(node, "`meta` must be keys with values"))?;
        entries
            .into_iter()
            .map(|(name, line, node)| {
                let value = match &node.data {
                    YamlData::Value(value) => scalar(value),
                    _ => Cell::from(self.value(node)?),
                };
                Ok(Meta { name, value, line: Some(line) })
            })
            .collect()
    }

    /// Keys, their lines and values, of a mapping or of an ordered one, which YAML writes as a list of mappings of one key each.
    /// None if the node is neither; if an ordered mapping is expected, its tag may be missing.
    fn entries<'n, 'y>(
        self,
        node: &'n MarkedYaml<'y>,
        expected: bool,
    ) -> Result<Option<Vec<Entry<'n, 'y>>>, InputError> {
        let pairs: Vec<_> = match &node.data {
            YamlData::Mapping(pairs) => pairs.iter().collect(),
            YamlData::Sequence(members) => {
                let pair = |member: &'n MarkedYaml<'y>| match member.data.as_mapping() {
                    Some(pair) if pair.len() == 1 => pair.iter().next(),
                    _ => None,
                };
                match members.iter().map(pair).collect() {
                    Some(pairs) if expected || self.is_ordered(node) => pairs,
                    _ => return Ok(None),
                }
            }
            _ => return Ok(None),
        };
        let entry = |(key, value): (&'n MarkedYaml<'y>, &'n MarkedYaml<'y>)| {
            let name = match self.value(key)? {
                Value::String(name) => name,
                Value::Number(_) | Value::Bool(_) | Value::Null => self.written(key),
                _ => return Err(self.fault(key, "a key must be a word")),
            };
            Ok((name, key.span.start.line(), value))
        };
        pairs.into_iter().map(entry).collect::<Result<_, _>>().map(Some)
    }

    /// A node as JSON. For astropy's own objects, a unit is its name and a time its date.
    fn value(self, node: &MarkedYaml) -> Result<Value, InputError> {
        Ok(match &node.data {
            YamlData::Value(value) => match scalar(value) {
                Cell::Missing => Value::Null,
                Cell::Truth(truth) => truth.into(),
                Cell::Integer(integer) => integer.into(),
                Cell::Number(number) if number.is_finite() => number.into(),
                Cell::Number(number) => float(number).into(),
                Cell::Text(text) => text.into(),
                Cell::Other(value) => value,
            },
            YamlData::Tagged(tag, inner) => match (tag.suffix.as_ref(), self.value(inner)?) {
                ("astropy.units.Unit", Value::Object(mut unit)) if unit.contains_key("unit") => unit["unit"].take(),
                (tag, Value::Object(parts)) => serialized::of_meta(tag, &parts).unwrap_or(Value::Object(parts)),
                (_, value) => value,
            },
            data => match (self.entries(node, false)?, data) {
                (Some(entries), _) => Value::Object(
                    entries
                        .into_iter()
                        .map(|(name, _, node)| Ok((name, self.value(node)?)))
                        .collect::<Result<_, InputError>>()?,
                ),
                (None, YamlData::Sequence(members)) => {
                    Value::Array(members.iter().map(|member| self.value(member)).collect::<Result<_, _>>()?)
                }
                _ => self.written(node).into(),
            },
        })
    }

    /// Whether a list is tagged as an ordered mapping. The parser drops tags of YAML itself.
    fn is_ordered(self, node: &MarkedYaml) -> bool {
        let written = self.written(node);
        written.split_whitespace().take_while(|word| word.starts_with(['!', '&'])).any(|word| word == "!!omap")
    }

    /// The first line of a node as written.
    fn written(self, node: &MarkedYaml) -> String {
        let (start, end) = (node.span.start, node.span.end);
        let line = self.yaml.get(start.line().saturating_sub(1)).copied().unwrap_or("");
        let length = if end.line() == start.line() { end.col().saturating_sub(start.col()) } else { usize::MAX };
        line.chars().skip(start.col()).take(length).collect()
    }
}

/// The value of a cell that is not empty, or its fault.
fn cell(text: &str, column: &Column) -> Result<Cell, String> {
    let wrong = |what: &str| format!("the header says {}, and this is not {what}", column.datatype.name());
    match column.datatype {
        Datatype::Text if column.is_nested() => {
            let subtype = column.subtype.as_deref().unwrap_or("");
            let value = json(text).filter(|value| subtype == "json" || value.is_array());
            value.map(Cell::Other).ok_or_else(|| format!("the header says {subtype}, and this is not such JSON"))
        }
        Datatype::Text => Ok(Cell::Text(text.to_string())),
        Datatype::Float(_) => text.parse().map(Cell::Number).map_err(|_| wrong("a number")),
        Datatype::Bool => match text {
            "True" | "true" | "1" => Ok(Cell::Truth(true)),
            "False" | "false" | "0" => Ok(Cell::Truth(false)),
            _ => Err(wrong("True or False")),
        },
        Datatype::Int(bits) | Datatype::Uint(bits) => {
            let integer: i128 = text.parse().map_err(|_| wrong("a whole number"))?;
            let (least, beyond) = match column.datatype {
                Datatype::Uint(_) => (0, 1_i128 << bits),
                _ => (-(1_i128 << (bits - 1)), 1_i128 << (bits - 1)),
            };
            if !(least..beyond).contains(&integer) {
                return Err(wrong(&format!("whole number from {least} to {}", beyond - 1)));
            }
            Ok(i64::try_from(integer).map_or_else(|_| Cell::Other((integer as u64).into()), Cell::Integer))
        }
    }
}

/// JSON in Python's notation: NaN and Infinity, which JSON lacks, become words.
fn json(text: &str) -> Option<Value> {
    const CONSTANTS: [(&str, &str); 3] = [("NaN", "\"nan\""), ("-Infinity", "\"-inf\""), ("Infinity", "\"inf\"")];
    if let Ok(value) = serde_json::from_str(text) {
        return Some(value);
    }
    let mut out = String::new();
    let mut rest = text;
    let (mut quoted, mut escaped) = (false, false);
    while let Some(c) = rest.chars().next() {
        let constant = CONSTANTS.iter().find(|(constant, _)| !quoted && rest.starts_with(constant));
        let (read, written) = constant.copied().unwrap_or((&rest[..c.len_utf8()], &rest[..c.len_utf8()]));
        quoted ^= c == '"' && !escaped;
        escaped = c == '\\' && !escaped;
        out.push_str(written);
        rest = &rest[read.len()..];
    }
    serde_json::from_str(&out).ok()
}
