//! A sample of the posterior of the free parameters.
//!
//! ```text
//! ln p(θ | data) = −χ²(θ)/2 + constant      within the bounds of each key
//! ```
//!
//! The prior is flat in ln θ if a value must be above 0, otherwise in θ. An ensemble of walkers moves along the differences of two
//! others (differential evolution: ter Braak 2006, Stat. Comput. 16, 239) or by the affine-invariant stretch (Goodman & Weare 2010,
//! Comm. App. Math. Comp. Sci. 5, 65; Foreman-Mackey et al. 2013, PASP 125, 306), each with its own random numbers: the same seed
//! gives the same bits for any number of threads. Walkers start from linear theory and continue until the sample has the requested
//! number of independent draws and is 50 autocorrelation times long, or the evaluations are used up.

mod schedule;
mod summary;

use hammer_and_sample::{DifferentialEvolution, Mixture, Model as Target, Parallel, Stretch, sample};
use nalgebra::{Cholesky, DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;

use super::problem::{Problem, chi2};
use super::result::Fit;
use crate::analysis::measurement::DataSet;
use crate::error::InputError;
use crate::io::table::{Cell, Table};
use crate::model::Model;
use crate::numeric::parallel;
use crate::plan::mission_sample::{self, CONVERGED, DESCRIBES_DATA, EFFECTIVE_SAMPLES, FITTED_MISSION};

use schedule::{Schedule, kept};
pub use summary::{Marginal, Prior};

/// The sampler: name, source and version.
pub const SAMPLER: &str = "ensemble of walkers: differential evolution (ter Braak 2006) and stretch moves (Goodman & Weare \
                           2010), crate hammer-and-sample 0.6";

/// Minimum number of walkers, in total and per parameter.
const WALKERS: usize = 16;
const WALKERS_EACH: usize = 4;

/// Weights of the moves: differential evolution, which decorrelates faster, and the stretch, which copes with other shapes.
const DIFFERENTIAL: u32 = 2;
const STRETCHED: u32 = 1;

/// Scatter of the factor on a difference, so that walkers on a line can leave it (ter Braak 2006).
const JITTER: f64 = 1e-5;

/// Attempts to start a walker within the bounds, each half as far away as the previous one.
const TRIES: usize = 60;

/// Options of the sampling.
#[derive(Clone, Debug)]
pub struct Options {
    /// Requested number of draws.
    pub samples: usize,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Maximum number of evaluations of the model; by default 100 for each draw and at least 20 000.
    pub evaluations: Option<usize>,
}

/// A sample of the posterior.
#[derive(Clone, Debug, Serialize)]
pub struct Posterior {
    /// Seed of the random numbers.
    pub seed: u64,
    /// The sampler.
    pub sampler: &'static str,
    /// Number of walkers.
    pub walkers: usize,
    /// Steps of each walker, including the burn-in.
    pub steps: usize,
    /// Steps of the burn-in.
    pub burn_in_steps: usize,
    /// Evaluations of the model.
    pub evaluations: usize,
    /// Fraction of the moves that were accepted.
    pub acceptance: f64,
    /// Requested number of draws.
    pub wanted_samples: usize,
    /// Effective number of independent draws: the smallest of all parameters.
    pub effective_samples: f64,
    /// Whether walkers were followed for 50 autocorrelation times and the requested number of draws is independent.
    pub converged: bool,
    /// Each parameter.
    pub parameters: Vec<Marginal>,
    /// Correlation of two parameters, along the coordinates in which their priors are flat, `[[i, j]]`.
    pub correlation: Vec<Vec<f64>>,
    /// Draws, evenly chosen: values of the parameters, and the logarithm of the posterior.
    #[serde(skip)]
    pub draws: Vec<Vec<f64>>,
}

/// Samples the posterior of the parameters of a fit.
///
/// # Errors
/// If nothing was fitted.
pub fn posterior(
    model: &Model,
    data: &[DataSet],
    fit: &Fit,
    options: &Options,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Posterior, InputError> {
    if fit.parameters.is_empty() {
        return Err(InputError::new("cannot sample the posterior", "no key is free"));
    }
    let model = model.like(&fit.mission);
    let keys: Vec<String> = fit.parameters.iter().map(|fitted| fitted.key.clone()).collect();
    let problem = Problem::new(&model, data, &keys, progress, |_| true)?;
    let posterior = OfProblem { problem: &problem };
    let walkers = WALKERS.max(WALKERS_EACH * keys.len());
    let budget = options.evaluations.unwrap_or((100 * options.samples).max(20_000));
    let schedule = Schedule::new(walkers, options.samples, budget);
    let starts = posterior.starts(fit, walkers, options.seed);
    let (chain, accepted) = sample(&posterior, &moves(keys.len()), starts, schedule, Parallel);
    Ok(posterior.summary(&chain, walkers, accepted, options))
}

/// Moves of the walkers for a number of dimensions.
fn moves(dimensions: usize) -> Mixture<u32, (DifferentialEvolution, Stretch)> {
    // γ = 2.38/√(2 d), optimal for a normal distribution (ter Braak 2006).
    let differential = DifferentialEvolution::new(2.38 / (2.0 * dimensions as f64).sqrt(), JITTER);
    Mixture::from(((differential, DIFFERENTIAL), (Stretch::default(), STRETCHED)))
}

/// The posterior of a least-squares problem.
struct OfProblem<'a> {
    problem: &'a Problem<'a>,
}

impl Target for OfProblem<'_> {
    type Params = Vec<f64>;

    fn log_prob(&self, coordinates: &Vec<f64>) -> f64 {
        if !self.is_allowed(coordinates) {
            return f64::NEG_INFINITY;
        }
        // If the model has no value, the probability is zero.
        self.problem.residuals(&self.values(coordinates)).map_or(f64::NEG_INFINITY, |found| -0.5 * chi2(&found))
    }
}

impl OfProblem<'_> {
    fn is_allowed(&self, coordinates: &[f64]) -> bool {
        self.problem.parameters.iter().zip(coordinates).all(|(parameter, coordinate)| {
            let (low, high) = parameter.coordinates();
            (low..=high).contains(coordinate)
        })
    }

    fn values(&self, coordinates: &[f64]) -> Vec<f64> {
        let value = |(parameter, at): (&super::parameter::Parameter, &f64)| parameter.at_coordinate(*at);
        self.problem.parameters.iter().zip(coordinates).map(value).collect()
    }

    /// Starting points of the walkers: drawn from the normal distribution of linear theory, within the bounds.
    fn starts(&self, fit: &Fit, walkers: usize, seed: u64) -> impl Iterator<Item = (Vec<f64>, ChaCha8Rng)> {
        let n = fit.parameters.len();
        let fitted = || fit.parameters.iter().zip(&self.problem.parameters);
        let centre = DVector::from_iterator(n, fitted().map(|(fitted, known)| known.coordinate(fitted.value)));
        let errors = fitted().map(|(fitted, known)| known.coordinate_error(fitted.value, fitted.sigma));
        let errors = DVector::from_iterator(n, errors);
        let correlation = DMatrix::from_fn(n, n, |row, column| {
            fit.correlation[row][column].unwrap_or(if row == column { 1.0 } else { 0.0 })
        });
        let root = Cholesky::new(correlation).map_or(DMatrix::identity(n, n), |root| root.l());
        let start = |walker: usize| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream(walker as u64);
            let mut reach = 1.0;
            for _ in 0..TRIES {
                let normal = DVector::from_fn(n, |_, _| StandardNormal.sample(&mut random));
                let at: Vec<f64> =
                    (&centre + reach * errors.component_mul(&(&root * normal))).iter().copied().collect();
                if self.is_allowed(&at) {
                    return (at, random);
                }
                reach *= 0.5;
            }
            (centre.iter().copied().collect(), random)
        };
        (0..walkers).map(start).collect::<Vec<_>>().into_iter()
    }

    fn summary(&self, chain: &[Vec<f64>], walkers: usize, accepted: usize, options: &Options) -> Posterior {
        let steps = chain.len() / walkers;
        let after = kept(chain, walkers);
        let parameters: Vec<Marginal> = self
            .problem
            .parameters
            .iter()
            .enumerate()
            .map(|(place, parameter)| Marginal::of(parameter, place, after, walkers))
            .collect();
        let effective_samples = parameters.iter().map(|one| one.effective_samples).fold(f64::INFINITY, f64::min);
        let enough = effective_samples >= options.samples as f64;
        let count = options.samples.min(after.len());
        let chosen: Vec<&Vec<f64>> = (0..count).map(|index| &after[index * after.len() / count]).collect();
        let draw = |coordinates: &Vec<f64>| {
            let mut draw = self.values(coordinates);
            draw.push(self.log_prob(coordinates));
            draw
        };
        Posterior {
            seed: options.seed,
            sampler: SAMPLER,
            walkers,
            steps,
            burn_in_steps: steps - after.len() / walkers,
            evaluations: chain.len() + walkers,
            acceptance: accepted as f64 / chain.len() as f64,
            wanted_samples: options.samples,
            effective_samples,
            converged: enough && parameters.iter().all(Marginal::is_long_enough),
            correlation: summary::correlation(after),
            parameters,
            draws: parallel::map(chosen, draw),
        }
    }
}

impl Posterior {
    /// The draws as a table, with the fit that they belong to and the names of its data files.
    pub fn table(&self, fit: &Fit, data: &[String]) -> Table {
        let keys: Vec<(&str, &str)> = self.parameters.iter().map(|one| (one.key.as_str(), one.unit)).collect();
        let words = |words: &str| Cell::Text(words.into());
        let whole = |number: usize| Cell::Integer(number as i64);
        let meta = vec![
            ("mission", words(&fit.mission.mission.name)),
            (FITTED_MISSION, words(&fit.mission.to_toml())),
            ("data", Cell::Other(data.into())),
            ("sampler", words(self.sampler)),
            ("prior", Cell::Other(self.parameters.iter().map(|one| one.prior.to_string()).collect::<Vec<_>>().into())),
            ("chi2", Cell::Number(fit.chi2)),
            ("degrees_of_freedom", whole(fit.degrees_of_freedom())),
            (DESCRIBES_DATA, Cell::Truth(fit.describes_data())),
            ("seed", Cell::Integer(self.seed as i64)),
            ("walkers", whole(self.walkers)),
            ("steps", whole(self.steps)),
            ("burn_in_steps", whole(self.burn_in_steps)),
            ("evaluations", whole(self.evaluations)),
            (EFFECTIVE_SAMPLES, Cell::Number(self.effective_samples.round())),
            (CONVERGED, Cell::Truth(self.converged)),
            ("version", words(env!("CARGO_PKG_VERSION"))),
        ];
        mission_sample::table(&keys, &self.draws, meta)
    }
}
