//! Files of other programs that are given as tables, recognised by their first bytes.

/// How a kind of file begins, what it is, and what to do with it.
const KINDS: [(&[u8], &str, &str); 18] = [
    (b"\x1f\x8b", "compressed by gzip", UNPACK),
    (b"\x28\xb5\x2f\xfd", "compressed by zstd", UNPACK),
    (b"\xfd7zXZ\0", "compressed by xz", UNPACK),
    (b"BZh91AY", "compressed by bzip2", UNPACK),
    (b"PK\x03\x04", "a spreadsheet (.xlsx, .ods), or another archive in zip format", SHEET),
    (b"\xd0\xcf\x11\xe0", "a spreadsheet (.xls)", SHEET),
    (
        b"SIMPLE  =",
        "a FITS file",
        "write its table as ECSV: Table.read(\"a.fits\").write(\"a.ecsv\"); of frames, `ctiplan measure` makes measurements",
    ),
    (b"\x89HDF", "an HDF5 file", AS_ECSV),
    (b"ARROW1", "an Arrow or Feather file", AS_ECSV),
    (b"\x93NUMPY", "an array of numpy", AS_ECSV),
    (b"<?xml", "an XML file, such as a VOTable", AS_ECSV),
    (b"<VOTABLE", "a VOTable", AS_ECSV),
    (b"<!DOCTYPE", "a web page", "download the table itself"),
    (b"<html", "a web page", "download the table itself"),
    (b"%PDF", "a PDF file", SHEET),
    (b"SQLite format 3", "a database of SQLite", AS_ECSV),
    (b"{", "JSON", AS_ECSV),
    (b"PAR1", "a Parquet file, which is not read here", AS_ECSV),
];

const UNPACK: &str = "unpack it first";
const SHEET: &str = "save the table as CSV, with a decimal point";
const AS_ECSV: &str = "write its table as ECSV with astropy, Table(...).write(\"a.ecsv\"), or as CSV";

/// What is wrong with a file that another program made, and what to try. None if it may be text.
pub(crate) fn kind(bytes: &[u8]) -> Option<(String, &'static str)> {
    let found = KINDS.iter().find(|(begin, ..)| bytes.starts_with(begin));
    found.map(|(_, what, help)| (format!("the file is {what}"), *help))
}
