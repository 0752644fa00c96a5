//! Points in time and tables as users have them: offsets from UTC, other notations, Parquet, spreadsheets, files that are no tables.

use std::fs;
use std::path::Path;

use ctiplan::analysis::measurement::DataSet;
use ctiplan::io::radiation_file::read_dose_history;
use ctiplan::io::table::Table;
use ctiplan::mission::Mission;

fn mission() -> Mission {
    Mission::read("missions/snap_l2.toml").unwrap()
}

fn dated(column: &str, cell: &str) -> Result<f64, String> {
    let text = format!("# observable: dose\n{column},value,sigma\n{cell},1e6,1e4\n");
    let set = Table::parse("dated.csv", &text).and_then(|table| DataSet::of(table, &mission()));
    set.map(|set| set.rows[0].at.t_yr).map_err(|error| error.to_string())
}

#[test]
fn a_point_in_time_is_the_same_in_every_notation() {
    let noon = dated("date", "2010-06-01T12:00:00").unwrap();
    for same in [
        "2010-06-01 12:00:00",
        "2010-06-01T12:00",
        "2010-06-01T12:00:00.000",
        "2010-06-01T12:00:00Z",
        "2010-06-01 12:00:00+00:00",
        "2010-06-01T12:00:00.000000+0000",
        "2010-06-01T14:00:00+02:00",
        "2010-06-01T14:00+02",
        "2010-06-01 07:00:00 -05:00",
        "2010-06-01T17:30:00+05:30",
        "2010:152:12:00:00",
        "2010:152:12:00:00.000",
    ] {
        assert_eq!(dated("date", same), Ok(noon), "{same}");
    }
    // The length of a year of 365.25 d from J2000.0, 2000-01-01 12:00.
    assert!((dated("date", "J2010.5").unwrap() - dated("date", "2010-07-02T15:00:00").unwrap()).abs() < 1e-9);
    assert_eq!(dated("mjd", "55348.5"), Ok(noon));
    assert_eq!(dated("jd", "2455349.0"), Ok(noon));
}

#[test]
fn a_date_in_another_notation_is_refused_with_the_date_that_is_meant() {
    for (column, cell, said) in [
        ("date", "25.06.2030", "write 2030-06-25"),
        ("date", "01.06.2030", "write 2030-06-01"),
        ("date", "25/06/30", "write 2030-06-25"),
        ("date", "06/25/2030", "write 2030-06-25"),
        ("date", "05/06/30", "write 2030-06-05 or 2030-05-06, whichever is meant"),
        ("date", "05-06-2030", "write 2030-06-05 or 2030-05-06, whichever is meant"),
        ("date", "2030/06/01", "write 2030-06-01"),
        ("date", "20300601", "write 2030-06-01"),
        ("date", "2030-13-01", "there is no such day"),
        ("date", "0030-06-01", "not within the years 1900 to 2200"),
        ("date", "9999-06-01", "not within the years 1900 to 2200"),
        ("date", "2455349.0", "call the column jd"),
        ("date", "55348.5", "call the column mjd"),
        ("date", "2010.5", "a decimal year needs astropy's Time"),
        ("mjd", "2455349.0", "as a Julian date it would be: call the column jd"),
        ("jd", "55348.5", "as a modified Julian date it would be: call the column mjd"),
        ("mjd", "1e9", "not within the years 1900 to 2200"),
        ("mjd", "51000", "before launch, 2009-01-01"),
    ] {
        let refused = dated(column, cell).unwrap_err();
        assert!(refused.contains(said) && refused.contains(&format!("line 3: {column} = ")), "{cell}: {refused}");
        assert!(!refused.contains("neither a column"), "{cell}: {refused}");
        // A history has its dates read in the same way.
        if column == "date" {
            let file = tempfile::NamedTempFile::new().unwrap();
            fs::write(&file, format!("date,dose_mev_g\n{cell},0\n2031-01-01,1e6\n")).unwrap();
            let refused = read_dose_history(file.path()).unwrap_err().to_string();
            assert!(refused.contains(said), "{cell}: {refused}");
        }
    }
}

#[test]
fn parquet_of_every_origin_holds_the_same_measurements() {
    let folder = Path::new("tests/measurements/parquet");
    let expected = DataSet::read(folder.join("same.csv"), &mission()).unwrap();
    let mut files = 0;
    for entry in fs::read_dir(folder).unwrap() {
        let file = entry.unwrap().path();
        let set = DataSet::read(&file, &mission()).unwrap_or_else(|error| panic!("{error}"));
        let rows = |set: &DataSet| set.rows.iter().map(|row| (row.value, row.sigma)).collect::<Vec<_>>();
        assert_eq!(rows(&set), rows(&expected), "{}", file.display());
        for (row, expected) in set.rows.iter().zip(&expected.rows) {
            assert!((row.at.t_yr - expected.at.t_yr).abs() < 1e-9, "{}: {}", file.display(), row.at.t_yr);
        }
        assert_eq!(set.varying, ["t_yr"], "{}", file.display());
        files += 1;
    }
    assert!(files > 25, "{files}");
}

fn dose(text: &str) -> Result<Vec<(f64, f64, f64)>, String> {
    let set = Table::parse("dose.csv", text).and_then(|table| DataSet::of(table, &mission()));
    let set = set.map_err(|error| error.to_string())?;
    assert_eq!(set.varying, ["t_yr"], "{text}");
    Ok(set.rows.iter().map(|row| (row.at.t_yr, row.value, row.sigma)).collect())
}

#[test]
fn spreadsheets_of_all_countries_and_indexes_of_pandas_are_read() {
    let expected = dose("# observable: dose\nt_yr,value,sigma\n0.25,2665568.1,55000\n0.5,5436290.4,110000\n").unwrap();
    for same in [
        "# observable: dose\nt_yr;value;sigma\n0,25;2665568,1;55000,0\n0,5;5436290,4;110000\n",
        "# observable: dose\nt_yr\tvalue\tsigma\n0,25\t2665568,1\t55000\n0,5\t5,4362904e6\t110000\n",
        "# observable: dose\n,t_yr,value,sigma\n0,0.25,2665568.1,55000\n1,0.5,5436290.4,110000\n",
        "# observable: dose\nUnnamed: 0,t_yr,value,sigma\n0,0.25,2665568.1,55000\n1,0.5,5436290.4,110000\n",
        "# observable: dose\nt_yr,value,sigma,\n0.25,2665568.1,55000,\n0.5,5436290.4,110000,\n",
    ] {
        assert_eq!(dose(same).as_ref(), Ok(&expected), "{same}");
    }
    for (text, said) in [
        ("# observable: dose\nt_yr;value;sigma\n1;2,665;1,000\n", "may delimit decimals or thousands"),
        ("# observable: dose\nt_yr;value;sigma\n0.5;2,66;1,5\n", "others of the file have a point"),
        ("# observable: dose\n,value,sigma\n2030-06-01,1e6,1e4\n", "index=False"),
        ("# observable: dose\n,value,sigma\n3,1e6,1e4\n", "column 1 of 3 has no name"),
    ] {
        let refused = dose(text).unwrap_err();
        assert!(refused.contains(said), "{refused}");
    }
}

#[test]
fn an_empty_cell_is_not_a_missing_column() {
    let refusal = |text: &str| dose(&format!("# observable: dose\n{text}")).unwrap_err();
    for (text, cell) in [
        ("t_yr,value,sigma\n0.25,1e6,1e4\n,2e6,1e4\n", "line 4: t_yr = (empty)"),
        ("date,value,sigma\n2010-01-01,1e6,1e4\n,2e6,1e4\n", "line 4: date = (empty)"),
        ("mjd,value,sigma\n55500,1e6,1e4\n,2e6,1e4\n", "line 4: mjd = (empty)"),
    ] {
        let refused = refusal(text);
        assert!(refused.contains(cell) && refused.contains("` is empty in this row"), "{refused}");
        assert!(!refused.contains("neither"), "{refused}");
    }
    let absent = refusal("value,sigma\n1e6,1e4\n");
    assert!(absent.contains("`t_yr`, which is neither a column nor in meta"), "{absent}");
}

/// An ECSV file with one column besides `value` and `sigma`, in parts as astropy describes them.
fn of_class(class: &str, datatype: &str, cell: &str) -> String {
    format!(
        "# %ECSV 1.0\n# ---\n# datatype:\n# - {{name: t_yr, datatype: {datatype}}}\n# - {{name: value, datatype: float64}}\n\
         # - {{name: sigma, datatype: float64}}\n# delimiter: ','\n# meta: !!omap\n# - {{observable: dose}}\n\
         # - __serialized_columns__:\n#     t_yr:\n#       __class__: {class}\n\
         #       value: !astropy.table.SerializedColumn {{name: t_yr}}\n# schema: astropy-2.0\nt_yr,value,sigma\n{cell},1e6,1e4\n"
    )
}

#[test]
fn classes_of_astropy_are_read_or_refused_by_name() {
    let time_delta = |format: &str| format!("astropy.time.core.TimeDelta\n#       format: {format}");
    assert_eq!(dose_once(&of_class(&time_delta("jd"), "float64", "730.5")), Ok(2.0));
    let of_seconds = dose_once(&of_class(&time_delta("sec"), "float64", "63115200")).unwrap();
    // The factor is rounded, and so is the product.
    assert!((of_seconds / 2.0 - 1.0).abs() <= f64::EPSILON, "{of_seconds}");
    for (class, datatype, said) in [
        (time_delta("quantity_str"), "string", "it is a TimeDelta of astropy in a format that is not read"),
        ("astropy.coordinates.sky_coordinate.SkyCoord".into(), "float64", "it is a SkyCoord of astropy"),
        ("astropy.coordinates.earth.EarthLocation".into(), "float64", "it is a EarthLocation of astropy"),
        (
            "astropy.time.core.Time\n#       format: jyear\n#       scale: tt".into(),
            "float64",
            "it is a Time of astropy",
        ),
    ] {
        let refused = dose_once(&of_class(&class, datatype, "2010.5")).unwrap_err();
        assert!(refused.contains(said) && refused.contains("column t_yr") && refused.contains("help: "), "{refused}");
    }
    // A time difference in `meta` is one too.
    let meta = "# %ECSV 1.0\n# ---\n# datatype:\n# - {name: value, datatype: float64}\n# - {name: sigma, datatype: float64}\n\
                # meta: !!omap\n# - {observable: dose}\n# - t_yr: !astropy.time.TimeDelta {format: jd, jd1: 731.0, jd2: -0.5}\n\
                # schema: astropy-2.0\nvalue sigma\n1e6 1e4\n";
    assert_eq!(dose_once(meta), Ok(2.0));
}

fn dose_once(text: &str) -> Result<f64, String> {
    let set = Table::parse("class.ecsv", text).and_then(|table| DataSet::of(table, &mission()));
    set.map(|set| set.rows[0].at.t_yr).map_err(|error| error.to_string())
}

#[test]
fn files_of_other_programs_are_named() {
    let file = tempfile::NamedTempFile::new().unwrap();
    for (bytes, said) in [
        (&b"\x1f\x8b\x08\x00abc"[..], "compressed by gzip"),
        (b"PK\x03\x04abc", ".xlsx"),
        (b"\xd0\xcf\x11\xe0abc", ".xls"),
        (b"SIMPLE  =                    T", "FITS"),
        (b"\x89HDF\r\n", "HDF5"),
        (b"\x28\xb5\x2f\xfdabc", "zstd"),
        (b"<?xml version=\"1.0\"?><VOTABLE/>", "VOTable"),
        (b"{\"observable\": \"dose\"}", "JSON"),
    ] {
        fs::write(&file, bytes).unwrap();
        for refused in [Table::read(file.path()).unwrap_err(), read_dose_history(file.path()).unwrap_err()] {
            assert!(refused.problem.contains(said) && refused.help.is_some(), "{refused}");
        }
    }
}
