//! Tables of measurements as astropy writes them, beside what astropy reads from them, and broken ones.

use std::fs;
use std::path::{Path, PathBuf};

use ctiplan::io::table::{Cell, Table};
use serde_json::Value;

fn files(folder: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/measurements").join(folder);
    let mut files: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "ecsv" || extension == "csv"));
    files.sort();
    assert!(files.len() > 10);
    files
}

fn name(path: &Path) -> &str {
    path.file_name().unwrap().to_str().unwrap()
}

/// A cell as the JSON beside the files says it.
fn plain(cell: &Cell) -> Value {
    match cell {
        Cell::Missing => Value::Null,
        Cell::Number(number) if number.is_nan() => "nan".into(),
        Cell::Number(number) if number.is_infinite() => number.to_string().into(),
        Cell::Number(number) => (*number).into(),
        Cell::Integer(integer) => (*integer).into(),
        Cell::Truth(truth) => (*truth).into(),
        Cell::Text(text) => text.as_str().into(),
        Cell::Other(value) => value.clone(),
    }
}

#[test]
fn tables_hold_what_astropy_reads() {
    for path in files("") {
        let file = name(&path);
        let table = Table::read(&path).unwrap_or_else(|error| panic!("{error}"));
        let expected: Value = serde_json::from_str(&fs::read_to_string(path.with_extension("json")).unwrap()).unwrap();

        let meta = expected["meta"].as_object().unwrap();
        assert!(table.meta.iter().map(|meta| &meta.name).eq(meta.keys()), "{file}: {:?}", table.meta);
        for (key, expected) in meta {
            let found = table.meta(key).unwrap();
            match (file, key.as_str()) {
                // A number without sign in its exponent is a word in YAML 1.1, which nobody means.
                ("hand_exponent.ecsv", "dose_mev_g") => assert_eq!(*found, Cell::Number(1.0e7)),
                // astropy writes these ends of lines, but does not read them.
                ("meta_newline.ecsv", "log") => {
                    assert_eq!(found.text(), Some("first line\nsecond: line\n\nafter a blank line\n"))
                }
                // A numpy array stays in Base64.
                ("meta_quantities.ecsv", "bias_levels") => assert!(plain(found)["buffer"].is_string()),
                _ => assert_eq!(plain(found), *expected, "{file}: meta.{key}"),
            }
        }

        let columns = expected["columns"].as_array().unwrap();
        assert_eq!(table.columns.len(), columns.len(), "{file}");
        for (column, expected) in table.columns.iter().zip(columns) {
            let at = format!("{file}: {}", column.name);
            assert_eq!(column.name, expected["name"].as_str().unwrap(), "{at}");
            assert_eq!(column.unit.as_deref(), expected["unit"].as_str(), "{at}");
            assert_eq!(column.subtype.as_deref(), expected["subtype"].as_str(), "{at}");
            let datatype = expected["datatype"].as_str().unwrap();
            let datatype = if datatype.starts_with("datetime64") { "string" } else { datatype };
            assert_eq!(column.datatype.name(), datatype, "{at}");
            let time = column.time.as_ref();
            assert_eq!(time.map(|time| time.format.as_str()), expected["time"]["format"].as_str(), "{at}");
            assert_eq!(time.map(|time| time.scale.as_str()), expected["time"]["scale"].as_str(), "{at}");
            let values = expected["values"].as_array().unwrap();
            assert_eq!((column.cells.len(), table.lines.len()), (values.len(), values.len()), "{at}");
            for (cell, value) in column.cells.iter().zip(values) {
                match (time.map(|time| time.format.as_str()), cell) {
                    // astropy keeps times as Julian dates, which costs digits.
                    (Some("decimalyear"), Cell::Number(year)) => assert!((year - value.as_f64().unwrap()).abs() < 1e-7),
                    _ => assert_eq!(plain(cell), *value, "{at}"),
                }
            }
        }
    }
}

#[test]
fn a_table_that_is_written_is_read_again() {
    for path in files("") {
        let mut table = Table::read(&path).unwrap();
        let mut again = Table::parse(&table.name, &table.to_ecsv()).unwrap_or_else(|error| panic!("{error}"));
        for table in [&mut table, &mut again] {
            table.lines.clear();
            table.header_line = 0;
            table.meta.iter_mut().for_each(|meta| meta.line = None);
            table.columns.iter_mut().for_each(|column| column.line = None);
            for cell in table.columns.iter_mut().flat_map(|column| &mut column.cells) {
                // ECSV has no empty texts but where a mask says so.
                if *cell == Cell::Text(String::new()) {
                    *cell = Cell::Missing;
                }
            }
        }
        // As text, since NaN is not equal to itself.
        assert_eq!(format!("{table:#?}"), format!("{again:#?}"), "{}", name(&path));
    }
}

/// Files that are no tables, with the line and the beginning of what is said of it. The others in the folder are
/// tables, and wrong as measurements.
const BROKEN: [(&str, &str, &str); 20] = [
    ("bad_yaml.ecsv", "line 10: # meta: observable: {", "the header is not YAML: mapping values are not allowed"),
    ("decimal_comma.ecsv", "line 13: value = \"0,0031\"", "the header says float64, and this is not a number"),
    ("duplicate_column.ecsv", "line 9: column value", "duplicate name `value`"),
    ("empty_file.ecsv", "", "the file is empty"),
    ("end_of_line_in_a_key.ecsv", "line 7: meta.", "the key holds an end of a line, a tab or another control"),
    ("header_only.ecsv", "", "there is no line with the names of the columns"),
    ("header_unclosed.ecsv", "line 11: # schema: astropy-2.0", "the header is not YAML"),
    ("meta_is_a_list.ecsv", "line 10: # meta: [observable, trail]", "`meta` must be keys with values"),
    ("no_names.csv", "line 6: 2.0,1,", "the first line must name the columns, and `2.0` is a number"),
    ("not_a_number.ecsv", "line 13: value = \"0.0O3\"", "the header says float64, and this is not a number"),
    ("not_an_integer.ecsv", "line 13: trail_px = \"one\"", "the header says int64, and this is not a whole number"),
    ("not_ecsv_version.ecsv", "line 1: # %ECSV one", "`one` is not a version of ECSV known here"),
    ("other_names_in_header.ecsv", "line 12: ", "column 4 is called `sigma` here and `value` in the header"),
    ("ragged_row.csv", "line 7: 2.0,1,", "6 cells, where line 6 names 5 columns"),
    ("ragged_row.ecsv", "line 13: 2.0,1000.0,1,", "6 cells, where line 12 names 5 columns"),
    ("short_row.ecsv", "line 13: 2.0,1000.0,1,", "4 cells, where line 12 names 5 columns"),
    ("unknown_datatype.ecsv", "line 7: # - {name: value,", "there is no datatype `real`; there are: bool, int8"),
    ("unknown_delimiter.ecsv", "line 12: ", "the header describes 5 columns, this line names 1"),
    ("utf16.ecsv", "line 1", "the file is not text in UTF-8"),
    ("wrong_count_of_datatypes.ecsv", "line 11: ", "the header describes 4 columns, this line names 5"),
];

#[test]
fn what_is_no_table_is_refused_with_its_line() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/measurements/broken");
    for (file, place, problem) in BROKEN {
        let path = folder.join(file);
        let error = Table::read(&path).expect_err(file);
        assert_eq!(error.refused, format!("cannot use measurements `{}`", path.display()));
        assert!(error.place.as_deref().unwrap_or("").starts_with(place), "{error}");
        assert!(error.problem.starts_with(problem), "{error}");
    }
    let error = Table::read(folder.join("wrong_delimiter.ecsv")).unwrap_err();
    assert!(error.help.unwrap().contains("# delimiter: ','"));
    for path in files("broken") {
        let refused = BROKEN.iter().any(|(file, ..)| *file == name(&path)) || name(&path) == "wrong_delimiter.ecsv";
        assert_eq!(Table::read(&path).is_err(), refused, "{}", path.display());
    }
    assert_eq!(Table::read(folder.join("none.ecsv")).unwrap_err().problem, "there is no such file");
}

/// Damaged files are read or refused, never a reason to stop. The environment variable FUZZ says how many to try.
#[test]
fn no_damage_to_a_file_stops_the_reader() {
    let texts: Vec<Vec<char>> =
        files("").iter().map(|path| fs::read_to_string(path).unwrap().chars().collect()).collect();
    let marks: Vec<char> = " ,;:#-?{}[]\"'\n\t\r0129eE.+*&!|>%\\~aµ銀".chars().collect();
    // A linear congruential generator is random enough, and the same everywhere.
    let mut state = 1_u64;
    let mut draw = |below: usize| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize % below.max(1)
    };
    let inputs = std::env::var("FUZZ").ok().and_then(|count| count.parse().ok()).unwrap_or(5_000);
    for _ in 0..inputs {
        let mut text = texts[draw(texts.len())].clone();
        for _ in 0..1 + draw(5) {
            let (from, length) = (draw(text.len()), draw(12));
            let until = (from + length).min(text.len());
            let piece: Vec<char> = match draw(5) {
                0 => Vec::new(),
                1 => vec![marks[draw(marks.len())]],
                2 => text[from..until].repeat(2 + draw(3)),
                3 => (0..draw(6)).map(|_| marks[draw(marks.len())]).collect(),
                _ => {
                    let other = &texts[draw(texts.len())];
                    let start = draw(other.len());
                    other[start..(start + draw(80)).min(other.len())].to_vec()
                }
            };
            text.splice(from..until, piece);
        }
        let text: String = text.into_iter().collect();
        match Table::parse("damaged", &text) {
            Ok(table) => {
                assert!(table.columns.iter().all(|column| column.cells.len() == table.lines.len()));
                for row in [None, Some(0), Some(table.rows())] {
                    table.columns.iter().for_each(|column| drop(table.fault(row, Some(&column.name), "wrong")));
                }
                table.to_ecsv();
            }
            Err(error) => assert!(!error.problem.is_empty()),
        }
    }
}
