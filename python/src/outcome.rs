//! A result: what is printed, drawn and read of it.

use ctiplan::error::InputError;
use ctiplan::mission;
use ctiplan::report::plot::{self, Figure};
use ctiplan::report::{Format, Page, page};
use pyo3::prelude::*;

use crate::mission::Mission;
use crate::work;

/// A result of any kind.
trait Shown: Send + Sync {
    fn show(&self, format: Format) -> String;
    fn page(&self, missions: &[mission::Mission]) -> String;
    fn figures(&self) -> Vec<(String, Figure)>;
}

impl<P: Page + Send + Sync> Shown for P {
    fn show(&self, format: Format) -> String {
        self.render(format)
    }

    fn page(&self, missions: &[mission::Mission]) -> String {
        page(self, missions)
    }

    fn figures(&self) -> Vec<(String, Figure)> {
        Page::figures(self)
    }
}

/// A result, with the missions that it is of.
#[pyclass(frozen, module = "ctiplan._ctiplan")]
pub struct Outcome {
    result: Box<dyn Shown>,
    missions: Vec<mission::Mission>,
    /// With fitted values and added effects.
    found: Option<mission::Mission>,
}

impl Outcome {
    /// A result of these missions.
    pub fn of(result: impl Page + Send + Sync + 'static, missions: Vec<mission::Mission>) -> Outcome {
        Outcome { result: Box::new(result), missions, found: None }
    }

    /// The same with the mission that was found.
    pub fn with(self, found: mission::Mission) -> Outcome {
        Outcome { found: Some(found), ..self }
    }
}

#[pymethods]
impl Outcome {
    fn text(&self, py: Python<'_>) -> PyResult<String> {
        work::run(py, None, |_| Ok(self.result.show(Format::Text)))
    }

    fn json(&self, py: Python<'_>) -> PyResult<String> {
        work::run(py, None, |_| Ok(self.result.show(Format::Json)))
    }

    fn csv(&self, py: Python<'_>) -> PyResult<String> {
        work::run(py, None, |_| Ok(self.result.show(Format::Csv)))
    }

    /// The page of `--html`.
    fn page(&self, py: Python<'_>) -> PyResult<String> {
        work::run(py, None, |_| Ok(self.result.page(&self.missions)))
    }

    /// Figures by the names of their files, in a file format (svg, pdf, png).
    fn figures(&self, py: Python<'_>, format: &str) -> PyResult<Vec<(String, Vec<u8>)>> {
        let known = plot::Format::ALL
            .iter()
            .copied()
            .find(|known| known.ending() == format)
            .ok_or_else(|| InputError::new(format!("cannot draw as \"{format}\""), "allowed: svg, pdf, png"));
        let draw = |format: plot::Format| {
            let named =
                |(name, figure): (String, Figure)| (name.trim_end_matches(".svg").to_string(), figure.to(format));
            self.result.figures().into_iter().map(named).collect()
        };
        work::run(py, None, |_| known.map(draw))
    }

    /// The mission with fitted values, after a diagnosis with the added effects as well.
    fn found(&self) -> Option<Mission> {
        self.found.clone().map(Mission)
    }
}
