//! A data set and its model in the JSON document that `ctiplan validate` prints.

use serde::ser::{Serialize, Serializer};

use super::result::SetResult;
use crate::physics::observable::Observable;

#[derive(serde::Serialize)]
struct Set<'a> {
    file: &'a str,
    observable: Observable,
    n: usize,
    chi2: f64,
    rms: f64,
    rms_sigma: f64,
    bias_sigma: f64,
    scatter_sigma: f64,
    rows: Vec<Row>,
}

#[derive(serde::Serialize)]
struct Row {
    value: f64,
    sigma: f64,
    model: f64,
}

impl Serialize for SetResult {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let rows = self.data.rows.iter().zip(&self.model);
        let set = Set {
            file: &self.data.file,
            observable: self.data.observable,
            n: self.data.rows.len(),
            chi2: self.chi2,
            rms: self.rms,
            rms_sigma: self.rms_sigma(),
            bias_sigma: self.bias_sigma,
            scatter_sigma: self.scatter_sigma,
            rows: rows.map(|(row, model)| Row { value: row.value, sigma: row.sigma, model: *model }).collect(),
        };
        set.serialize(to)
    }
}
