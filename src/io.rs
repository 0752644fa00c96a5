//! Files: what is read, what is written, and tables of all kinds.

pub mod atomic_file;
pub(crate) mod foreign;
pub(crate) mod input;
pub(crate) mod json;
pub mod radiation_file;
pub mod table;
pub(crate) mod unit;
