//! The second half: measurements → predictions → residuals → fit → the missing effect.

pub mod diagnose;
pub mod fit;
pub mod independence;
pub mod likelihood;
pub mod measurement;
pub mod noise;
pub mod validate;
pub mod whitening;
